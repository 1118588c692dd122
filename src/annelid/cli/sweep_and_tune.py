"""The commands that vary a worm: `sweep` and `tune`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import (
    RIGID_PRESET,
    Assignments,
    Jobs,
    NamedPreset,
    Output,
    Quiet,
    kept_runs,
    overrides_of,
    print_results,
)
from annelid.cli.entry import EXIT_ALL_FAILED, command, complain, end_study, remark, typed_command
from annelid.cli.json_output import refuse_json


@command("sweep", "Vary")
def sweep_command(
    study: Annotated[Path | None, typer.Argument(metavar="STUDY.toml", help="The study; --example prints one.")] = None,
    output: Output = Path("sweep"),
    jobs: Jobs = None,
    samples: Annotated[
        int | None, typer.Option(min=1, max=1_000_000, help="Samples to draw.  [default: as the study has it]")
    ] = None,
    check: Annotated[
        int, typer.Option(min=0, metavar="N", help="Runs to repeat at half the step and with one more element.")
    ] = 0,
    example: Annotated[
        bool, typer.Option("--example", help="Print a study with comments, as a start for your own.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Vary fields over a grid or in samples.

    A study is a TOML file. It names a preset, fields that are the same in every run, and fields that are varied over
    numbers, choices or ranges. It runs every combination, or random, Latin hypercube or Sobol samples.

    Writes sweep.nc, one labelled dataset with all numbers; sweep.csv, one row per run; sweep.png and .svg. Runs are
    kept. A second call computes only what is missing or has failed, and one with more samples adds to them. A run that
    cannot be built, or whose workers die repeatedly, is listed with its reason, and the sweep goes on. For several
    machines, docs/sweeps.md has recipes in Python.

    With --check N, N complete runs, spread evenly over the sweep, run also at half the step and with one more element
    a side. The last sentence names those that are not resolved; the column check of sweep.csv says what moves.

    \b
    annelid sweep --example > study.toml
    annelid sweep study.toml
    annelid sweep study.toml --samples 512
    annelid sweep study.toml --check 4
    """
    refuse_json(example, "--example")
    if example:
        from importlib.resources import files

        typer.echo((files("annelid.experiment") / "sweep_example.toml").read_text(encoding="utf-8"), nl=False)
        return
    if study is None:
        raise typer.BadParameter("name a study: annelid sweep --example > study.toml  makes one to begin with")
    from annelid.config import load_study
    from annelid.experiment.sweep import checked_sentence, results_table, swept, write_results

    loaded = load_study(study)
    if samples is not None:
        loaded = load_study(loaded.model_dump(by_alias=True) | {"samples": samples})
    with kept_runs(output, jobs=jobs, quiet=quiet) as store:
        done = swept(loaded, output, executor=store.executor, check=check, progress=store.progress)
    sentences = [checked_sentence(done)] if check else []
    results = {"check": {i: one.to_dict() for i, one in done.checks.items()}} if check else {}
    print_results(write_results(done), results_table(done), *sentences, quiet=quiet, results=results)
    failed, stopped = (sum(run.status == status for run in done.runs) for status in ("failed", "stopped"))
    end_study(len(done.runs), failed, output / "sweep.csv", stopped=stopped)


@command("tune", "Vary")
def tune_command(
    preset: NamedPreset = RIGID_PRESET,
    output: Output = Path("tune"),
    objective: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="speed, cost-of-transport or slip; one or two of them.  [default: speed]"),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD=RANGE",
            help="A field as LOW:HIGH, LOW:HIGH:log or VALUE,VALUE,.., in its own unit; may be repeated."
            "  [default: timing and sensors of the preset's controller]",
        ),
    ] = None,
    assignments: Assignments = None,
    duration: Annotated[
        float | None, typer.Option(help="Simulated time of each run, s.  [default: the preset's]")
    ] = None,
    trials: Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of runs of the search.")] = 100,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Seed of the optimiser.")] = 0,
    numerics: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="SHARE",
            help="Refuse a gait if the integrator takes or adds more than this share of the muscles' work, such as 0.1"
            "  [default: any]",
        ),
    ] = None,
    jobs: Jobs = None,
    quiet: Quiet = False,
) -> None:
    """Search for a faster, cheaper or less slipping gait.

    An optimiser (a tree-structured Parzen estimator) varies fields of controller and body. Every run is judged over its
    complete cycles. A run that stops, falls silent, is out of order or does not advance counts as speed 0, cost of
    transport 100 and slip ratio 10.

    Writes after every generation: best.toml, which `annelid run` takes; trials.csv; tuning.png and .svg. With two
    objectives it also writes the folder front, with a file for each gait of the Pareto front. Runs are kept, so a
    second call continues the search, also with more trials. It needs pip install "annelid[tune]".

    \b
    annelid tune riddle2025-muscles
    annelid tune riddle2025-muscles --vary sensor.tolerance_m=0:0.02
    annelid tune riddle2025 --objective speed --objective slip --trials 200
    annelid run tune/best.toml
    """
    from annelid.experiment import tune
    from annelid.experiment.case import Case
    from annelid.plausibility import refuse_nonsense

    changes, objectives = overrides_of(assignments, duration_s=duration), tune.objectives_of(objective or ["speed"])
    base = Case(preset, changes).config
    for doubt in refuse_nonsense(base):
        remark(f"warning: {doubt}")
    task = tune.Task(preset, changes, tune.parsed_variables(vary or [], base), objectives, trials, seed, numerics)
    found: list[tune.Trial] = []
    written: list[Path] = []
    with kept_runs(output, jobs=jobs, quiet=quiet) as store:
        for generation in tune.search(task, store):
            found += generation
            written = tune.write_results(task, found, typed_command(), output)
    best = tune.leader(found, objectives)
    best_run = {"best_run": None if best is None else best.path.name}
    print_results(written, tune.results_table(task, found), quiet=quiet, results=best_run)
    end_study(len(found), sum(trial.failed for trial in found), output / tune.HISTORY)
    if best is None:
        complain(f"no trial walked, nor does the gait it starts from: the reasons are in {output / tune.HISTORY}")
        raise typer.Exit(EXIT_ALL_FAILED)

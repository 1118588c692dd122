"""The command `tune`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import (
    RIGID_PRESET,
    Assignments,
    ClusterName,
    Jobs,
    NamedPreset,
    Output,
    Quiet,
    kept_runs,
    overrides_of,
    print_results,
)
from annelid.cli.entry import EXIT_ALL_FAILED, complain, end_study, typed_command


def tune_command(
    preset: NamedPreset = RIGID_PRESET,
    output: Output = Path("tune"),
    objective: Annotated[
        list[str] | None,
        typer.Option(
            "--objective",
            metavar="NAME",
            help="speed, cost-of-transport or slip; one or two of them.  [default: speed]",
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="FIELD=RANGE",
            help="A field as LOW:HIGH, LOW:HIGH:log or VALUE,VALUE,..; may be repeated."
            "  [default: timing and sensors of the preset's controller]",
        ),
    ] = None,
    assignments: Assignments = None,
    duration: Annotated[
        float | None, typer.Option("--duration", help="Simulated time of each run, s.  [default: the preset's]")
    ] = None,
    trials: Annotated[int, typer.Option("--trials", min=1, max=1_000_000, help="Runs that the search may take.")] = 100,
    seed: Annotated[int, typer.Option("--seed", min=0, max=2**32 - 1, help="Of the optimiser.")] = 0,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Search for a faster, cheaper or less slipping gait.

    An optimiser (CMA-ES for one objective, a tree-structured Parzen estimator for two or where there are choices)
    varies fields of controller and body. Every run is judged over its whole cycles; one that stops, falls silent or
    out of order, or does not advance counts as no speed, a cost of transport of 100 and a slip ratio of 10.

    Writes after every generation: best.toml, which `annelid run` takes; trials.csv; tuning.png and .svg; with two
    objectives also front/, a file for each gait of the Pareto front. Runs are kept, so that a second call, also one
    with more trials, goes on where the first was stopped. Needs the extra: pip install 'annelid[tune]'.

    \b
    annelid tune riddle2025-muscles
    annelid tune riddle2025-muscles --vary controller.gate_time_constant_ms=80:600:log --vary sensor.tolerance_m=0:0.02
    annelid tune riddle2025 --objective speed --objective slip --trials 200 -o front
    annelid run tune/best.toml
    """
    from annelid.experiment.case import Case
    from annelid.experiment.tune.judge import objectives_of
    from annelid.experiment.tune.results import HISTORY, chosen, results_table, write_results
    from annelid.experiment.tune.search import Task, Trial, search
    from annelid.experiment.tune.space import variables_of
    from annelid.plausibility import refuse_nonsense

    changes, objectives = overrides_of(assignments, duration_s=duration), objectives_of(objective or ["speed"])
    base = Case(preset, changes).config
    for doubt in refuse_nonsense(base):
        complain(f"warning: {doubt}")
    variables = variables_of(vary or [], base)
    task = Task(preset, changes, variables, objectives, trials, seed)
    found: list[Trial] = []
    written: list[Path] = []
    with kept_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as store:
        for generation in search(task, store, progress=store.progress):
            found += generation
            written = write_results(task, found, typed_command(), output)
    print_results(written, results_table(task, found), quiet=quiet)
    end_study(len(found), sum(trial.failed for trial in found), output / HISTORY)
    if chosen(task, found) is None:
        complain(f"no trial walked, nor does the gait it starts from: the reasons are in {output / HISTORY}")
        raise typer.Exit(EXIT_ALL_FAILED)

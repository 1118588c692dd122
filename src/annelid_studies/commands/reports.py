"""The studies that have commands of many options: `paper`, `bench` and `challenge`."""

from __future__ import annotations

import json
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import typer

from annelid.cli import (
    Jobs,
    OnlyPaths,
    Output,
    Quiet,
    ResultsFolder,
    command,
    end_study,
    going_on,
    kept_runs,
    lock,
    print_results,
    study,
)
from annelid.errors import RunFileError


@command("paper", "")
@study("paper")
def paper_command(
    paper: Annotated[
        Literal["riddle2023", "riddle2025"], typer.Argument(help="riddle2025: the paper on the robot of six segments.")
    ] = "riddle2023",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder of the report.  [default: report, or riddle2025]")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="The same claims from fewer runs, in about 6 minutes.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Only the main numbers and this examination of riddle2023; may be repeated."),
    ] = None,
    jobs: Jobs = None,
    claims: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help="Also write the table of claims as Markdown.")
    ] = None,
    quiet: OnlyPaths = False,
) -> None:
    """Reproduce the paper's figures and claims, and examine them.

    Writes report.html, one file with all pictures, and report.md with its figures. It takes about an hour on two cores,
    with --quick about six minutes. Every run is kept in report/runs, so a second call continues where the first was
    stopped.

    With riddle2025 each point is eight runs with frictions within one percent, and every fourth point is run once more
    at half the step. The whole takes about two hours on two cores.

    \b
    annelid study paper                              into the folder report
    annelid study paper --quick -o draft             from coarser maps
    annelid study paper --only pins --only friction  these examinations only
    annelid study paper --claims docs/evidence/paper.md  for the repository
    annelid study paper riddle2025 --quick           few runs of the later paper
    """
    from annelid.output import with_suffix, write_text
    from annelid_studies.papers.report import claims_page, write_report
    from annelid_studies.tables import records

    if only and paper != "riddle2023":
        raise typer.BadParameter(f"--only names examinations of riddle2023, and {paper} has none: leave it out")
    if claims is not None:
        if only:
            raise typer.BadParameter("--claims needs the whole report, so leave --only out")
        claims = with_suffix(claims, (".md",), "Markdown", default=".md")
        if not claims.parent.is_dir():
            raise RunFileError(f"{claims} cannot be written: there is no folder {claims.parent}")
    output = output or Path("report" if paper == "riddle2023" else paper)
    reproduce = import_module(f"annelid_studies.{paper}.paper").reproduce
    examinations = {"only": only or None} if paper == "riddle2023" else {}
    with kept_runs(output, jobs=jobs, quiet=quiet) as store:
        effort = "quick" if quick else "full"
        report = reproduce(output, effort, executor=store.executor, progress=store.progress, **examinations)
        html = write_report(report, output)
    written = [html, html.with_suffix(".md"), *report.files]
    if claims is not None:
        written.append(write_text(claims, claims_page(report)))
    found = {
        "numbers": records(report.main_table),
        "claims": [asdict(claim) for claim in report.claims],
        "examinations": {one.examination.name: records(one.findings.table) for one in report.examinations},
    }
    print_results(written, quiet=quiet, results=found)


@study("bench")
def bench_command(
    output: ResultsFolder = Path("bench"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points: up to a quarter of an hour.")] = False,
    cases: Annotated[
        list[str] | None, typer.Option(metavar="LINE", help="Only these cases; may be repeated.  [default: all]")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Measure speed and error side by side.

    It times closed loops with their recording, each in its own process on one core. It compares their elongation,
    period, travel, work and slip with a converged run, three times with slightly different friction. Writes bench.json,
    with the time of each part of a step, and bench.png and .svg: error against speed, and cost against the number of
    segments.

    \b
    --cases levels    levels of --fidelity, and three presets
    --cases steps     physics steps of 1 to 40 ms
    --cases segments  rods of 3 to 96 segments
    --cases chain     the paper's formulation, 3 to 12 segments
    --cases duration  10 and 60 s, for the memory

    It takes up to half an hour. Run nothing else meanwhile: other programs change the times. Every measurement is kept
    in bench/cases, so a second call continues where the first was stopped, and a full run uses the results of --quick.
    Delete that folder to measure again.

    \b
    annelid study bench                           all, into the folder bench
    annelid study bench --quick                   an overview
    annelid study bench --cases levels -o levels  levels and presets only
    annelid study bench --cases segments          cost against segments
    """
    from annelid.experiment import study_progress
    from annelid_studies.bench.benchmark import bench
    from annelid_studies.bench.report import bench_figure, bench_table

    lock(output)
    with going_on(output / "cases", kept="what was measured is kept"), study_progress(quiet=quiet) as progress:
        path = bench(output, "quick" if quick else "full", lines=cases or None, progress=progress)
    report = json.loads(path.read_text(encoding="utf-8"))
    tables = [] if quiet else [bench_table(report)]
    print_results((path, bench_figure(report, output / "bench")), *tables, quiet=quiet)
    end_study(len(report["cases"]), sum("failed" in case for case in report["cases"]), path)


@study("challenge")
def challenge_command(
    entrants: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[ENTRANT]...",
            help="Names of entrants, files of entrants (.toml), or module:name of a controller of your own."
            "  [default: all that annelid has]",
        ),
    ] = None,
    task: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this task; may be repeated.  [default: all]")
    ] = None,
    body: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Only this body, three or six; may be repeated.  [default: both]"),
    ] = None,
    draws: Annotated[int, typer.Option(min=1, max=1000, help="Draws of every task.")] = 8,
    half_step: Annotated[
        bool, typer.Option("--half-step/--no-half-step", help="Run one draw in eight at half the step, too.")
    ] = True,
    tune: Annotated[
        int | None,
        typer.Option(min=1, max=10000, metavar="N", help="Search the entrants' fields in N trials, and rank nothing."),
    ] = None,
    train: Annotated[
        int | None,
        typer.Option(
            min=1000, max=10**8, metavar="STEPS", help="Train a network by reinforcement learning, and rank nothing."
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Two tasks, three entrants, one body, two draws: under five minutes.")
    ] = False,
    known: Annotated[
        list[Path] | None,
        typer.Option("--with", metavar="RUNS.csv", help="Use the runs of another call; may be repeated."),
    ] = None,
    output: Output = Path("challenge"),
    jobs: Jobs = None,
    quiet: Quiet = False,
) -> None:
    """Rank controllers in a benchmark of crawling.

    Every entrant runs every task on both bodies with the same draws, and is built without knowing them. The tuned
    timed wave always runs too, as the reference. Writes runs.csv, one row per run; scores.csv, means with 95 %
    intervals; pairs.csv, every two entrants on the same draws; challenge.png and .svg. Runs are kept: a second call
    takes seconds, and the same command continues an interrupted one. The whole takes a night on two cores;
    docs/evidence/challenge.md has tasks, rules and results.

    With --tune it searches the fields that entrants list under `vary`, on training draws. It writes entrants.toml and
    trials.csv.

    With --train it trains a network for each body on training draws (pip install 'annelid[learn]'). It writes
    policy.toml, a file of entrants, and the learning curves policy.csv and policy.png. 10,000 steps take half an hour.

    \b
    annelid study challenge --quick                             in minutes
    annelid study challenge                                     everything
    annelid study challenge mine:Controller --task slope        your own
    annelid study challenge mine.toml --with published.csv      run only yours
    annelid study challenge mine.toml --tune 32 -o tuned        tune it first
    annelid study challenge --train 10000 -o trained            train a network
    """
    from annelid.experiment import study_progress
    from annelid_studies.challenge import report, tasks
    from annelid_studies.challenge.ranking import Pair, Standing, half_step_changes, pairs, standings
    from annelid_studies.challenge.scores import Score, challenge, read_scores
    from annelid_studies.challenge.tuning import Trial, write_entrants
    from annelid_studies.challenge.tuning import tune as tuned

    if train is not None:
        from annelid_studies.challenge import learning

        lock(output)
        with going_on(output, kept="checkpoints are kept"), study_progress(quiet=quiet) as progress:
            print_results(learning.train(body or [], train, output, progress), quiet=quiet)
        return
    if quick:
        entrants, task = entrants or [*tasks.QUICK_ENTRANTS], task or [*tasks.QUICK_TASKS]
        body, draws, half_step = body or [*tasks.QUICK_BODIES], min(draws, tasks.QUICK_DRAWS), False
    duration_s = tasks.QUICK_DURATION_S if quick else None
    found = tasks.find_entrants(entrants or [])
    if tune is not None:
        if entrants:
            found = {name: one for name, one in found.items() if name != tasks.REFERENCE or name in entrants}
        with kept_runs(output, jobs=jobs, quiet=quiet) as store:
            best, trials = tuned(found, tune, store, bodies=body or [], tasks=task or [], duration_s=duration_s)
        written = [
            write_entrants(best, output / "entrants.toml"),
            report.write_rows(Trial, trials, output / "trials.csv"),
        ]
        print_results(written, quiet=quiet)
        return
    earlier = [one for path in known or [] for one in read_scores(path)]
    seeds = range(tasks.FIRST_TEST_SEED, tasks.FIRST_TEST_SEED + draws)
    wanted = tasks.entries(found, task or [], seeds, bodies=body or [], duration_s=duration_s)
    if half_step:
        some = seeds[: -(-draws // tasks.HALF_OF)]
        wanted += tasks.entries(found, task or [], some, bodies=body or [], finer=2, duration_s=duration_s)
    with kept_runs(output, jobs=jobs, quiet=quiet) as store:
        every = challenge(store, wanted, earlier)
    of_own = [one for one in every if found[one.entrant].preset is not None]
    scores = [one for one in every if found[one.entrant].preset is None]
    ranked, compared, changes = standings(scores), pairs(scores), half_step_changes(scores)
    written = [
        report.write_rows(Score, every, output / "runs.csv"),
        report.write_rows(Standing, ranked, output / "scores.csv"),
        report.write_rows(Pair, compared, output / "pairs.csv"),
        report.ranking_figure(scores, output / "challenge"),
    ]
    tables = [report.ranking_table(ranked, changes), *report.speed_tables(ranked), report.pairs_table(compared)]
    if of_own:
        tables.append(report.own_bodies_table([one for one in of_own if one.finer == 1]))
    if any(one.refused for one in every):
        tables.append(report.refused_table(every))
    print_results(written, *tables, quiet=quiet)

"""The commands `paper`, `robustness` and `bench`, each a whole study."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs, Quiet, going_on, print_results, study_runs
from annelid.cli.entry import end_study, lock
from annelid.errors import RunFileError


def paper_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the report.")] = Path("report"),
    quick: Annotated[bool, typer.Option("--quick", help="Coarser maps, the same claims: about 6 minutes.")] = False,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="NAME", help="Only this examination, and the main numbers; may be repeated."),
    ] = None,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    claims: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help="Write the table of claims there as well, as Markdown.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the paths.")] = False,
) -> None:
    """Reproduce the paper's figures and claims, and examine them.

    Writes report.html, one file with all pictures to read and to send, and report.md beside its figures.
    The whole takes about an hour on two cores, --quick about 6 min. Every run is kept in report/runs, so
    a second call takes seconds, and a killed one goes on where it was.

    \b
    annelid paper                                      the whole, into the folder report
    annelid paper --quick -o draft                     the same claims from coarser maps
    annelid paper --only pins --only friction          these examinations only
    annelid paper -o report --claims docs/paper.md     and the table of claims for the repository
    """
    from annelid.output import whole_file, with_suffix
    from annelid_studies.riddle2023.paper import reproduce
    from annelid_studies.riddle2023.report import claims_page, write_report

    if claims is not None:
        if only:
            raise typer.BadParameter("--claims needs the whole report, so leave --only out")
        claims = with_suffix(claims, (".md",), "Markdown", default=".md")
        if not claims.parent.is_dir():
            raise RunFileError(f"{claims} cannot be written: there is no folder {claims.parent}")
    with study_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as (workers, progress):
        effort = "quick" if quick else "full"
        report = reproduce(output, effort, only=only or None, workers=workers, progress=progress)
        html = write_report(report, output)
    if claims is not None:
        with whole_file(claims) as draft:
            draft.write_text(claims_page(report), encoding="utf-8")
    print_results((html, html.with_suffix(".md"), *([claims] if claims else [])), quiet=quiet)


def robustness_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("robustness"),
    points: Annotated[int, typer.Option("--points", min=1, max=1_000_000, help="How many points of the sample.")] = 300,
    segments: Annotated[
        int | None,
        typer.Option(min=3, max=200, help="Give every worm this many segments.  [default: as drawn, 3 to 24]"),
    ] = None,
    controller: Annotated[
        list[str] | None,
        typer.Option("--controller", metavar="KIND", help="Only this one; may be repeated.  [default: all four]"),
    ] = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep what robustness.json says of points run by other versions of the code.")
    ] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the paths.")] = False,
) -> None:
    """Compare how often controllers walk over a designed sample of worms.

    The sample varies sensor noise, friction, physics step, number of segments and stiffness. Every point is walked
    by four controllers: sns (the paper's, with the preset's tolerance), sns-tolerance (the paper's, with the
    tolerance that its body needs), sns-robust, and timed (a wave without sensing). Writes robustness.json and
    robustness.md after every run, and keeps runs, so that a second call goes on where the first was stopped. All 300
    points take about 25 hours of one core for each controller.

    \b
    annelid robustness --points 10 -o draft     the first ten points
    annelid robustness --segments 3             short worms only
    annelid robustness --controller sns-robust  only ours
    annelid robustness --points 300             all
    """
    from annelid_studies.robustness import CONTROLLERS, robustness, shares, shares_table

    with study_runs(output, jobs=jobs, cluster=cluster, quiet=quiet) as (workers, progress):
        judged = robustness(
            output,
            points,
            controllers=tuple(controller or CONTROLLERS),
            n_segments=segments,
            keep=keep,
            workers=workers,
            progress=progress,
        )
    if not quiet:
        typer.echo(shares_table(shares(judged)))
    for name in ("robustness.json", "robustness.md"):
        typer.echo(output / name)


def bench_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("bench"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points, one converged run: 3 minutes.")] = False,
    cases: Annotated[
        list[str] | None,
        typer.Option("--cases", metavar="LINE", help="Only these cases; may be repeated.  [default: all]"),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Measure speed and error side by side.

    Times closed loops with their recording, each in a process of its own on one core, and compares their
    elongation and period with runs that are converged in time. Writes bench.json, bench.png and bench.svg:
    error against speed, cost against the number of segments, and where the time of a step goes.

    \b
    --cases levels      the levels of --fidelity
    --cases steps       physics steps of 1 to 40 ms
    --cases elements    1 to 6 elements a rhombus side
    --cases segments    rods of 3 to 30 segments
    --cases chain       the paper's formulation, 3 to 12 segments
    --cases duration    10 and 60 s, for the memory
    --cases peer        free rods of PyElastica, if it is installed

    The whole takes about 15 minutes. Leave the machine alone meanwhile: what else runs is measured too.
    Every measurement is kept in bench/cases, so a second call goes on where the first one was stopped, and
    a full run takes over what --quick measured. Delete that folder to measure again.

    \b
    annelid bench                                   everything, into the folder bench
    annelid bench --quick                           an overview
    annelid bench --cases levels -o levels          the levels of fidelity only
    annelid bench --cases segments --cases chain    how the cost grows with the worm
    """
    import json

    from annelid.experiment.progress import study_progress
    from annelid_studies.bench.benchmark import bench
    from annelid_studies.bench.report import bench_figure, bench_table

    lock(output)
    with going_on(output / "cases", kept="what was measured is kept"), study_progress(quiet=quiet) as progress:
        path = bench(output, "quick" if quick else "full", lines=cases or None, progress=progress)
    report = json.loads(path.read_text(encoding="utf-8"))
    tables = [] if quiet else [bench_table(report)]
    print_results((path, bench_figure(report, output / "bench")), *tables, quiet=quiet)
    end_study(len(report["cases"]), sum("failed" in case for case in report["cases"]), path)

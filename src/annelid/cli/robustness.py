# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The command `robustness`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs, workers_for
from annelid.cli.entry import EXIT_INTERRUPTED, complain, lock


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
    from annelid.experiment.progress import study_progress
    from annelid_studies.robustness import CONTROLLERS, robustness, shares, shares_table

    lock(output)
    try:
        with workers_for(cluster, jobs) as workers, study_progress(quiet=quiet) as progress:
            judged = robustness(
                output,
                points,
                controllers=tuple(controller or CONTROLLERS),
                n_segments=segments,
                keep=keep,
                jobs=jobs,
                workers=workers,
                progress=progress,
            )
    except KeyboardInterrupt:
        words = ["annelid", "robustness", "-o", str(output), "--points", str(points)]
        words += ["--segments", str(segments)] if segments else []
        words += [word for kind in controller or () for word in ("--controller", kind)]
        words += ["--keep"] if keep else []
        words += ["--cluster", cluster] if cluster else []
        again = shlex.join([*words, *(["--jobs", str(jobs)] if jobs else [])])
        complain(f"interrupted: finished runs are kept in {output / 'runs'}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if not quiet:
        typer.echo(shares_table(shares(judged)))
    for name in ("robustness.json", "robustness.md"):
        typer.echo(output / name)

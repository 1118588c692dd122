# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The command `robustness`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.entry import EXIT_INTERRUPTED, complain
from annelid.errors import RunFileError


def robustness_command(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("robustness"),
    points: Annotated[int, typer.Option("--points", min=1, help="How many points of the sample, as drawn.")] = 300,
    segments: Annotated[
        int | None, typer.Option(min=3, help="Give every worm this many segments.  [default: as drawn, 3 to 24]")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at a time.  [default: as many as there are cores]")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, only the paths.")] = False,
) -> None:
    """Compare how often controllers walk over a designed sample of worms.

    The sample varies sensor noise, friction, physics step, number of segments and stiffness. Every point is walked
    by the paper's controller and by sns-robust. Writes robustness.json and robustness.md after every point; runs
    are kept, so that a second call goes on where the first was stopped. All 300 points take days of one core.

    \b
    annelid robustness --points 10 -o draft     the first ten points
    annelid robustness --segments 3             short worms only
    annelid robustness --points 300             all
    """
    from annelid.studies.progress import study_progress
    from annelid.studies.robustness import robustness, shares, shares_table

    if output.exists() and not output.is_dir():
        raise RunFileError(f"{output} is a file: name a folder with -o")
    try:
        with study_progress(quiet=quiet) as progress:
            judged = robustness(output, points, n_segments=segments, jobs=jobs, progress=progress)
    except KeyboardInterrupt:
        words = ["annelid", "robustness", "-o", str(output), "--points", str(points)]
        words += ["--segments", str(segments)] if segments else []
        again = shlex.join([*words, *(["--jobs", str(jobs)] if jobs else [])])
        complain(f"interrupted: finished runs are kept in {output / 'runs'}; go on with: {again}")
        raise typer.Exit(EXIT_INTERRUPTED) from None
    if not quiet:
        typer.echo(shares_table(shares(judged)))
    for name in ("robustness.json", "robustness.md"):
        typer.echo(output / name)

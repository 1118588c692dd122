# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The command `experiment pipes`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs
from annelid.cli.experiment.kept import Output, Quiet, kept_runs


def pipes_command(
    output: Output = Path("pipes"),
    quick: Annotated[bool, typer.Option("--quick", help="The taper with two gaits, and one bend.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Find out which pipes the worm passes, and how fast.

    The six-segment worm with ideal muscles goes through a taper and an hourglass down to a radius of 0.13 m: with one
    nervous system whose wave keeps its pace, adapts it to the pressure on the worm's back, or is fast throughout; with
    the paper's nervous system, and with the timed pattern 3x1. And round bends of 90 degrees with that pattern, the
    same turning away from contact, the paper's nervous system and the robust one. Speeds are those along the pipe's
    centre line.

    Writes pipes.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes on.
    34 runs of half a minute to three minutes each; docs/pipes.md explains the results.

    \b
    annelid experiment pipes --quick
    annelid experiment pipes -o pipes
    """
    from annelid.terminal import Console
    from annelid_studies.pipes import pass_pipes, pipes_picture, pipes_table, trials, write_readings

    with kept_runs(["pipes"], output, quick=quick, jobs=jobs, cluster=cluster, quiet=quiet) as (store, progress):
        found = pass_pipes(store, trials(quick), jobs=jobs, progress=progress)
    if not quiet:
        Console().print(pipes_table(found.readings))
    path = write_readings(found.readings, output / "pipes.csv")
    for written in (path, pipes_picture(found, path.with_suffix(""))):
        typer.echo(written)

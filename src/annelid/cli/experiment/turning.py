# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The command `experiment turning`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs
from annelid.cli.experiment.kept import Output, Quiet, kept_runs


def turning_command(
    output: Output = Path("turning"),
    quick: Annotated[bool, typer.Option("--quick", help="The strongest modulation to either side only.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Find out on which radius the worm turns.

    The authors' six-segment robot with half-rings crawls on flat ground under constant modulations of its two sides,
    with three gaits: the timed pattern 3x1 with all segments modulated alike, the same with the middle segments bent
    the other way, and the nervous system with ideal muscles.

    Writes turning.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes
    on. 21 runs of some seconds to a minute each; docs/turning.md explains the results.

    \b
    annelid experiment turning --quick
    annelid experiment turning -o turning
    """
    from annelid.terminal import Console
    from annelid_studies.turning import MODULATIONS, QUICK, turning, turning_picture, turning_table, write_readings

    with kept_runs(["turning"], output, quick=quick, jobs=jobs, cluster=cluster, quiet=quiet) as (store, progress):
        turned = turning(store, QUICK if quick else MODULATIONS, jobs=jobs, progress=progress)
    if not quiet:
        Console().print(turning_table(turned.readings))
    path = write_readings(turned.readings, output / "turning.csv")
    for written in (path, turning_picture(turned, path.with_suffix(""))):
        typer.echo(written)

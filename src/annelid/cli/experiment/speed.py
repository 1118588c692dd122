# ruff: noqa: D301 -- the help texts need a real backspace: it keeps the lines of an example apart.
"""The command `experiment speed`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import ClusterName, Jobs
from annelid.cli.experiment.kept import Output, Quiet, kept_runs


def speed_command(
    gaits: Annotated[
        list[str] | None,
        typer.Argument(metavar="[PRESET|FILE.toml]...", help="Gaits.  [default: riddle2025-muscles and crawler]"),
    ] = None,
    output: Output = Path("speed"),
    quick: Annotated[bool, typer.Option("--quick", help="Two values of each quantity.")] = False,
    jobs: Jobs = None,
    cluster: ClusterName = None,
    quiet: Quiet = False,
) -> None:
    """Find out how fast gaits crawl over friction and number of segments.

    Every gait crawls on ground of friction 0.05 to 1.5, and with 3 to 12 segments, whose inner rings are all as strong
    as its second. Speed, stride, period, cost of transport and slip are those of whole cycles.

    Writes speed.csv, .png and .svg, and keeps runs, so that a second call takes seconds and an interrupted one goes
    on. Some 15 runs a gait of about ten seconds each; docs/speed_of_travel.md explains the results.

    \b
    annelid experiment speed --quick
    annelid experiment speed
    annelid experiment speed crawler tune/best.toml -o mine
    """
    from annelid.terminal import Console
    from annelid_studies.crawling import GAITS, VALUES, crawl, crawling_table, points, write_figure, write_readings

    words = ["speed", *(gaits or [])]
    with kept_runs(words, output, quick=quick, jobs=jobs, cluster=cluster, quiet=quiet) as (store, progress):
        readings = crawl(store, points(gaits or GAITS, "quick" if quick else "full"), jobs=jobs, progress=progress)
    if not quiet:
        for quantity in VALUES:
            Console().print(crawling_table(readings, quantity))
    path = output / "speed.csv"
    write_readings(readings, path)
    for written in (path, write_figure(readings, path.with_suffix(""))):
        typer.echo(written)

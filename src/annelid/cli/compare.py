"""The command `compare`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import Force, refuse_existing
from annelid.cli.entry import complain, lock
from annelid.errors import RunFileError


def compare_command(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN RUN..", help="Folders of runs, or their run.nc; differences are to the first."),
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as JSON, in SI units.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for the figures and comparison.json  [default: only print]"),
    ] = None,
    potentials: Annotated[bool, typer.Option("--potentials", help="Draw the potentials of the neurons too.")] = False,
    force: Force = False,
) -> None:
    """Lay runs side by side: numbers, differences, figures.

    Prints the numbers of every run with their differences to the first, and the fields in which the configurations
    differ. What a run lacks is a dash, so worms of any kinds can be compared. With -o it draws all runs into one
    figure each: lengths.png, travel.png, and potentials.png with --potentials.

    \b
    annelid compare runs/riddle2023-rods-001 runs/riddle2023-rods-002
    annelid compare runs/riddle2023-rods-001 runs/riddle2022-planar-001 -o comparison
    annelid compare runs/* --json | jq .numbers.period_s
    """
    from annelid.analysis.comparison import compare
    from annelid.draw.figures.comparison import lengths_figure, potentials_figure, travel_figure
    from annelid.draw.table import comparison_table, fields_table
    from annelid.output import write_json
    from annelid.simulation.runfile import open_run
    from annelid.terminal import Console

    if len(runs) < 2:
        raise typer.BadParameter("name at least two runs to compare")
    if potentials and output is None:
        raise typer.BadParameter("--potentials draws a figure, so it needs a folder: -o FOLDER")
    figures = {"lengths.png": lengths_figure, "travel.png": travel_figure}
    if potentials:
        figures["potentials.png"] = potentials_figure
    if output is not None:
        lock(output)
        for name in ("comparison.json", *figures):
            refuse_existing(output / name, force)
    opened = [open_run(run) for run in runs]
    comparison = compare(opened)
    if as_json:
        typer.echo(json.dumps(comparison.to_dict(), indent=2, allow_nan=False))
    else:
        Console().print(comparison_table(comparison))
        Console().print(fields_table(comparison) if comparison.fields else "the configurations are the same")
    if output is None:
        return
    written = [write_json(output / "comparison.json", comparison.to_dict())]
    for name, draw in figures.items():
        try:
            written.append(draw(opened, comparison.labels, output / name))
        except RunFileError as error:
            complain(f"{name} not drawn: {error}")
    for path in written:
        typer.echo(path, err=as_json)

"""The command `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import Force, RunPath, refuse_existing
from annelid.cli.entry import lock
from annelid.errors import RunFileError


def export_command(
    run: RunPath,
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help="csv, mat, parquet, mp4, gif, html or mjcf.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="File to write, or folder of csv and parquet  [default: in the run]"),
    ] = None,
    signals: Annotated[
        str | None,
        typer.Option(metavar="NAME,NAME,..", help="Only these signals (csv, mat, parquet)  [default: all]"),
    ] = None,
    every: Annotated[
        int | None,
        typer.Option(
            min=1, max=10_000_000, metavar="N", help="Only every Nth sample, and every Nth frame (csv, mat, parquet)."
        ),
    ] = None,
    from_time: Annotated[
        float | None, typer.Option("--from-time", metavar="SECONDS", help="From this time on (not mjcf).")
    ] = None,
    to_time: Annotated[
        float | None, typer.Option("--to-time", metavar="SECONDS", help="Up to this time (not mjcf).")
    ] = None,
    force: Force = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")] = False,
) -> None:
    """Write a run as tables, MATLAB, video, HTML or MJCF.

    \b
    csv      a table for all signals of the same dimensions, units in the header; about.json says what the run is
    mat      one MATLAB file: a variable for each signal; structs with units, labels and the configuration
    parquet  the same tables as csv, units in the metadata (pip install 'annelid[export]')
    mp4 gif  a video; annelid render has camera, speed and frame rate
    html     one page that needs nothing else: numbers, figures, configuration, what to cite
    mjcf     the model for plain MuJoCo, the last state as a keyframe

    \b
    annelid export runs/riddle2023-rods-001 --to csv
    annelid export runs/riddle2023-rods-001 --to csv --signals ring_length,muscle_force -o rings.csv
    annelid export runs/riddle2023-rods-001 --to mat --every 10 --from-time 2 --to-time 4 -o two_seconds.mat
    annelid export runs/riddle2023-rods-001 --to html -o report.html
    """
    from annelid.draw.gallery import task_bar
    from annelid.export import Selection, find_format, selected
    from annelid.simulation.runfile import open_run

    kind = find_format(to)
    given = {"--signals": signals, "--every": every, "--from-time": from_time, "--to-time": to_time}
    for option, value in given.items():
        if value is not None and option not in kind.options:
            valid = f"takes {', '.join(sorted(kind.options))}" if kind.options else "takes the whole run"
            raise RunFileError(f"{option} has no effect on {kind.name}, which {valid}")
    kind.require()
    opened = open_run(run)
    target = kind.target(opened, output)
    if output is not None:
        if kind.many and target.suffix.lower() != kind.suffix:
            lock(target)
        _refuse_standing(target, kind.many, force)
    names = None if signals is None else [name.strip() for name in signals.split(",") if name.strip()]
    part = selected(opened, Selection(names, every or 1, from_time, to_time))
    with task_bar(f"exporting to {kind.name}", quiet=quiet) as progress:
        written = kind.write(part, target, progress or (lambda done, total: None))
    for path in written:
        typer.echo(path)


def _refuse_standing(target: Path, many: bool, force: bool) -> None:
    """Keeps what stands in the way; a folder of tables may be there already, but not with something in it."""
    from annelid.simulation.lock import LOCK_NAME

    if not many or target.is_file():
        refuse_existing(target, force)
    elif not force and target.is_dir() and any(entry.name != LOCK_NAME for entry in target.iterdir()):
        raise RunFileError(f"the folder {target} is not empty: name another with -o, or write into it with --force")

"""The command `runs`: lists the runs that are there, and removes those that the user names."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.entry import complain
from annelid.cli.result import give, refuse_json
from annelid.errors import ConfigError, listed


def runs_command(
    folder: Annotated[Path, typer.Argument(help="Folder to look in, with all folders below it.")] = Path("runs"),
    clean: Annotated[
        list[Path] | None,
        typer.Option("--clean", metavar="RUN", help="Remove this run, a folder of the list; may be repeated."),
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before --clean removes anything.")] = False,
) -> None:
    """List the runs that are there, or remove some.

    Prints the folder, preset, simulated time, size, date and end of every run and of every outcome that a study kept.
    --clean removes only files that annelid wrote for a run: run.nc, outcome.json, figure7.png, frame.png, video.mp4.
    A folder with anything else in it stays. A run that is being written or cannot be read is refused.

    \b
    annelid runs
    annelid runs sweep --json
    annelid runs --clean runs/riddle2023-001 --yes
    """
    from annelid.experiment.kept import remove, runs_below

    refuse_json(bool(clean), "--clean")
    found = list(runs_below(folder)) if folder != Path("runs") or folder.is_dir() else []
    if clean:
        # Paths to remove come from the list, never from what was typed.
        named = {path.resolve() for path in clean}
        chosen = [run for run in found if run.folder.resolve() in named]
        if missing := named - {run.folder.resolve() for run in chosen}:
            raise ConfigError(f"no run of {folder}: {listed(sorted(path.name for path in missing))}")
        typer.echo("\n".join(str(run.folder) for run in chosen))
        if not yes:
            typer.confirm(
                f"Remove {len(chosen)} runs, {sum(run.size_bytes for run in chosen) / 1e6:.1f} MB?", abort=True
            )
        for run in chosen:
            remove(run)
            if run.folder.exists():
                complain(f"{run.folder} stays: it has other files")
        return
    if give([asdict(run) for run in found]):
        return
    from rich.table import Table

    from annelid.terminal import Console

    table = Table("folder", "preset", "time (s)", "size (MB)", "written (UTC)", "end", box=None)
    table.columns[0].overflow = "fold"
    table.columns[1].no_wrap = True
    for run in found:
        duration = "-" if run.duration_s is None else f"{run.duration_s:g}"
        size = f"{run.size_bytes / 1e6:.1f}"
        table.add_row(str(run.folder), run.preset or "-", duration, size, run.changed[:10], run.status)
    Console().print(table)

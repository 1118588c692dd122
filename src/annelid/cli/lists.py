"""The commands `list ..`: presets, arenas, and the runs that are there, which it removes where the user names them."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from annelid.cli.common import FIRST_PRESET
from annelid.cli.entry import complain, listing
from annelid.cli.result import give, refuse_json, wants_json
from annelid.errors import ConfigError, listed


@listing("presets")
def presets_command(
    name: Annotated[str | None, typer.Argument(help="Print this preset or TOML file whole.")] = None,
    fields: Annotated[bool, typer.Option("--fields", help="List every field with its meaning.")] = False,
) -> None:
    """List the presets, or print one with all its fields.

    Each field has its source, and the preset that it is inherited from. What the command prints is a start for a file
    of your own. Of a file that extends a preset it prints the whole worm, too.

    \b
    annelid list presets
    annelid list presets riddle2023 > my.toml
    annelid list presets my.toml
    annelid list presets riddle2023 --fields
    """
    from annelid.config import load_config, preset_names, preset_text
    from annelid.draw.table import field_lines, presets_table
    from annelid.terminal import Console

    refuse_json(name is not None or fields, "a name or --fields")
    if wants_json():
        known = [load_config(each) for each in preset_names()]
        rows = [(c.name, c.summary, c.body.n_segments, c.duration_s) for c in known]
        keys = ("name", "summary", "n_segments", "duration_s")
        give([dict(zip(keys, each, strict=True)) for each in rows])
        return
    if name is not None and not fields:
        typer.echo(preset_text(name), nl=False)
        return
    if fields:
        typer.echo("\n".join(field_lines(load_config(FIRST_PRESET if name is None else name))))
        return
    Console().print(presets_table([load_config(each) for each in preset_names()]))


@listing("arenas")
def arenas_command(
    name: Annotated[str | None, typer.Argument(help="Print this arena's commented TOML.")] = None,
) -> None:
    """List the arenas for a 3D worm, or print one.

    What it prints is a start for a file of your own; any field can be set with --set.

    \b
    annelid list arenas
    annelid list arenas pipe.bend > my_pipe.toml
    annelid run --arena my_pipe.toml --set arena.radius=0.8
    """
    from annelid.config import arena_names, arena_summary, arena_text
    from annelid.draw.table import arenas_table
    from annelid.terminal import Console

    refuse_json(name is not None, "a name")
    if name is not None:
        typer.echo(arena_text(name), nl=False)
        return
    summaries = {each: arena_summary(each) for each in arena_names()}
    if not give([{"name": each, "summary": summary} for each, summary in summaries.items()]):
        Console().print(arenas_table(summaries))


@listing("runs")
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
    annelid list runs
    annelid list runs sweep --json
    annelid list runs --clean runs/riddle2023-001 --yes
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

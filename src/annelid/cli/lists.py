"""The commands `list ..`: presets, arenas, the numbers of a run, and runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from annelid.cli.common import FIRST_PRESET
from annelid.cli.entry import listing
from annelid.cli.json_output import give, refuse_json

if TYPE_CHECKING:
    from annelid.config import RunConfig


@listing("presets")
def presets_command(
    name: Annotated[str | None, typer.Argument(help="Print this preset or TOML file.")] = None,
    fields: Annotated[bool, typer.Option("--fields", help="List every field with its meaning.")] = False,
) -> None:
    """List the presets, or print one.

    A preset is printed as a file that you can change, with the source of every number. The presets that it extends
    follow as comments. With --fields all fields of the worm are listed with their values and meanings.

    \b
    annelid list presets
    annelid list presets riddle2023 > my.toml
    annelid list presets my.toml
    annelid list presets riddle2023 --fields
    """
    from annelid.config import load_config, preset_names, preset_text

    refuse_json(name is not None or fields, "a name or --fields")
    if fields:
        typer.echo("\n".join(_field_lines(load_config(FIRST_PRESET if name is None else name))))
    elif name is not None:
        typer.echo(preset_text(name), nl=False)
    else:
        known = [load_config(each) for each in preset_names()]
        keys = ("name", "summary", "n_segments", "duration_s")
        rows = [(one.name, one.summary, one.body.n_segments, one.duration_s) for one in known]
        if not give([dict(zip(keys, row, strict=True)) for row in rows]):
            shown = ((*row[:2], str(row[2]), f"{row[3]:g} s") for row in rows)
            _print_table(("preset", "what it is", "segments", "simulated"), shown)


def _field_lines(config: RunConfig) -> list[str]:
    """Returns one line for every field of a configuration: path, value as TOML writes it, and what it means."""
    from annelid.config import field_value, fields_of, toml_value

    lines = []
    for path, meaning in fields_of(config).items():
        value = field_value(config, path)
        setting = f"{path} (not set)" if value is None else f"{path} = {toml_value(value)}"
        lines.append(f"{setting:<60}{'  # ' if meaning else ''}{meaning}".rstrip())
    return lines


@listing("numbers")
def numbers_command() -> None:
    """List the numbers of a run: name, unit, and what each is.

    A name is the same in `annelid show --json`, in the files of a sweep, in tables as CSV, and in Python:
    annelid.summary(run).period_s. A number that each segment has is a list. A sweep may output all numbers that are not
    marked as words.

    \b
    annelid list numbers
    annelid list numbers --json
    """
    from annelid.analysis import NUMBERS

    keys = ("name", "unit", "section", "meaning", "per_segment", "in_sweeps")
    rows = [(n.name, n.unit, n.section.__name__, n.meaning, n.per_segment, n.in_sweeps) for n in NUMBERS.values()]
    if not give([dict(zip(keys, row, strict=True)) for row in rows]):
        marks = (("per segment" if each else "", "" if swept else "words") for *_, each, swept in rows)
        shown = ((*row[:2], ", ".join(filter(None, mark)), row[3]) for row, mark in zip(rows, marks, strict=True))
        _print_table(("number", "unit", "", "what it is"), shown)


@listing("arenas")
def arenas_command(
    name: Annotated[str | None, typer.Argument(help="Print this arena's commented TOML.")] = None,
) -> None:
    """List the arenas for a 3D worm, or print one.

    Save what it prints as a file of your own and change it, or set any field with --set.

    \b
    annelid list arenas
    annelid list arenas pipe.bend > my_pipe.toml
    annelid run --arena my_pipe.toml --set arena.radius=0.8
    """
    from annelid.config import arena_names, arena_summary, arena_text

    refuse_json(name is not None, "a name")
    if name is not None:
        typer.echo(arena_text(name), nl=False)
        return
    summaries = {each: arena_summary(each) for each in arena_names()}
    if not give([{"name": each, "summary": summary} for each, summary in summaries.items()]):
        _print_table(("arena", "what it is"), summaries.items())


def _print_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    from rich.table import Table

    from annelid.terminal import Console

    table = Table(*headings, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    Console().print(table)


@listing("runs")
def runs_command(
    folder: Annotated[Path, typer.Argument(help="Folder to look in, with all folders below it.")] = Path("runs"),
) -> None:
    """List the runs below a folder.

    Prints the folder, preset, simulated time, size, date and end of every run and of every outcome that a study kept.

    \b
    annelid list runs
    annelid list runs sweep --json
    """
    from annelid.experiment.run_list import runs_below

    found = list(runs_below(folder)) if folder != Path("runs") or folder.is_dir() else []
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

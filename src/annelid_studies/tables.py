"""Readings grouped, averaged, and laid out as a table for the terminal, for a report, and as CSV."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple
from math import isfinite
from pathlib import Path
from typing import Any, TypeVar

from rich.box import SIMPLE_HEAD
from rich.table import Table as TerminalTable

from annelid.markdown import Table
from annelid.output import write_csv

T = TypeVar("T")
K = TypeVar("K")
Results = tuple[Sequence[Path], Sequence[TerminalTable]]
"""What a study leaves: the files that it has written, and tables for the terminal."""


YES: Mapping[bool | None, str] = {True: "yes", False: "no", None: "-"}
"""How tables print whether something is so."""


def grouped(items: Iterable[T], key: Callable[[T], K]) -> dict[K, list[T]]:
    """Groups things by what a function returns for them, in the order in which they come."""
    found: dict[K, list[T]] = {}
    for item in items:
        found.setdefault(key(item), []).append(item)
    return found


def tabulated(rows: Iterable[T], columns: Mapping[str, Callable[[T], str]]) -> Table:
    """Makes a table of things, one a row, from what each column writes of a row, by its head."""
    return Table(list(columns), [[cell(row) for cell in columns.values()] for row in rows])


def interval(mean: float, low: float, high: float) -> str:
    """Formats a mean and half of the interval that lies about it; nothing for one that there is not."""
    return f"{mean:.1f}±{(high - low) / 2:.1f}" if isfinite(mean) else ""


def records(table: Table) -> list[dict[str, str]]:
    """Returns the rows of a table, each by its heads, for JSON."""
    return [dict(zip(table.header, row, strict=True)) for row in table.rows]


def terminal_table(table: Table, title: str, *, n_words: int = 1, caption: str = "") -> TerminalTable:
    """Returns a table for the terminal, of columns of words, set flush left, and then columns of numbers."""
    shown = TerminalTable(title=title, caption=caption or None, box=SIMPLE_HEAD, pad_edge=False)
    for i, head in enumerate(table.header):
        # Heads of numbers stand one word a line: on a narrow terminal words fold before numbers do.
        name = head if i < n_words else head.replace(" ", "\n")
        shown.add_column(name, justify="left" if i < n_words else "right", overflow="fold")
    for row in table.rows:
        shown.add_row(*row)
    return shown


def write_fields(kind: type[Any], readings: Iterable[Any], path: Path) -> Path:
    """Writes readings, of a dataclass with slots, as CSV, a column for every field and a row each."""
    return write_csv(path, kind.__slots__, map(astuple, readings))

"""One way to lay readings out as a table: for the terminal, and for a report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from annelid.markdown import Table
from annelid.output import write_csv

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

T = TypeVar("T")


def tabulated(rows: Iterable[T], columns: Mapping[str, Callable[[T], str]]) -> Table:
    """Makes a table from what stands in each column of a row.

    Args:
        rows: What was read, one thing a row.
        columns: What each column writes of a row, by its head.
    """
    return Table(list(columns), [[cell(row) for cell in columns.values()] for row in rows])


def terminal_table(table: Table, title: str, *, n_words: int = 1, caption: str = "") -> TerminalTable:
    """Returns a table for the terminal.

    Args:
        table: Its head and cells.
        title: What stands above it.
        n_words: Columns of words, set flush left, before those of numbers.
        caption: What stands below it.
    """
    from rich.table import Table as TerminalTable

    shown = TerminalTable(title=title, caption=caption or None)
    for i, head in enumerate(table.header):
        # Heads of numbers stand one word a line: on a narrow terminal words fold before numbers do.
        name = head if i < n_words else head.replace(" ", "\n")
        shown.add_column(name, justify="left" if i < n_words else "right", overflow="fold")
    for row in table.rows:
        shown.add_row(*row)
    return shown


def write_fields(kind: type[Any], readings: Iterable[Any], path: Path) -> Path:
    """Writes readings as CSV, a column for every field and a row each.

    Args:
        kind: Their dataclass, with slots.
        readings: What was read.
        path: The file to write.

    Returns:
        The path.

    Raises:
        RunFileError: The file cannot be written.
    """
    return write_csv(path, kind.__slots__, map(astuple, readings))

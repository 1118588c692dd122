"""Tables as comma-separated values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from annelid.export.tables import Table
from annelid.output import write_csv

CHUNK_ROWS = 20_000


def write_table(table: Table, path: Path, wrote: Callable[[int], object] = lambda _: None) -> Path:
    """Writes a table with its units in the header; numbers with all the digits that they have.

    Args:
        table: The table.
        path: File to write.
        wrote: Called with the number of rows after every chunk of them.

    Raises:
        RunFileError: The file cannot be written.
    """
    return write_csv(path, [column.heading for column in table.columns], _rows(table, wrote))


def _rows(table: Table, wrote: Callable[[int], object]) -> Iterator[Sequence[object]]:
    for start in range(0, table.n_rows, CHUNK_ROWS):
        chunk = [column.values[start : start + CHUNK_ROWS].tolist() for column in table.columns]
        yield from zip(*chunk, strict=True)
        wrote(len(chunk[0]))

"""Tables as comma-separated values, and what the run is beside them as JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from annelid.export.tables import Table
from annelid.view.output import whole_file, write_csv

CHUNK_ROWS = 20_000
ABOUT = "about.json"


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


def write_about(facts: dict[str, Any], path: Path) -> Path:
    """Writes what a run is as JSON.

    Raises:
        RunFileError: The file cannot be written.
    """
    with whole_file(path) as draft:
        draft.write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    return path


def _rows(table: Table, wrote: Callable[[int], object]) -> Iterator[Sequence[object]]:
    for start in range(0, table.n_rows, CHUNK_ROWS):
        chunk = [column.values[start : start + CHUNK_ROWS].tolist() for column in table.columns]
        yield from zip(*chunk, strict=True)
        wrote(len(chunk[0]))

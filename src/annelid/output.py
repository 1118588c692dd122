"""Files that appear under their name only when they are whole."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from annelid.errors import RunFileError
from annelid.text import printable

__all__ = ["plain_cell", "whole_file", "with_suffix", "write_csv", "write_json", "write_text"]


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Gives a hidden draft beside a file, with the same suffix, which is moved into its place once the block is done.

    Until then what is there stays; the draft goes where the block ends in an error. An OSError becomes a RunFileError.
    """
    path = Path(path)
    target = path.resolve()
    # A device or a pipe must be written as it is: moving a file there would replace it.
    direct = target.exists() and not target.is_file()
    draft = target if direct else target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        yield draft
        if not direct:
            draft.replace(target)
    except OSError as error:
        raise RunFileError(f"cannot write {path}: {error.strerror or str(error).partition(chr(10))[0]}") from error
    finally:
        if not direct:
            with suppress(OSError):
                draft.unlink()


def write_text(path: Path, text: str) -> Path:
    """Writes a text as a `whole_file` in UTF-8 and returns its path."""
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8")
    return path


def write_json(path: Path, content: Any) -> Path:
    """Writes plain values as JSON, as `write_text` does; NaN is refused."""
    return write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def write_csv(path: Path, columns: Iterable[str], rows: Iterable[Iterable[object]]) -> Path:
    """Writes a table as CSV with a header, as a `whole_file`, and returns its path.

    None leaves a cell empty, and text that a spreadsheet would take for a formula gets a leading apostrophe.
    """
    with whole_file(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([plain_cell(column) for column in columns])
        writer.writerows([plain_cell(value) if isinstance(value, str) else value for value in row] for row in rows)
    return path


def plain_cell(text: str) -> str:
    """Returns text as a cell of a table, with a leading apostrophe where a spreadsheet would take it for a formula."""
    text = printable(text)
    if text[:1] not in tuple("=+-@\t"):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}" if len(text) > 1 else text
    return text


def with_suffix(path: str | Path, suffixes: tuple[str, ...], what: str, default: str | None = None) -> Path:
    """Returns the path of a file to write, of which the suffix must be one of those given in lower case.

    A name without a suffix gets the default one, or is refused. What is written is named in the sentence.
    """
    path = Path(path)
    if path.is_dir():
        raise RunFileError(f"{path} is a folder: name a file")
    if not path.suffix and default is not None:
        return path.with_name(path.name + default)
    if path.suffix.lower() not in suffixes:
        raise RunFileError(f"{path} cannot be written as {what}: its name must end in {', '.join(suffixes)}")
    return path

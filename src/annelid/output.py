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

__all__ = ["whole_file", "with_suffix", "write_csv", "write_json", "write_text"]


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Gives a hidden draft beside a file, to be written and then moved into its place.

    Args:
        path: The file to write; what is there stays until the draft is complete.

    Yields:
        The draft, which has the same suffix; it is removed where the block ends in an error.

    Raises:
        RunFileError: The file cannot be written, for example because the disk is full.
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
    """Writes a text as a `whole_file` in UTF-8.

    Args:
        path: The file to write.
        text: Its content.

    Returns:
        The path.

    Raises:
        RunFileError: The file cannot be written.
    """
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8")
    return path


def write_csv(path: Path, columns: Iterable[str], rows: Iterable[Iterable[object]]) -> Path:
    """Writes a table as CSV with a header.

    Args:
        path: The file to write.
        columns: Names of the columns.
        rows: Values of each row; None leaves a cell empty, and text that a spreadsheet would take for a formula gets
            a leading apostrophe.

    Returns:
        The path.

    Raises:
        RunFileError: The file cannot be written.
    """
    with whole_file(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([_cell(column) for column in columns])
        writer.writerows([_cell(value) if isinstance(value, str) else value for value in row] for row in rows)
    return path


def _cell(text: str) -> str:
    """Text as it is in a table; a leading apostrophe keeps spreadsheets from taking it for a formula."""
    text = printable(text)
    if text[:1] not in tuple("=+-@\t"):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}" if len(text) > 1 else text
    return text


def write_json(path: Path, content: Any) -> Path:
    """Writes plain values as JSON; NaN is refused.

    Args:
        path: The file to write.
        content: Plain lists, mappings, numbers, strings and None.

    Returns:
        The path.

    Raises:
        RunFileError: The file cannot be written.
    """
    with whole_file(path) as draft:
        draft.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return path


def with_suffix(path: str | Path, suffixes: tuple[str, ...], what: str, default: str | None = None) -> Path:
    """Checks a file's suffix.

    Args:
        path: The file to write.
        suffixes: The suffixes allowed, in lower case.
        what: What is written, for the sentence.
        default: Suffix to add where the name has none; None refuses such a name.

    Returns:
        The path, with a suffix.

    Raises:
        RunFileError: Another suffix, or the path is a folder.
    """
    path = Path(path)
    if path.is_dir():
        raise RunFileError(f"{path} is a folder: name a file")
    if not path.suffix and default is not None:
        return path.with_name(path.name + default)
    if path.suffix.lower() not in suffixes:
        raise RunFileError(f"{path} cannot be written as {what}: its name must end in {', '.join(suffixes)}")
    return path

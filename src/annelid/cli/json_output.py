"""The option ``--json`` of all commands: the result is one JSON document on stdout, everything else goes to stderr."""

from __future__ import annotations

import csv
import inspect
import json
import platform
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import redirect_stdout
from contextvars import ContextVar
from functools import wraps
from importlib.metadata import version
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer

_HELP = "Print only one JSON document with the result; docs/data_out.md lists its keys."
_Json = Annotated[bool, typer.Option("--json", help=_HELP)]
_OPTION = inspect.Parameter("as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=_Json)
_documents: ContextVar[list[Any] | None] = ContextVar("_documents", default=None)
"""What a command has given so far: one document or none yet; None without --json."""

# As Python writes numbers. A digest or a name such as 12e4 or 007 is none, so it stays text.
_NUMBER = re.compile(r"-?((0|[1-9]\d*)(\.\d+)?(e[+-]\d+)?|nan|inf)|")


def with_json(command: Callable[..., None]) -> Callable[..., None]:
    """Gives a command the option ``--json``; its document is printed however the command ends."""

    @wraps(command)
    def run(*words: Any, as_json: bool = False, **options: Any) -> None:
        if not as_json:
            return command(*words, **options)
        documents: list[Any] = []
        mark = _documents.set(documents)
        try:
            with redirect_stdout(sys.stderr):
                command(*words, **options)
            if not documents:
                give_files(())
        finally:
            _documents.reset(mark)
            for document in documents:
                typer.echo(json.dumps(_strict(document), indent=2, allow_nan=False))

    signature = inspect.signature(command, eval_str=True)
    run.__annotations__ = command.__annotations__ | {"as_json": _Json}
    run.__signature__ = signature.replace(parameters=[*signature.parameters.values(), _OPTION])  # type: ignore[attr-defined]
    return run


def wants_json() -> bool:
    """Whether the command that runs was given ``--json``."""
    return _documents.get() is not None


def refuse_json(given: bool, what: str) -> None:
    """Refuses ``--json`` beside options that print something else.

    Args:
        given: Whether the other option was given.
        what: Name of that option.

    Raises:
        BadParameter: Both were given.
    """
    if given and wants_json():
        raise typer.BadParameter(f"--json prints the result as JSON: it does not go with {what}")


def give(document: Any) -> bool:
    """Takes the document that ``--json`` prints, plain values and paths; returns whether it is wanted."""
    if (documents := _documents.get()) is None:
        return False
    documents[:] = [document]
    return True


def give_files(paths: Iterable[Path], results: Mapping[str, Any] | None = None) -> bool:
    """Adds the paths of files that were written, the versions, and results by name to the document, as `give` does.

    Args:
        paths: The files.
        results: Results by name.
    """
    if (documents := _documents.get()) is None:
        return False
    document = documents[0] if documents else {"files": [], "results": {}}
    document.setdefault("files", []).extend(paths)
    if results:
        document["results"].update(results)
    document["versions"] = {name: version(name) for name in ("annelid", "mujoco-core", "numpy")}
    document["versions"]["python"] = platform.python_version()
    return give(document)


def records(paths: Sequence[Path]) -> dict[str, Any]:
    """Returns what the JSON files and the tables among the results of a study hold, by name: one source for both.

    A table is a list of rows. One that has a JSON file of its name beside it is part of that file.
    """
    from annelid.textfiles import read_json

    tables = (path for path in paths if path.suffix == ".csv" and path.with_suffix(".json") not in paths)
    found = {path.name: read_json(path) for path in paths if path.suffix == ".json"}
    return found | {path.name: _rows(path) for path in tables}


def _rows(path: Path) -> list[dict[str, Any]]:
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    columns = map(_values, zip(*rows, strict=True))
    return [dict(zip(header, row, strict=True)) for row in zip(*columns, strict=True)]


def _values(cells: tuple[str, ...]) -> list[Any]:
    """Reads a column: truths or numbers where all cells are, else texts; an empty cell is None."""
    if all(cell in ("", "True", "False", "true", "false") for cell in cells):
        return [cell in ("True", "true") if cell else None for cell in cells]
    if all(map(_NUMBER.fullmatch, cells)):
        return [None if not cell else int(cell) if cell.lstrip("-").isdigit() else float(cell) for cell in cells]
    return [cell or None for cell in cells]


def _strict(value: Any) -> Any:
    """Returns a value as JSON has it: a number that is not finite as None, a path as its text."""
    if isinstance(value, Mapping):
        return {str(key): _strict(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_strict(item) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value

"""The reference of the command line, made from the commands' own help."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

WIDTH = 92


def page() -> str:
    """Returns the page below its introduction: the help of every command, as it prints it."""
    from typer.main import get_command

    from annelid.cli import app

    lines: list[str] = []
    for words, text in _helps(get_command(app), ("annelid",)):
        depth = 2 if len(words) < 3 else 3
        lines += ["", f"{'#' * depth} {' '.join(words)}", "", "```text", text.rstrip(), "```"]
    return "\n".join(lines) + "\n"


def _helps(command: Any, words: tuple[str, ...], parent: Any = None) -> Iterator[tuple[tuple[str, ...], str]]:
    """The words that call a command and its help, and likewise those of the commands below it."""
    # How wide a terminal is must not change the page.
    os.environ["COLUMNS"] = str(WIDTH)
    with command.make_context(words[-1], [], parent=parent, resilient_parsing=True) as context:
        yield words, command.get_help(context)
        for name, below in getattr(command, "commands", {}).items():
            yield from _helps(below, (*words, name), context)

"""Text of users and of files from elsewhere: what of it is shown as it is, and streams that show nothing else."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any, TextIO, cast
from unicodedata import category

__all__ = ["LINE", "is_line", "numbered", "printable", "write_printable_only"]

LINE = 80
"""Characters of a line of tables, sentences and comments that annelid writes."""

_KEPT = frozenset("\n\t\N{ZERO WIDTH JOINER}\N{ZERO WIDTH NON-JOINER}")
"""Lines, and what writing systems and emoji need inside words."""


def printable(text: str) -> str:
    r"""Returns a text whose control characters are written out, as ``\u001b`` for escape.

    These are what a terminal obeys instead of showing it, what turns the direction of writing, what no file of XML can
    have, and halves of characters; line feeds and tabs stay. The form is that of JSON and Python.
    """
    return text if text.isprintable() else "".join(map(_shown, text))


def _shown(character: str) -> str:
    # Blanks other than the plain one are not printable to Python, but are to a terminal.
    if character.isprintable() or character in _KEPT or category(character) == "Zs":
        return character
    number = ord(character)
    return f"\\u{number:04x}" if number < 0x10000 else f"\\U{number:08x}"


def numbered(names: Iterable[str]) -> list[str]:
    """Numbers names that occur again: a, a, b becomes a, a_2, b."""
    taken: dict[str, int] = {}
    result: list[str] = []
    for name in names:
        candidate, number = name, taken.get(name, 1)
        while candidate in taken:
            number += 1
            candidate = f"{name}_{number}"
        taken[name] = number
        taken[candidate] = 1
        result.append(candidate)
    return result


def is_line(text: str) -> bool:
    """Whether a text is one line without control characters."""
    return "\n" not in text and "\t" not in text and printable(text) == text


def write_printable_only() -> None:
    """Has all that this process writes to its two streams from now on, tracebacks too, show as text."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is not None and not isinstance(stream, _PrintableStream):
            setattr(sys, name, cast(TextIO, _PrintableStream(stream)))


class _PrintableStream:
    """A stream of text that writes control characters out; nothing gets past it, such as through ``buffer``."""

    def __init__(self, stream: TextIO) -> None:
        # Under this name rich looks for the stream that its own control characters are for.
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        return self.rich_proxied_file.write(printable(text))

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        if name == "buffer":
            raise AttributeError(name)
        return getattr(self.rich_proxied_file, name)

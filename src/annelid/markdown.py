"""Plain words as Markdown: escaped, so that every character shows as it was written."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import count

from annelid.text import printable

__all__ = ["Table", "anchors", "code", "emphasis", "plain_table", "strong", "table", "words"]

# What Markdown, and GitHub's kind of it, would take for markup inside a line; an underscore inside a word is safe.
_MARKUP = re.compile(r"[\\*\[\]<~$`]|&(?=#?\w+;)|(?<![^\W_])_|_(?![^\W_])")
_OPENING = re.compile(r"^(#{1,6}(?=\s|$)|[-+=>]|\d+(?=[.)](?:\s|$)))")
_CODE = re.compile(r"(`[^`]+`)")
_NUMBER = re.compile(r"[-+−±≈<>~]?\s*\d[\d.,]*(?:[eE][-+]?\d+)?\s*\S{0,3}")


@dataclass(frozen=True)
class Table:
    """A table of a report: words and numbers as they shall be printed."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]


def words(text: str) -> str:
    """Returns plain text as Markdown of one line; what stands between backticks stays code."""
    parts = _CODE.split(printable(" ".join(text.split())))
    escaped = "".join(part if i % 2 else _MARKUP.sub(r"\\\g<0>", part) for i, part in enumerate(parts))
    return _OPENING.sub(_escape_opening, escaped)


def strong(text: str) -> str:
    """Returns plain text in bold, or nothing for nothing."""
    return f"**{words(text)}**" if text.strip() else ""


def emphasis(text: str) -> str:
    """Returns plain text in italics, or nothing for nothing."""
    return f"*{words(text)}*" if text.strip() else ""


def code(text: str) -> str:
    """Returns text as code of one line, whatever backticks it has."""
    line = printable(" ".join(text.split()))
    longest = max((len(ticks) for ticks in re.findall("`+", line)), default=0)
    fence, pad = "`" * (longest + 1), " " if line.startswith("`") or line.endswith("`") else ""
    return f"{fence}{pad}{line}{pad}{fence}" if line else ""


def cell(markdown: str) -> str:
    """Returns Markdown of one line so that it stays in one cell of a table."""
    return markdown.replace("|", r"\|")


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a table whose cells are Markdown already; columns of numbers, but the first, are set flush right."""
    rows = [list(row) for row in rows]
    columns = list(zip(*rows, strict=True)) if rows else [() for _ in header]
    rules = ["---:" if i and column and all(map(_is_number, column)) else "---" for i, column in enumerate(columns)]
    lines = [[cell(word) for word in header], rules, *([cell(word) for word in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def plain_table(content: Table) -> str:
    """Returns a table whose cells are plain text."""
    return table([words(name) for name in content.header], [[words(word) for word in row] for row in content.rows])


def anchors(headings: Iterable[str]) -> list[str]:
    """Returns the anchors that GitHub gives to headings, plain text: a repeated one is numbered."""
    found: list[str] = []
    for heading in headings:
        slug = re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.strip().lower()))
        free = (name for n in count() if (name := f"{slug}-{n}" if n else slug) not in found)
        found.append(next(free))
    return found


def _escape_opening(opening: re.Match[str]) -> str:
    return f"{opening[0]}\\" if opening[0].isdigit() else f"\\{opening[0]}"


def _is_number(word: str) -> bool:
    return word.strip() in {"", "-", "–"} or _NUMBER.fullmatch(word.strip().replace("\\", "")) is not None

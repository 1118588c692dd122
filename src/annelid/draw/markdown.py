"""Plain words as Markdown, escaped so that every character shows as it was written; and Markdown as one HTML file."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources
from itertools import count, pairwise
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

from annelid.text import printable

if TYPE_CHECKING:
    from markdown_it.token import Token

# What Markdown, and GitHub's kind of it, would take for markup inside a line; an underscore inside a word is safe.
_MARKUP = re.compile(r"[\\*\[\]<~$`]|&(?=#?\w+;)|(?<![^\W_])_|_(?![^\W_])")
_OPENING = re.compile(r"^(#{1,6}(?=\s|$)|[-+=>]|\d+(?=[.)](?:\s|$)))")
_CODE = re.compile(r"(`[^`]+`)")
_NUMBER = re.compile(r"[-+−±≈<>~]?\s*\d[\d.,]*(?:[eE][-+]?\d+)?\s*\S{0,3}")
BADGES = {
    "holds within": "nearly",
    "holds": "holds",
    "rests on": "rests",
    "does not hold": "fails",
    "not testable here": "open",
}
"""The first words of a verdict, and the class of its badge; the first that fits counts."""
# A cell of so few characters, such as an order 1-2-3, stays on one line.
_SHORT = 12
_SKELETON = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header>
{head}</header>
<nav aria-label="Contents">
{contents}</nav>
<main>
{content}</main>
</body>
</html>
"""
# These read what markdown-it writes of text whose own angle brackets are escaped, so a tag is always a tag.
_PICTURE = re.compile(r"<p>(<img [^>]*>)</p>\s*<p>(.*?)</p>", re.DOTALL)
_NUMBERED = re.compile(r"<table>\s*<thead>\s*<tr>\s*<th[^>]*>#</th>.*?</table>\s*<ol.*?</ol>", re.DOTALL)
_ROW = re.compile(r"<tr>(.*?)</tr>", re.DOTALL)
_CELL = re.compile(r"<t[hd][^>]*>(.*?)</t[hd]>", re.DOTALL)
_ITEM = re.compile(r"<li>(.*?)</li>", re.DOTALL)


@dataclass(frozen=True)
class Table:
    """A table of a report: words and numbers as they shall be printed."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]


def words(text: str) -> str:
    """Returns plain text as Markdown of one line; what stands between backticks stays code."""
    parts = _CODE.split(printable(" ".join(text.split())))
    escaped = "".join(part if i % 2 else _MARKUP.sub(r"\\\g<0>", part) for i, part in enumerate(parts))
    return _OPENING.sub(lambda opening: f"{opening[0]}\\" if opening[0].isdigit() else f"\\{opening[0]}", escaped)


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
    return "\n".join(f"| {' | '.join(map(cell, line))} |" for line in (header, rules, *rows))


def plain_table(content: Table) -> str:
    """Returns a table whose cells are plain text."""
    return table([words(name) for name in content.header], [[words(word) for word in row] for row in content.rows])


def anchors(headings: Iterable[str]) -> list[str]:
    """Returns the anchors that GitHub gives to headings, plain text: a repeated one is numbered."""
    found: list[str] = []
    for heading in headings:
        slug = re.sub(r"\s", "-", re.sub(r"[^\w\s-]", "", heading.strip().lower()))
        found.append(next(name for n in count() if (name := f"{slug}-{n}" if n else slug) not in found))
    return found


def _is_number(word: str) -> bool:
    return word.strip() in {"", "-", "–"} or _NUMBER.fullmatch(word.strip().replace("\\", "")) is not None


def page(title: str, head: str, contents: str, content: str, folder: Path) -> str:
    """Returns an HTML page.

    Beyond plain Markdown, a picture and the paragraph after it become a figure with its caption, and the items of
    the list that follows a table of numbered rows (first column ``#``) move into the table, each below its row.

    Args:
        title: Its title, plain text.
        head: Markdown of what stands first.
        contents: Markdown of the list of contents, which links to the headings of the rest.
        content: Markdown of the rest.
        folder: Where the paths of pictures start; the pictures, PNG, are embedded.

    Raises:
        OSError: A picture cannot be read.
    """
    style = (resources.files("annelid") / "draw" / "page.css").read_text(encoding="utf-8")
    parts = {"head": head, "contents": contents, "content": content}
    html = {name: _html(markdown, folder) for name, markdown in parts.items()}
    return _SKELETON.format(title=escape(printable(title)), style=style, **html)


def _html(markdown: str, folder: Path) -> str:
    from markdown_it import MarkdownIt

    reader = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = reader.parse(markdown)
    blocks = list(pairwise(tokens))
    headings = [(opening, _text(inline)) for opening, inline in blocks if opening.type == "heading_open"]
    for (opening, _), anchor in zip(headings, anchors(text for _, text in headings), strict=True):
        opening.attrSet("id", anchor)
    for opening, inline in blocks:
        if opening.type == "td_open" and len(_text(inline)) <= _SHORT:
            opening.attrSet("class", "short")
        for child in inline.children or ():
            if child.type == "image":
                picture = (folder / unquote(str(child.attrGet("src")))).read_bytes()
                child.attrSet("src", f"data:image/png;base64,{base64.b64encode(picture).decode()}")
    html: str = reader.renderer.render(tokens, reader.options, {})
    html = _PICTURE.sub(r"<figure>\n\1\n<figcaption>\2</figcaption>\n</figure>", html)
    html = _NUMBERED.sub(_with_notes, html)
    return re.sub(r"<table.*?</table>", r'<div class="table">\g<0></div>', html, flags=re.DOTALL)


def _text(inline: Token) -> str:
    return "".join(child.content for child in inline.children or ())


def _with_notes(match: re.Match[str]) -> str:
    """Returns a table of numbered rows with the items of the list after it below its rows."""
    rows, _, notes = match[0].partition("</table>")
    header, *body = [_CELL.findall(row) for row in _ROW.findall(rows)]
    groups = []
    for cells, note in zip(body, _ITEM.findall(notes), strict=True):
        named = zip(header, cells, strict=True)
        row = "".join(f'<td data-name="{name}">{_badge(name, text)}</td>' for name, text in named)
        below = f'<td></td><td colspan="{len(header) - 1}">{note.strip()}</td>'
        groups.append(f'<tbody id="claim-{cells[0]}">\n<tr>{row}</tr>\n<tr class="note">{below}</tr>\n</tbody>')
    head = "".join(f"<th>{name}</th>" for name in header)
    return "\n".join(['<table class="claims">', f"<thead><tr>{head}</tr></thead>", *groups, "</table>"])


def _badge(column: str, text: str) -> str:
    if column != "Verdict":
        return text
    verdict = re.sub(r"</?strong>", "", text)
    kind = next((badge for start, badge in BADGES.items() if verdict.startswith(start)), "open")
    return f'<strong class="verdict {kind}">{verdict}</strong>'

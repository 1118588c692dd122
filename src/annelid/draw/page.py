"""Markdown as one HTML file that needs nothing else: pictures and style are inside."""

from __future__ import annotations

import base64
import re
from html import escape
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

from annelid.markdown import anchors
from annelid.text import printable

if TYPE_CHECKING:
    from markdown_it.token import Token

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
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
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
<details>
<summary>Contents</summary>
{contents}</details>
</nav>
<main>
{content}</main>
</body>
</html>
"""
# These read what markdown-it writes of text whose own angle brackets are escaped, so a tag is always a tag.
_PICTURE = re.compile(r"<p>(<img [^>]*>)</p>\s*<p>(.*?)</p>", re.DOTALL)
_SECTION = re.compile(r'<h3 id="([^"]*)">(.*?)</h3>(.*?)(?=<h[1-3] |\Z)', re.DOTALL)
_FOLDED = r'<details>\n<summary><h3>\2</h3></summary>\n<div class="folded" id="\1">\3</div>\n</details>\n'
_NUMBERED = re.compile(r"<table>\s*<thead>\s*<tr>\s*<th[^>]*>#</th>.*?</table>\s*<ol.*?</ol>", re.DOTALL)
_ROW = re.compile(r"<tr>(.*?)</tr>", re.DOTALL)
_CELL = re.compile(r"<t[hd][^>]*>(.*?)</t[hd]>", re.DOTALL)
_ITEM = re.compile(r"<li>(.*?)</li>", re.DOTALL)


def html_page(title: str, head: str, contents: str, content: str, folder: Path) -> str:
    """Returns an HTML page.

    Beyond plain Markdown, a picture and the paragraph after it become a figure with its caption, and the items of
    the list that follows a table of numbered rows (first column ``#``) move into the table, each below its row. What
    stands below a heading of the third level is folded until it is clicked, or a link leads to it.

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
    html = re.sub(r"<table.*?</table>", r'<div class="table" tabindex="0">\g<0></div>', html, flags=re.DOTALL)
    return _SECTION.sub(_FOLDED, html)


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

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


def html_page(title: str, head: str, contents: str, content: str, folder: Path) -> str:
    """Returns an HTML page.

    Beyond plain Markdown, a picture and the paragraph after it become a figure with its caption. What stands below a
    heading of the third level is folded until it is clicked, or a link leads to it.

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
    html = re.sub(r"<table.*?</table>", r'<div class="table" tabindex="0">\g<0></div>', html, flags=re.DOTALL)
    return _SECTION.sub(_FOLDED, html)


def _text(inline: Token) -> str:
    return "".join(child.content for child in inline.children or ())

"""Pages as a browser finds them, built or on a host of repositories: anchors, links and what they load."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from urllib.parse import unquote, urlsplit

from markdown_it import MarkdownIt

LINKS = ("href", "src", "poster")


@dataclass
class Page(HTMLParser):
    """One page as HTML.

    Attributes:
        anchors: All that a link may end in after ``#``.
        links: Where it leads to.
        loaded: What a browser fetches to show it; part of the links.
    """

    html: str
    anchors: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self.feed(self.html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors |= {value for name in ("id", "name") if (value := values.get(name))}
        targets = [target for name in LINKS if (target := values.get(name)) is not None]
        self.links += targets
        if tag != "a":
            self.loaded += targets


def repository_page(path: Path) -> Page:
    """Reads a page in Markdown, or a notebook, with the anchors that hosts of repositories give to headings."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = (cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "markdown")
        text = "\n\n".join("".join(cell["source"]) for cell in cells)
    markdown = MarkdownIt("commonmark").enable("table")
    tokens, known = markdown.parse(text), Counter[str]()
    for heading, title in pairwise(tokens):
        if heading.type == "heading_open":
            words = "".join(part.content for part in title.children or () if part.type in ("text", "code_inline"))
            anchor = re.sub(r"[^\w\- ]", "", words.lower()).replace(" ", "-")
            heading.attrSet("id", f"{anchor}-{known[anchor]}" if known[anchor] else anchor)
            known[anchor] += 1
    return Page(markdown.renderer.render(tokens, markdown.options, {}))


def broken_links(site: Path) -> Iterator[str]:
    """Names every link, picture and anchor of a site that leads nowhere within it."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    return leading_nowhere(pages, site, Path.is_file)


def leading_nowhere(pages: Mapping[Path, Page], root: Path, there: Callable[[Path], bool]) -> Iterator[str]:
    """Names every link, picture and anchor of pages that leads to nothing that is there."""
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            # The page of an error is shown at any address.
            base = root if parts.path.startswith("/") or path.name == "404.html" else path.parent
            target = (base / unquote(parts.path).lstrip("/")).resolve() if parts.path else path
            target = next((one for one in (target / "index.html", target) if there(one)), None)
            anchor = unquote(parts.fragment)
            if target is None or (anchor and target in pages and anchor not in pages[target].anchors):
                yield f"{path.relative_to(root)}: {link}"


def fetched_from_elsewhere(site: Path) -> Iterator[str]:
    """Names everything that a page would fetch from the network to be shown."""
    for path in sorted(site.rglob("*.html")):
        yield from (
            f"{path.name}: {link}" for link in Page(path.read_text(encoding="utf-8")).loaded if urlsplit(link).netloc
        )

"""A built site as a browser finds it: pages with their anchors, links and what they load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LINKS = {"a": "href", "img": "src", "link": "href", "script": "src", "source": "src", "video": "src", "iframe": "src"}
LOADED = set(LINKS) - {"a"}


@dataclass
class Page(HTMLParser):
    """One page.

    Attributes:
        anchors: All that a link may end in after ``#``.
        links: Where it leads to.
        loaded: What a browser fetches to show it; part of the links.
    """

    path: Path
    anchors: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self.feed(self.path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors |= {value for name in ("id", "name") if (value := values.get(name))}
        target = values.get(LINKS.get(tag, ""))
        if target is not None:
            self.links.append(target)
            if tag in LOADED:
                self.loaded.append(target)


def broken_links(site: Path) -> Iterator[str]:
    """Names every link, picture and anchor of a site that leads nowhere within it."""
    pages = {path: Page(path) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            # The page of an error is shown at any address.
            base = site if parts.path.startswith("/") or path.name == "404.html" else path.parent
            target = (base / unquote(parts.path).lstrip("/")).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            missing = not target.exists()
            if missing or (parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].anchors):
                yield f"{path.relative_to(site)}: {link}"


def fetched_from_elsewhere(site: Path) -> Iterator[str]:
    """Names everything that a page would fetch from the network to be shown."""
    for path in sorted(site.rglob("*.html")):
        yield from (f"{path.name}: {link}" for link in Page(path).loaded if urlsplit(link).netloc)

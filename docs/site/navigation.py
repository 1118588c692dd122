"""The order of the pages: patterns in it stand for pages that nothing else names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from typing import Any


def expanded(nav: list[Any], pages: Iterable[str]) -> list[Any]:
    """Puts pages in place of patterns, each the pages that no other entry names, in order of their names.

    Args:
        nav: Entries as the settings have them: pages, patterns, and sections of these.
        pages: All pages there are.
    """
    return _filled(nav, sorted(set(pages) - set(entries(nav))))


def entries(nav: list[Any]) -> Iterator[str]:
    """Walks all pages and patterns, whatever sections they are in."""
    for entry in nav:
        if isinstance(entry, dict):
            for section in entry.values():
                yield from entries(section) if isinstance(section, list) else (section,)
        else:
            yield entry


def _filled(nav: list[Any], left: list[str]) -> list[Any]:
    filled: list[Any] = []
    for entry in nav:
        if isinstance(entry, dict):
            filled.append(
                {name: _filled(below, left) if isinstance(below, list) else below for name, below in entry.items()}
            )
        elif "*" in entry:
            # A star stands for a name within a folder, as in a shell.
            filled += [page for page in left if page.count("/") == entry.count("/") and fnmatchcase(page, entry)]
        else:
            filled.append(entry)
    return filled

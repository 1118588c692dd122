"""Which publications a configuration rests on, and their BibTeX, from ``data/references.bib``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources

from annelid.config import RunConfig
from annelid.config.kinds import every_kind

__all__ = ["ALWAYS", "bibtex", "entries", "references_of"]

ALWAYS = {"annelid": "the simulator", "riddle2023": "the paper that it reproduces and builds on"}
"""Keys that every work with annelid cites, and what for."""


def references_of(config: RunConfig | None = None) -> dict[str, str]:
    """Returns what to cite for a configuration, or for annelid as such.

    Keys of `entries`, each with what it is cited for; annelid and the paper come first.
    """
    reasons = {key: [reason] for key, reason in ALWAYS.items()}
    if config is not None:
        for section in (config.body, config.arena, config.turning, config.controller):
            for key, reason in section.cited() if section is not None else ():
                reasons.setdefault(key, []).append(reason)
    return {key: ", ".join(of_key) for key, of_key in reasons.items()}


@cache
def entries() -> Mapping[str, str]:
    """Returns every entry of the file by its key, as BibTeX."""
    text = (resources.files("annelid") / "data" / "references.bib").read_text(encoding="utf-8")
    text += "".join(f"\n\n{kind.bibtex}" for kind in every_kind())
    blocks = (block.strip() for block in text.split("\n\n"))
    keyed = ((re.match(r"@\w+\{([^,\s]+),", block), block) for block in blocks)
    return {opening[1]: block for opening, block in keyed if opening is not None}


def bibtex(references: Mapping[str, str] | Iterable[str]) -> str:
    """Returns entries as BibTeX, by what `references_of` returned, or by keys alone.

    What each is cited for stands in a comment above it.
    """
    reasons = references if isinstance(references, Mapping) else dict.fromkeys(references, "")
    blocks = [(f"% {reason}\n" if reason else "") + entries()[key] for key, reason in reasons.items()]
    return "\n\n".join(blocks) + "\n"

"""Which publications a configuration rests on, and their BibTeX, from ``data/references.bib``."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

from annelid.config import Rods, RunConfig, ServoRings, WormBody
from annelid.config.kinds import every_kind

ALWAYS = {"annelid": "the simulator", "riddle2023": "the paper that it reproduces and builds on"}
"""Keys that every work with annelid cites, and what for."""

EQUAL_STIFFNESS_RADIUS_M = 0.00299
"""Radius of a solid strand that bends as the robot's tube: the authors' choice of 2025."""


@dataclass(frozen=True, slots=True)
class Use:
    """A publication that configurations of some kind rest on.

    Attributes:
        key: Its key in the file.
        reason: What it is cited for.
        holds: Tells whether a configuration uses it.
    """

    key: str
    reason: str
    holds: Callable[[RunConfig], bool]


def _rods(config: RunConfig) -> bool:
    return isinstance(config.body, WormBody) and isinstance(config.body.formulation, Rods)


def _six_segment_robot(config: RunConfig) -> bool:
    return isinstance(config.body, WormBody) and config.body.strands.radius_m == EQUAL_STIFFNESS_RADIUS_M


def _servos(config: RunConfig) -> bool:
    return isinstance(config.body, WormBody) and isinstance(config.body.rings, ServoRings)


USES = (
    Use("todorov2012", "the physics engine", lambda config: isinstance(config.body, WormBody)),
    Use("wang", "the robot that the 3D worm is a model of", lambda config: isinstance(config.body, WormBody)),
    Use("bergou2008", "the rods of the mesh", _rods),
    Use("riddle2025", "strands of the stiffness of the robot's tubes", _six_segment_robot),
    Use("riddle2025models", "its model files", _six_segment_robot),
    Use("riddle2025models", "the position servos", _servos),
)
"""What is cited when, in the order in which it is printed, before what the kinds cite themselves."""


def references_of(config: RunConfig | None = None) -> dict[str, str]:
    """Tells what to cite for a configuration, or for annelid as such.

    Args:
        config: The configuration; None for none.

    Returns:
        Keys of `entries`, each with what it is cited for; annelid and the paper come first.
    """
    reasons = {key: [reason] for key, reason in ALWAYS.items()}
    if config is not None:
        uses = [(use.key, use.reason) for use in USES if use.holds(config)]
        for section in (config.arena, config.turning, config.body, config.controller):
            uses.extend(section.cited() if section is not None else ())
        for key, reason in uses:
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
    """Returns entries as BibTeX, what each is cited for in a comment above it.

    Args:
        references: What `references_of` returned, or keys alone.
    """
    reasons = references if isinstance(references, Mapping) else dict.fromkeys(references, "")
    blocks = [(f"% {reason}\n" if reason else "") + entries()[key] for key, reason in reasons.items()]
    return "\n\n".join(blocks) + "\n"

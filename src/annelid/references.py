"""Which publications a configuration rests on, and their BibTeX, from ``data/references.bib``."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

from annelid.config import (
    AdaptiveSns,
    Boxerbaum2012Body,
    Daltorio2013Body,
    HeteroclinicChannel,
    PhaseChain,
    Pipe,
    PlanarBody,
    PressureSns,
    RobustSns,
    Rods,
    RunConfig,
    ServoRings,
    SnsController,
    TimedWave,
    TouchTurning,
    WormBody,
)

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


def _network(config: RunConfig) -> SnsController | None:
    """The paper's network in the controller, alone or with additions."""
    controller = config.controller
    if isinstance(controller, AdaptiveSns | PressureSns):
        return controller.network
    return controller if isinstance(controller, SnsController) else None


def _toolbox(config: RunConfig) -> bool:
    network = _network(config)
    return network is not None and "toolbox" in (network.scheme, network.gate_start)


def _rods(config: RunConfig) -> bool:
    return isinstance(config.body, WormBody) and isinstance(config.body.formulation, Rods)


def _six_segment_robot(config: RunConfig) -> bool:
    return isinstance(config.body, WormBody) and config.body.strands.radius_m == EQUAL_STIFFNESS_RADIUS_M


def _servos(config: RunConfig) -> bool:
    return isinstance(config.body, WormBody) and isinstance(config.body.rings, ServoRings)


def _controlled_by(*kinds: type) -> Callable[[RunConfig], bool]:
    return lambda config: isinstance(config.controller, kinds)


def _body_is(kind: type) -> Callable[[RunConfig], bool]:
    return lambda config: isinstance(config.body, kind)


USES = (
    Use("todorov2012", "the physics engine", _body_is(WormBody)),
    Use("wang", "the robot that the 3D worm is a model of", _body_is(WormBody)),
    Use("bergou2008", "the rods of the mesh", _rods),
    Use("riddle2025", "strands of the stiffness of the robot's tubes", _six_segment_robot),
    Use("riddle2025models", "its model files", _six_segment_robot),
    Use("riddle2025models", "the position servos", _servos),
    Use("riddle2025models", "pipes", lambda config: isinstance(config.arena, Pipe)),
    Use("riddle2025models", "turning away from contact", lambda config: isinstance(config.turning, TouchTurning)),
    Use("riddle2025models", "the timed wave", _controlled_by(TimedWave)),
    Use("riddle2022", "the planar worm", _body_is(PlanarBody)),
    Use("daltorio2013", "the planar worm", _body_is(Daltorio2013Body)),
    Use("boxerbaum2012", "the planar worm", _body_is(Boxerbaum2012Body)),
    Use("riddle2022", "the network", lambda config: _network(config) is not None),
    Use("riddle2022", "the neurons", _controlled_by(RobustSns)),
    Use(
        "szczecinski2017",
        "the rules by which synapses are designed",
        _controlled_by(SnsController, AdaptiveSns, PressureSns, RobustSns),
    ),
    Use("nourse2023", "how the gates start, or the order of their steps", _toolbox),
    Use("nourse", "the idea of half-centres that adapt their rate", _controlled_by(AdaptiveSns)),
    Use("daltorio2013", "the aim of feedback from contact", _controlled_by(PressureSns)),
    Use("daltorio2013", "a channel that waits for the body", _controlled_by(HeteroclinicChannel)),
    Use("horchler2015", "the stable heteroclinic channel", _controlled_by(HeteroclinicChannel)),
    Use("shaw2012", "limit cycles near a heteroclinic orbit", _controlled_by(HeteroclinicChannel)),
    Use("stone1990", "the dwell time under noise", _controlled_by(HeteroclinicChannel)),
    Use("ijspeert2007", "the phase oscillators under a drive", _controlled_by(PhaseChain)),
)
"""What is cited when, in the order in which it is printed."""


def references_of(config: RunConfig | None = None) -> dict[str, str]:
    """Tells what to cite for a configuration, or for annelid as such.

    Args:
        config: The configuration; None for none.

    Returns:
        Keys of `entries`, each with what it is cited for; annelid and the paper come first.
    """
    reasons = {key: [reason] for key, reason in ALWAYS.items()}
    for use in USES if config is not None else ():
        if use.holds(config):  # type: ignore[arg-type]
            reasons.setdefault(use.key, []).append(use.reason)
    return {key: ", ".join(of_key) for key, of_key in reasons.items()}


@cache
def entries() -> Mapping[str, str]:
    """Returns every entry of the file by its key, as BibTeX."""
    text = (resources.files("annelid") / "data" / "references.bib").read_text(encoding="utf-8")
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

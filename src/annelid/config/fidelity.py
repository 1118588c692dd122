"""Levels of fidelity: how finely the worm of rods is resolved in space and time, never which worm it is.

Errors over mesh and time step come from the study ``docs/results/resolution.toml`` and stand in
``docs/evidence/speed.md``. The paper's own worm, a chain of capsules, is no level but the preset ``riddle2023``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from annelid.errors import ConfigError, suggest

RESOLUTION = (
    "body.mesh.elements_per_side",
    "body.formulation.friction_impedance_ratio",
    "clock.physics_timestep_s",
    "record.signals_interval_s",
    "record.frames_interval_s",
)
"""Fields that every level sets, and the only ones."""

HOME = "riddle2023-rods"
"""The preset whose resolution the levels start from."""


@dataclass(frozen=True)
class Fidelity:
    """One level.

    Attributes:
        summary: What it is good for.
        changes: Fields of the resolution that differ from the preset `HOME`, by their dotted paths.
    """

    summary: str
    changes: Mapping[str, Any] = field(default_factory=dict)


LEVELS = {
    "accurate": Fidelity(
        "rods, three elements a rhombus side, 5 ms",
        {
            "body.mesh.elements_per_side": 3,
            "clock.physics_timestep_s": 0.005,
            "record.signals_interval_s": 0.005,
        },
    ),
    "fast": Fidelity("rods, two elements a rhombus side, 10 ms; as riddle2023-rods has it"),
    "preview": Fidelity(
        "rods, two elements a side, 40 ms: edges stretch by up to 2 %, and what rests on a slope creeps by 3 mm/s",
        {
            "body.formulation.friction_impedance_ratio": 1.0,
            "clock.physics_timestep_s": 0.04,
            "record.signals_interval_s": 0.04,
        },
    ),
}
"""The levels by name, from the slowest to the fastest."""


def find_level(name: str) -> Fidelity:
    """Returns the level of that name.

    Raises:
        ConfigError: There is none; the sentence suggests the nearest.
    """
    if name == "paper":
        raise ConfigError(
            "fidelity = 'paper': a level changes the resolution and never the worm; the paper's own worm is the preset "
            "riddle2023 (annelid run riddle2023)"
        )
    if name not in LEVELS:
        raise ConfigError(f"unknown fidelity {name!r}: {suggest(name, list(LEVELS))}")
    return LEVELS[name]

"""Levels of fidelity: how finely a 3D worm is resolved in space and time, from the paper's own way to a preview.

The errors and the speed of each level are measured by ``annelid bench`` and stated in ``docs/speed.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from annelid.errors import ConfigError, suggest

RESOLUTION = (
    "body.mesh.elements_per_side",
    "clock.physics_timestep_s",
    "record.signals_interval_s",
    "record.frames_interval_s",
)
"""Fields that every level sets."""

CALIBRATION = (
    "body.formulation",
    "body.mesh.elements_per_end",
    "body.rings.length_range_m",
    "sensor.tolerance_m",
)
"""Fields that belong to a formulation, which the paper's robot needs to walk; a level sets them where it changes it."""


@dataclass(frozen=True)
class Fidelity:
    """One level.

    Attributes:
        summary: What it is good for.
        preset: The preset whose formulation, calibration and resolution it takes.
        changes: Fields of the resolution that differ from that preset, by their dotted paths.
    """

    summary: str
    preset: str
    changes: Mapping[str, Any] = field(default_factory=dict)


LEVELS = {
    "paper": Fidelity("the paper's own chain of capsules with soft pins, 1 ms", "riddle2023"),
    "accurate": Fidelity(
        "rods, six elements a rhombus side, 5 ms",
        "riddle2023-rods",
        {
            "body.mesh.elements_per_side": 6,
            "clock.physics_timestep_s": 0.005,
            "record.signals_interval_s": 0.005,
        },
    ),
    "fast": Fidelity("rods, two elements a side, 20 ms; the default of riddle2023-rods", "riddle2023-rods"),
    "preview": Fidelity(
        "rods, two elements a side, 40 ms: edges stretch by up to 3 %",
        "riddle2023-rods",
        {"clock.physics_timestep_s": 0.04, "record.signals_interval_s": 0.04},
    ),
}
"""The levels by name, from the slowest to the fastest."""


def fidelity_changes(level: str, tree: Mapping[str, Any], preset: Mapping[str, Any]) -> dict[str, Any]:
    """Tells what a level changes in a configuration.

    Args:
        level: One of `LEVELS`.
        tree: The configuration as a tree of tables, not yet checked.
        preset: The tree of the preset that the level takes its values from.

    Returns:
        Values by dotted path: the resolution, and where the formulation changes its calibration too.

    Raises:
        ConfigError: The body is planar, or its pins are springs, whose resolution is their own.
    """
    kind = _value(tree, "body.kind")
    if kind != "worm":
        raise ConfigError(f"fidelity = {level!r} is for the 3D worm (body.kind = 'worm'), not for body.kind = {kind!r}")
    present, wanted = (_value(each, "body.formulation.kind") for each in (tree, preset))
    if present == wanted == "rods" and _value(tree, "body.formulation.pins") == "separate":
        raise ConfigError(
            f"fidelity = {level!r} is for rods that share their pins; with body.formulation.pins = 'separate' "
            "set body.mesh.elements_per_side and clock.physics_timestep_s, or take fidelity = 'paper'"
        )
    fields = RESOLUTION if present == wanted and level != "paper" else RESOLUTION + CALIBRATION
    return {path: _value(preset, path) for path in fields} | dict(LEVELS[level].changes)


def find_level(name: str) -> Fidelity:
    """Returns the level of that name.

    Raises:
        ConfigError: There is none; the sentence suggests the nearest.
    """
    if name not in LEVELS:
        raise ConfigError(f"unknown fidelity {name!r}: {suggest(name, list(LEVELS))}")
    return LEVELS[name]


def _value(tree: Mapping[str, Any], path: str) -> Any:
    value: Any = tree
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    return value

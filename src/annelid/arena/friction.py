"""Friction of the ground: what the engine's contacts between skin and ground have of it."""

from __future__ import annotations

from typing import Any

import mujoco

from annelid.config.run import ArenaKind
from annelid.morphology import Array, MeshGeometry


def contact_options(arena: ArenaKind, relative_friction: float = 1.0) -> dict[str, Any]:
    """Contact attributes that worm and floor share, so that neither dilutes the other's; skin may have other friction.

    Of two geoms the engine takes the greater friction, unless one has priority.
    """
    return {
        "friction": [relative_friction * arena.friction, 0.005, 0.0001],
        "priority": int(relative_friction != 1.0),
        "solref": [arena.contact_time_constant_s, 1.0],
        "solimp": [*arena.contact_impedance, 0.5, 2.0],
    }


def skin_options(arena: ArenaKind, geometry: MeshGeometry, relative: list[float], x_m: Array) -> list[dict[str, Any]]:
    """Contact attributes of skin at places along the body at rest, m, from the relative friction of every segment."""
    return [contact_options(arena, float(share)) for share in geometry.along(relative, x_m)]


def set_friction(model: mujoco.MjModel, friction: float) -> None:
    """Gives skin and ground of a compiled worm another coefficient of sliding friction, from the next step on.

    A worm with setae sets its own before every step, and one whose segments rub differently cannot be given one.
    """
    model.geom_friction[(model.geom_contype != 0) | (model.geom_conaffinity != 0), 0] = friction
    model.pair_friction[:, :2] = friction

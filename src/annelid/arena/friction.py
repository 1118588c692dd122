"""Friction of the ground: what the engine's contacts between skin and ground have of it."""

from __future__ import annotations

from typing import Any

import mujoco

from annelid.config.run import ArenaKind


def contact_options(arena: ArenaKind) -> dict[str, Any]:
    """Contact attributes that worm and floor share, so that neither dilutes the other's."""
    return {
        "friction": [arena.friction, 0.005, 0.0001],
        "solref": [arena.contact_time_constant_s, 1.0],
        "solimp": [*arena.contact_impedance, 0.5, 2.0],
    }


def set_friction(model: mujoco.MjModel, friction: float) -> None:
    """Gives skin and ground of a compiled worm another coefficient of sliding friction, from the next step on.

    A worm with setae sets its own before every step.
    """
    model.geom_friction[(model.geom_contype != 0) | (model.geom_conaffinity != 0), 0] = friction
    model.pair_friction[:, :2] = friction

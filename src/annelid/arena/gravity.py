"""Which way gravity pulls."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from annelid.config.arena import ArenaKind
from annelid.protocols import Array


def gravity_of(arena: ArenaKind) -> Array:
    """Returns the acceleration of gravity in the model's axes, m/s^2, ``(3,)``.

    On a slope the axes lie in the ground, and gravity leans towards the rear of a worm that climbs.
    """
    slope = arena.slope_rad
    # Level ground has no negative zeros to write into a model file.
    return arena.gravity_m_per_s2 * np.array([sin(slope), 0.0, -cos(slope)])

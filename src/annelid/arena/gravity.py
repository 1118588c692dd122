"""Which way gravity pulls."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np

from annelid.config import Arena, Floor
from annelid.protocols import Array


def gravity_of(arena: Arena) -> Array:
    """Returns the acceleration of gravity in the model's axes, m/s^2, ``(3,)``.

    On a slope the axes lie in the ground, and gravity leans towards the rear of a worm that climbs.
    """
    slope = radians(arena.slope_deg) if isinstance(arena, Floor) else 0.0
    # Level ground has no negative zeros to write into a model file.
    return arena.gravity_m_per_s2 * np.array([sin(slope), 0.0, -cos(slope)])

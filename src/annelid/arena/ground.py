"""What an arena offers to the skin of a worm: its surface with all that stands on it, and the direction of gravity."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from annelid.arena.surface import FreeSpace, Plane, RoundPost, Surface
from annelid.config.run import ArenaKind
from annelid.protocols import Array


def surface_of(arena: ArenaKind) -> Surface:
    """Returns the surface of an arena with its rails and posts, in the worm's model (its lowest line at z = 0)."""
    gap_m, posts = arena.walls
    side = np.array([0.0, 1.0, 0.0])
    rails = () if gap_m is None else (Plane(side, -gap_m / 2), Plane(-side, -gap_m / 2))
    walls = (*rails, *(RoundPost(np.array([x, y]), radius) for x, y, radius in posts))
    return FreeSpace((arena.ground(), *walls)) if walls else arena.ground()


def gravity_of(arena: ArenaKind) -> Array:
    """Returns the acceleration of gravity in the model's axes, m/s^2, ``(3,)``.

    On a slope the axes lie in the ground, and gravity leans towards the rear of a worm that climbs.
    """
    slope = arena.slope_rad
    # Level ground has no negative zeros to write into a model file.
    return arena.gravity_m_per_s2 * np.array([sin(slope), 0.0, -cos(slope)])

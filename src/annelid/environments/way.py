"""The way that an environment's worm is to go: straight ahead on open ground, or along a pipe's centre line."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from annelid.arena.course import AHEAD, LEFT, UP, Course
from annelid.config import ArenaKind
from annelid.morphology import heading_turn
from annelid.protocols import Array

STRAIGHT = np.stack([AHEAD, LEFT, UP])


class Place(NamedTuple):
    """Where a worm is on its way.

    Attributes:
        along_m: How far its middle has come, m, from a point of the arena.
        axes: Unit vectors forwards, to the left and upwards there, as rows, ``(3, 3)``.
    """

    along_m: float
    axes: Array


class Way:
    """Tells how far along a worm is: straight ahead, or on a pipe's centre line from where its front starts."""

    def __init__(self, course: Course | None, heading_deg: float) -> None:
        self._course = course
        self._axes = STRAIGHT @ heading_turn(heading_deg).T

    def place(self, ring_centre_m: Array) -> Place:
        """Finds a worm's place from the centres of its rings, m, ``(n_segments, 3)``."""
        middle = ring_centre_m.mean(axis=0)
        if self._course is None:
            return Place(float(middle @ self._axes[0]), self._axes)
        along = float(self._course.nearest(ring_centre_m).arc_m.mean())
        tangent = self._course.nearest(middle[np.newaxis]).tangent[0]
        left = np.cross(UP, tangent)
        left /= np.sqrt(left @ left)
        return Place(along, np.stack([tangent, left, np.cross(tangent, left)]))


def way_of(arena: ArenaKind, heading_deg: float = 0.0) -> Way:
    """Returns the way through an arena of a worm that starts with a heading."""
    return Way(arena.centre_line(), heading_deg)

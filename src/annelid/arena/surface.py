"""The surface that an arena offers to the skin, as numbers: how far points are from it, and which way it faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from annelid.config import Arena
from annelid.protocols import Array


class Surface(Protocol):
    """The boundary between free space and what a worm touches."""

    def distance_m(self, points_m: Array) -> Array:
        """Returns signed distances of points from the surface, m: positive in free space, negative inside the ground.

        Args:
            points_m: Points, m, ``(..., 3)``.

        Returns:
            Shape ``(...)``.
        """
        ...

    def normal(self, points_m: Array) -> Array:
        """Returns the surface's unit normals nearest to points, which face free space.

        Args:
            points_m: Points, m, ``(..., 3)``.

        Returns:
            Shape ``(..., 3)``.
        """
        ...


@dataclass(frozen=True)
class Plane:
    """A level floor.

    Attributes:
        height_m: Its height z, m.
    """

    height_m: float

    def distance_m(self, points_m: Array) -> Array:
        """Heights of points above the floor, m."""
        return points_m[..., 2] - self.height_m

    def normal(self, points_m: Array) -> Array:
        """Upwards everywhere."""
        return np.broadcast_to([0.0, 0.0, 1.0], points_m.shape)


def surface_of(arena: Arena) -> Surface:
    """Returns the surface of a configured arena, in the coordinates of the worm's model (lowest line at z = 0)."""
    return Plane(-arena.floor_gap_m)

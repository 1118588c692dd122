"""The surface that an arena offers to the skin, as numbers: how far points are from it, and where it faces.

Also the triangles by which a surface without end is drawn.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.protocols import Array

SETTLED = 1e-10
"""A nearest point is found when distance, m, and normal change by no more: after two to five rounds near a surface."""
MOST_ROUNDS = 60


class Surface(ABC):
    """The boundary between free space and what a worm touches."""

    @abstractmethod
    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Finds distance and normal at once.

        Args:
            points_m: Points, m, ``(..., 3)``.
            first_order: A distance d may be wrong by d^2 / 2 of the surface's curvature along the arena: for a strand's
                radius 0.05 mm where a taper begins, and a few micrometres elsewhere.

        Returns:
            Signed distances from the surface, m, ``(...)``: positive in free space, negative inside the ground. And the
            surface's unit normals at the nearest points, ``(..., 3)``, which face free space.
        """

    def distance_m(self, points_m: Array) -> Array:
        """Finds signed distances of points from the surface.

        Args:
            points_m: Points, m, ``(..., 3)``.

        Returns:
            Distances, m, ``(...)``: positive in free space, negative inside the ground.
        """
        return self.nearest(points_m)[0]

    def normal(self, points_m: Array) -> Array:
        """Finds the surface's unit normals nearest to points.

        Args:
            points_m: Points, m, ``(..., 3)``.

        Returns:
            Unit vectors, ``(..., 3)``, which face free space.
        """
        return self.nearest(points_m)[1]


@dataclass(frozen=True)
class Plane(Surface):
    """An even surface, with its unit normal, ``(3,)``, and its distance from the origin along that, m."""

    facing: Array
    offset_m: float

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns heights above it and its normal, as `Surface.nearest`."""
        return points_m @ self.facing - self.offset_m, np.broadcast_to(self.facing, points_m.shape)


@dataclass(frozen=True)
class RoundPost(Surface):
    """An upright post without an upper end."""

    axis_m: Array  # x and y, (2,)
    radius_m: float

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns distances from it and directions away from its axis, as `Surface.nearest`."""
        away = points_m[..., :2] - self.axis_m
        distance = lengths(away)
        outwards = away / np.maximum(distance, 1e-12)[..., np.newaxis]
        return distance - self.radius_m, np.concatenate([outwards, np.zeros((*distance.shape, 1))], axis=-1)


@dataclass(frozen=True)
class FreeSpace(Surface):
    """The boundary of the space between several surfaces, as a floor, two rails and posts."""

    parts: tuple[Surface, ...]

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns distance and normal of the nearest part, as `Surface.nearest`."""
        found = [part.nearest(points_m, first_order=first_order) for part in self.parts]
        distance, normal = (np.stack(both) for both in zip(*found, strict=True))
        which = distance.argmin(axis=0)[np.newaxis]
        return np.take_along_axis(distance, which, 0)[0], np.take_along_axis(normal, which[..., np.newaxis], 0)[0]


class Level(NamedTuple):
    """A function that is positive in free space and zero on a surface.

    Attributes:
        value: Shape ``(n,)``.
        gradient: Shape ``(n, 3)``.
        is_distance: Where it is the distance itself, ``(n,)``.
    """

    value: Array
    gradient: Array
    is_distance: NDArray[np.bool_]


class Implicit(Surface):
    """A surface known by a function that is positive in free space and zero on it."""

    @abstractmethod
    def level(self, points_m: Array) -> Level:
        """Evaluates the function.

        Args:
            points_m: Points, m, ``(n, 3)``.

        Returns:
            Its values, gradients, and where it is the distance itself.
        """

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Follows the normal from the point to the surface and takes the normal found there, until both agree."""
        points = points_m.reshape(-1, 3)
        value, gradient, done = self.level(points)
        size = lengths(gradient)
        distance, normal = value / size, gradient / size[:, np.newaxis]
        open_ = np.flatnonzero(~done & (not first_order))
        for _ in range(MOST_ROUNDS):
            if not len(open_):
                break
            along = normal[open_]
            value, gradient, _ = self.level(points[open_] - distance[open_, np.newaxis] * along)
            change = value / (gradient * along).sum(axis=-1)
            turned = gradient / lengths(gradient)[:, np.newaxis]
            moved = (np.abs(change) > SETTLED) | (np.abs(turned - along).max(axis=-1) > SETTLED)
            distance[open_] += change
            normal[open_] = turned
            open_ = open_[moved]
        return distance.reshape(points_m.shape[:-1]), normal.reshape(points_m.shape)


def lengths(vectors: Array) -> Array:
    """Returns the lengths of vectors, ``(..., 3)``; several times as fast as `numpy.linalg.norm`."""
    return np.sqrt((vectors * vectors).sum(axis=-1))


class Shape(NamedTuple):
    """Triangles that face the viewer: corners, m, ``(n_vertices, 3)``, and per face three of them anticlockwise."""

    vertices_m: Array
    faces: NDArray[np.int32]


def grid_faces(n_along: int, n_across: int, *, closed: bool = False) -> NDArray[np.int32]:
    """Corners of the triangles between rows of vertices, ``(n_faces, 3)``; closed rows are rings."""
    n_cells = n_across if closed else n_across - 1
    row, column = np.meshgrid(np.arange(n_along - 1), np.arange(n_cells), indexing="ij")
    a, b = row * n_across + column, row * n_across + (column + 1) % n_across
    c, d = a + n_across, b + n_across
    return np.stack([a, c, b, b, c, d], axis=-1).reshape(-1, 3).astype(np.int32)

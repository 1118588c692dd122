"""The surface that an arena offers to the skin, as numbers: how far points are from it, and which way it faces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from annelid.config.arena import ArenaKind, Walls
from annelid.protocols import Array

SETTLED = 1e-10
"""A nearest point is found when distance, m, and normal change by no more: after two to five rounds near a surface."""
MOST_ROUNDS = 60


class Surface(Protocol):
    """The boundary between free space and what a worm touches."""

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns signed distances and normals, as `distance_m` and `normal` do, for the price of one of them.

        Args:
            points_m: Points, m, ``(..., 3)``.
            first_order: A distance d may be wrong by d^2 / 2 of the surface's curvature along the arena: for a strand's
                radius 0.05 mm where a taper begins, and a few micrometres elsewhere.
        """
        ...

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


class Nearest(ABC):
    """A surface that finds distance and normal at once."""

    @abstractmethod
    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns signed distances, m, ``(...)``, and unit normals, ``(..., 3)``."""

    def distance_m(self, points_m: Array) -> Array:
        """Signed distances of points, m, ``(..., 3)``, from the surface, m, ``(...)``: positive in free space."""
        return self.nearest(points_m)[0]

    def normal(self, points_m: Array) -> Array:
        """Unit normals nearest to points, m, ``(..., 3)``; they face free space."""
        return self.nearest(points_m)[1]


@dataclass(frozen=True)
class Plane(Nearest):
    """An even surface.

    Attributes:
        facing: Its unit normal, ``(3,)``.
        offset_m: Its distance from the origin along the normal, m.
    """

    facing: Array
    offset_m: float

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns heights above it, m, and its normal."""
        return points_m @ self.facing - self.offset_m, np.broadcast_to(self.facing, points_m.shape)


@dataclass(frozen=True)
class Round(Nearest):
    """An upright post without an upper end.

    Attributes:
        axis_m: x and y of its axis, m, ``(2,)``.
        radius_m: Its radius, m.
    """

    axis_m: Array
    radius_m: float

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns distances from it, m, and directions away from its axis."""
        away = points_m[..., :2] - self.axis_m
        distance = lengths(away)
        outwards = away / np.maximum(distance, 1e-12)[..., np.newaxis]
        return distance - self.radius_m, np.concatenate([outwards, np.zeros((*distance.shape, 1))], axis=-1)


@dataclass(frozen=True)
class Between(Nearest):
    """Free space within several surfaces, as a floor, two rails and posts.

    Attributes:
        parts: The surfaces.
    """

    parts: tuple[Surface, ...]

    def nearest(self, points_m: Array, *, first_order: bool = False) -> tuple[Array, Array]:
        """Returns distance and normal of the nearest part."""
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


class Implicit(Nearest):
    """A surface known by a function that is positive in free space and zero on it."""

    @abstractmethod
    def level(self, points_m: Array) -> Level:
        """Returns the function at points, m, ``(n, 3)``."""

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
    """Returns the lengths of vectors, ``(..., 3)``."""
    return np.sqrt((vectors * vectors).sum(axis=-1))


def walls_of(walls: Walls) -> tuple[Surface, ...]:
    """Returns the surfaces of what stands upright: the left and the right guard rail, and the posts."""
    posts = tuple(Round(np.array([x, y]), radius) for x, y, radius in walls.posts)
    if walls.rail_gap_m is None:
        return posts
    side = np.array([0.0, 1.0, 0.0])
    return Plane(side, -walls.rail_gap_m / 2), Plane(-side, -walls.rail_gap_m / 2), *posts


def surface_of(arena: ArenaKind) -> Surface:
    """Returns the surface of a configured arena, in the coordinates of the worm's model (lowest line at z = 0)."""
    ground, walls = arena.ground(), walls_of(arena.walls)
    return Between((ground, *walls)) if walls else ground

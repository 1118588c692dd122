"""The centre line of a pipe, made of straights and curves, and the bore along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.protocols import Array

AHEAD, LEFT, UP = (np.array(axis, dtype=float) for axis in ((-1, 0, 0), (0, -1, 0), (0, 0, 1)))
"""Directions of the worm at the start: it leads towards -x, its left is -y."""
HELIX_STEPS = 8
"""Newton steps to the nearest point of a helix; quadratic, so that four would do near the pipe."""


class Foot(NamedTuple):
    """Points of a centre line, for example those nearest to given points."""

    arc_m: Array  # arc length from the worm's front, (...)
    point_m: Array  # (..., 3)
    tangent: Array  # unit vector, (..., 3)
    curvature_per_m: Array  # vector to the centre of the curve, (..., 3)


@dataclass(frozen=True)
class Straight:
    """A straight between two arc lengths, either of which may be infinite."""

    start_m: Array  # its point at arc length first_m, or at 0 where that is infinite, (3,)
    direction: Array  # unit vector, (3,)
    first_m: float
    last_m: float

    def nearest(self, points_m: Array) -> Foot:
        """Finds its nearest points to points, m, ``(..., 3)``."""
        along = (points_m - self.start_m) @ self.direction + self._origin_m
        return self.at(np.clip(along, self.first_m, self.last_m))

    def at(self, arc_m: Array) -> Foot:
        """Finds its points at arc lengths, m, ``(...)``."""
        point = self.start_m + (arc_m - self._origin_m)[..., np.newaxis] * self.direction
        return Foot(arc_m, point, np.broadcast_to(self.direction, point.shape), np.zeros(point.shape))

    @property
    def _origin_m(self) -> float:
        return self.first_m if self.first_m > -inf else 0.0


@dataclass(frozen=True)
class Curve:
    """A circular arc or a helix about an axis."""

    centre_m: Array  # the axis' point at the height of the curve's start, (3,)
    outwards: Array  # unit vector from there to the start, (3,)
    onwards: Array  # unit vector across it, in which the curve goes about the axis, (3,)
    axis: Array  # unit vector, (3,)
    radius_m: float
    rise_m_per_rad: float  # along the axis; 0 for an arc
    angle_rad: float  # the whole
    first_m: float  # arc length at its start

    @property
    def length_m_per_rad(self) -> float:
        """Arc length per angle, m/rad."""
        return float(np.hypot(self.radius_m, self.rise_m_per_rad))

    @property
    def last_m(self) -> float:
        """Arc length at its end, m."""
        return self.first_m + self.angle_rad * self.length_m_per_rad

    def nearest(self, points_m: Array) -> Foot:
        """Finds its nearest points to points, m, ``(..., 3)``."""
        away = points_m - self.centre_m
        x, y, height = (away @ axis for axis in (self.outwards, self.onwards, self.axis))
        angle, rise = np.arctan2(y, x), self.rise_m_per_rad
        turn = 2.0 * pi
        # Of all turns, the one nearest in height, or for an arc the one about its middle.
        wanted = height / rise if rise else self.angle_rad / 2
        angle = angle + turn * np.round((wanted - angle) / turn)
        if rise:
            reach = self.radius_m * np.hypot(x, y)
            azimuth = angle
            for _ in range(HELIX_STEPS):
                slope = reach * np.sin(angle - azimuth) - rise * (height - rise * angle)
                bend = np.maximum(reach * np.cos(angle - azimuth) + rise**2, rise**2)
                angle = angle - slope / bend
        return self._at_angle(np.clip(angle, 0.0, self.angle_rad))

    def at(self, arc_m: Array) -> Foot:
        """Finds its points at arc lengths, m, ``(...)``, which go on beyond its ends."""
        return self._at_angle((arc_m - self.first_m) / self.length_m_per_rad)

    def _at_angle(self, angle: Array) -> Foot:
        c, s = np.cos(angle)[..., np.newaxis], np.sin(angle)[..., np.newaxis]
        radial, along = c * self.outwards + s * self.onwards, c * self.onwards - s * self.outwards
        per_rad, rise = self.length_m_per_rad, self.rise_m_per_rad
        return Foot(
            self.first_m + angle * per_rad,
            self.centre_m + self.radius_m * radial + (rise * angle)[..., np.newaxis] * self.axis,
            (self.radius_m * along + rise * self.axis) / per_rad,
            -self.radius_m / per_rad**2 * radial,
        )


@dataclass(frozen=True)
class Course:
    """A smooth centre line of pieces in order; it starts and ends in straights that go on for ever."""

    pieces: tuple[Straight | Curve, ...]

    @property
    def joints_m(self) -> tuple[float, ...]:
        """Arc lengths at which one piece ends and the next begins, m."""
        return tuple(piece.last_m for piece in self.pieces[:-1])

    def nearest(self, points_m: Array) -> Foot:
        """Finds the line's nearest points to points, m, ``(..., 3)``."""
        feet = [piece.nearest(points_m) for piece in self.pieces]
        if len(feet) == 1:
            return feet[0]
        squares = np.stack([((points_m - foot.point_m) ** 2).sum(axis=-1) for foot in feet])
        return _chosen(feet, squares.argmin(axis=0))

    def at(self, arc_m: Array) -> Foot:
        """Finds the line's points at arc lengths from the worm's front, m, ``(...)``."""
        return _chosen([piece.at(arc_m) for piece in self.pieces], np.searchsorted(self.joints_m, arc_m))


def _chosen(feet: Sequence[Foot], piece: NDArray[np.intp]) -> Foot:
    """Takes each point from the piece that its number names."""
    chosen = [np.array(field) for field in feet[0]]
    for number, foot in enumerate(feet[1:], start=1):
        mine = piece == number
        for all_of_them, own in zip(chosen, foot, strict=True):
            all_of_them[mine] = own[mine]
    return Foot(*chosen)


@dataclass(frozen=True)
class Bore:
    """The radius of a pipe along its centre line: parabolas that join smoothly, constant beyond the ends."""

    arc_m: Array  # arc lengths between which the slope changes evenly, (n_knots,)
    slope: Array  # of the radius there, (n_knots,); 0 at both ends
    radius_m: Array  # there, (n_knots,)

    def at(self, arc_m: Array) -> tuple[Array, Array]:
        """Returns radius, m, and slope at arc lengths from the worm's front, m."""
        inside = np.clip(arc_m, self.arc_m[0], self.arc_m[-1])
        knot = np.clip(np.searchsorted(self.arc_m, inside) - 1, 0, len(self.arc_m) - 2)
        slope = np.interp(inside, self.arc_m, self.slope)
        return self.radius_m[knot] + (inside - self.arc_m[knot]) * (self.slope[knot] + slope) / 2, slope

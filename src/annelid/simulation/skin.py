"""What the skin senses of the ground, and how it slides: touch on four sides of every segment, slip and its loss.

The skin is the geoms that can touch: one sphere per vertex for rods, one capsule per element for chains. A geom belongs
to the segment and the side that it is nearest to at rest, and slides by what its centre is displaced between two
movements of the body. For rods that is the displacement of the point that touches; a chain's capsules also turn a
little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from annelid.arena.surface import Surface
from annelid.morphology import Array
from annelid.protocols import SIDES, State


@dataclass(frozen=True, slots=True)
class Touch:
    """What every segment senses of the ground, and how far it has slid; ``(n_segments,)`` unless said otherwise."""

    normal: Array  # normal force on each side during the last physics step, N, (n_segments, 4) in the order of SIDES
    count: Array  # number of geoms that touched then
    slip_speed: Array
    """Mean velocity of these along the body towards its front and along the ground, weighted by their normal forces,
    over the last movement, m/s; 0 in the air."""
    slip_distance: Array
    """Path that the segment has slid so far, m: the sum of the mean lengths of its geoms' displacements along the
    ground, in any direction, weighted as above."""
    slip_loss: Array  # work lost to friction so far, J

    @classmethod
    def none(cls, n_segments: int) -> Touch:
        """Returns that of a worm that has touched nothing yet."""
        return cls(np.zeros((n_segments, len(SIDES))), *np.zeros((4, n_segments)))

    def state(self) -> State:
        """Returns copies of all numbers, for a checkpoint."""
        return {f"touch_{name}": getattr(self, name).copy() for name in self.__slots__}

    @classmethod
    def of_state(cls, state: State) -> Touch:
        """Returns the touch whose `state` is among these arrays."""
        return cls(*(np.array(state[f"touch_{name}"], dtype=float) for name in cls.__slots__))


class Skin:
    """The geoms of one worm that can touch, each with its segment and its side, ``(n_geoms,)``, and what they touch."""

    def __init__(
        self, rest_m: Array, segment: NDArray[np.int64], n_segments: int, radius_m: float, surface: Surface
    ) -> None:
        """Sorts the geoms by their centres at rest, m, ``(n_geoms, 3)``; the tube's lowest line is the x axis."""
        self.segment = segment
        self.side = sides_of(rest_m[:, 1], rest_m[:, 2] - radius_m)
        self._n_segments = n_segments
        self._surface = surface
        self._member = np.eye(n_segments)[segment]
        self._quarter = len(SIDES) * segment + self.side

    def touch(
        self,
        so_far: Touch,
        ground_N: Array,
        before_m: Array,
        after_m: Array,
        axis: Array,
        time_s: float,
        normals: Array | None = None,
    ) -> Touch:
        """Adds a movement of the body, which took a time, to what was sensed so far.

        Given are the force of the ground on each geom during the last physics step, N, ``(n_geoms, 3)``, their centres
        before and after the movement, m, and unit vectors along the body towards its front at each segment,
        ``(n_segments, 3)``. In a scene also the normals of what each geom touched, ``(n_geoms, 3)``; else they are the
        surface's.
        """
        # A few belly vertices touch, of hundreds.
        touching = np.flatnonzero(_dot(ground_N, ground_N))
        force, segment = ground_N.take(touching, axis=0), self.segment.take(touching)
        before = before_m.take(touching, axis=0)
        normal = self._surface.normal(before) if normals is None else normals.take(touching, axis=0)
        moved = after_m.take(touching, axis=0) - before
        pressure = _dot(force, normal)
        along = moved - _dot(moved, normal)[:, np.newaxis] * normal
        of_each = np.empty((5, len(touching)))
        of_each[0] = pressure
        of_each[1] = pressure * _dot(along, axis.take(segment, axis=0))
        of_each[2] = pressure * np.sqrt(_dot(along, along))
        of_each[3] = _dot(force, along)
        of_each[4] = 1.0
        weight, forwards, path, work, count = of_each @ self._member.take(touching, axis=0)
        carried = np.where(weight > 0.0, weight, 1.0)
        quarter = np.bincount(self._quarter.take(touching), pressure, self._n_segments * len(SIDES))
        return Touch(
            normal=quarter.reshape(-1, len(SIDES)).astype(float, copy=False),
            count=count,
            slip_speed=forwards / (carried * time_s),
            slip_distance=so_far.slip_distance + path / carried,
            slip_loss=so_far.slip_loss - work,
        )


def _dot(first: Array, second: Array) -> Array:
    """Scalar products of vectors along the last axis, ``(n,)``."""
    return np.einsum("ij,ij->i", first, second)


def sides_of(left_right_m: Array, up_m: Array) -> NDArray[np.int64]:
    """Returns the side that points of a cross-section lie on, as indices of `SIDES`: the quarter that they are in.

    Points are so far right of the axis (left is negative) and above it, m. One between two quarters counts to belly or
    back, the same on the left and the right.
    """
    turn = np.arctan2(-left_right_m, -up_m) / (2.0 * np.pi / len(SIDES))
    # Half-way numbers are rounded to even ones, which are belly and back.
    return np.rint(np.round(turn, 9)).astype(np.int64) % len(SIDES)

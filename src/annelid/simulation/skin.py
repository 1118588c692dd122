"""What the skin feels of the ground, and how it slides: touch on four sides of every segment, slip and its loss.

The skin is the geoms that can touch: one sphere a vertex for rods, one capsule an element for chains. A geom belongs to
the segment and the side that it is nearest to at rest, and slides by what its centre is displaced between two movements
of the body. For rods that is the displacement of the point that touches; a chain's capsules also turn a little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from annelid.arena.surface import Surface
from annelid.morphology import Array
from annelid.protocols import SIDES, State

_QUARTER_RAD = 2.0 * np.pi / len(SIDES)


@dataclass(frozen=True, slots=True)
class Touch:
    """What every segment feels of the ground, and how far it has slid.

    Attributes:
        normal: Normal force on each side during the last physics step, N, ``(n_segments, 4)`` in the order of `SIDES`.
        count: Number of geoms that touched then, ``(n_segments,)``.
        slip_speed: Mean velocity of these along the body towards its front and along the ground, weighted by their
            normal forces, over the last movement, m/s, ``(n_segments,)``; 0 in the air.
        slip_distance: Way that the segment has slid so far, m, ``(n_segments,)``: the sum of the mean lengths of its
            geoms' displacements along the ground, in any direction, weighted as above.
        slip_loss: Work lost to friction so far, J, ``(n_segments,)``.
    """

    normal: Array
    count: Array
    slip_speed: Array
    slip_distance: Array
    slip_loss: Array

    @classmethod
    def none(cls, n_segments: int) -> Touch:
        """Returns that of a worm that has touched nothing yet."""
        normal = np.zeros((n_segments, len(SIDES)))
        return cls(normal, *(np.zeros(n_segments) for _ in range(4)))

    def state(self) -> State:
        """Returns copies of all numbers, for a checkpoint."""
        return {f"touch_{name}": getattr(self, name).copy() for name in self.__slots__}

    @classmethod
    def of_state(cls, state: State) -> Touch:
        """Returns the touch whose `state` is among these arrays."""
        return cls(*(np.array(state[f"touch_{name}"], dtype=float) for name in cls.__slots__))


class Skin:
    """The geoms of one worm that can touch, and the surface that they touch.

    Attributes:
        segment: Segment of each geom, counted from 0, ``(n_geoms,)``.
        side: Side of each geom, an index of `SIDES`, ``(n_geoms,)``.
    """

    def __init__(
        self, rest_m: Array, segment: NDArray[np.int64], n_segments: int, radius_m: float, surface: Surface
    ) -> None:
        """Sorts the geoms.

        Args:
            rest_m: Centres of the geoms at rest, m, ``(n_geoms, 3)``; the tube's axis is parallel to x at y = 0.
            segment: Segment of each geom, counted from 0.
            n_segments: Number of segments.
            radius_m: Radius of the tube at rest, the height of its axis above z = 0, m.
            surface: What they touch.
        """
        self.segment = segment
        self.side = sides_of(rest_m[:, 1], rest_m[:, 2] - radius_m)
        self._n_segments = n_segments
        self._surface = surface

    def felt(
        self, so_far: Touch, ground_N: Array, before_m: Array, after_m: Array, axis: Array, time_s: float
    ) -> Touch:
        """Adds a movement of the body to what was felt so far.

        Args:
            so_far: What was felt before the movement.
            ground_N: Force of the ground on each geom during the movement's last physics step, N, ``(n_geoms, 3)``.
            before_m: Centres of the geoms before the movement, m, ``(n_geoms, 3)``.
            after_m: The same after it.
            axis: Unit vectors along the body towards its front at each segment, ``(n_segments, 3)``.
            time_s: How long it took, s.
        """
        # A few belly vertices touch, of hundreds; sums run in the geoms' order, so that they are always the same bits.
        touching = np.flatnonzero(ground_N.any(axis=-1))
        force, segment = ground_N[touching], self.segment[touching]
        normal = self._surface.normal(before_m[touching])
        pressure = (force * normal).sum(axis=-1)
        moved = after_m[touching] - before_m[touching]
        along = moved - (moved * normal).sum(axis=-1)[:, np.newaxis] * normal
        forwards = (along * axis[segment]).sum(axis=-1)
        lost = -(force * along).sum(axis=-1)

        n = self._n_segments
        quarter = len(SIDES) * segment + self.side[touching]
        weight = np.bincount(segment, pressure, n)
        carried = np.where(weight > 0.0, weight, 1.0)
        slid = np.bincount(segment, pressure * np.sqrt((along * along).sum(axis=-1)), n)
        return Touch(
            normal=np.bincount(quarter, pressure, n * len(SIDES)).reshape(n, len(SIDES)).astype(float, copy=False),
            count=np.bincount(segment, minlength=n).astype(float),
            slip_speed=np.bincount(segment, pressure * forwards, n) / carried / time_s,
            slip_distance=so_far.slip_distance + slid / carried,
            slip_loss=so_far.slip_loss + np.bincount(segment, lost, n),
        )


def sides_of(left_right_m: Array, up_m: Array) -> NDArray[np.int64]:
    """Returns the side that points of a cross-section lie on, as indices of `SIDES`: the quarter that holds them.

    A point between two quarters counts to belly or back, the same on the left and the right.

    Args:
        left_right_m: How far right of the axis each point is (left is negative), m.
        up_m: How far above the axis, m.
    """
    turn = np.arctan2(-left_right_m, -up_m) / _QUARTER_RAD
    # Half-way numbers are rounded to even ones, which are belly and back.
    return np.rint(np.round(turn, 9)).astype(np.int64) % len(SIDES)

"""Geometry of the helical mesh: strands, crossings, rhombi, rings and springs, as numpy arrays.

Numbers only: no engine, no configuration. The body axis is x, however a worm leads at the start; lengths are in
metres, angles in radians.

A strand turns at the rate ``w`` (rad/m) about the axis. Clockwise strand ``i`` lies at the angle
``w x + i D`` and counter-clockwise strand ``j`` at ``c - w x - j D``, with ``D = 4 pi / n_helices`` and
``y = R cos(angle)``, ``z = R + R sin(angle)``, so that the lowest line of the tube is z = 0. Where the radius differs
among the segments, it changes linearly from ring to ring, and the axis is as high as the largest one. Two strands
meet where ``2 w x = c - (i + j) D`` modulo ``2 pi``: on planes spaced ``D / (2 w)`` apart, each carrying one
crossing of every clockwise strand. The offset ``c`` puts the first plane half a spacing behind the front end
and equals pi/2 for 12 helices, as in the paper's model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import asin, floor, hypot, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Array", "Indices", "MeshGeometry", "helical_mesh", "rhombus"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_SAME_PLACE = 1e-9
"""Of the body's length: difference of two distances that are equal but for rounding."""
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
"""For every axis in space, the two that its vector product is of."""


@dataclass(frozen=True)
class MeshGeometry:
    """The mesh at rest.

    Crossings are numbered plane by plane: crossing ``p * n_per_plane + i`` lies on plane ``p`` and on
    clockwise strand ``i``. Strands are numbered clockwise first.
    """

    n_segments: int  # actuated
    radius_m: float  # of the tube, the largest where it differs; the height of the body axis
    angular_rate_rad_per_m: float  # turn of a strand per metre of body
    vertices_m: Array  # points of every strand, front to back, (n_strands, n_vertices, 3)
    crossing_vertex: Indices  # index along every strand of each plane's crossing, (n_planes,)
    crossing_strands: Indices  # the clockwise and the counter-clockwise strand of each crossing, (n_crossings, 2)
    plane_x_m: Array  # position of each crossing plane, (n_planes,)
    ring_planes: Indices  # plane of each segment's ring, (n_segments,)
    rings: Indices  # crossings round each ring in order of angle, (n_segments, n_per_plane); the first closes it
    springs: Indices  # front and rear crossing of every axial spring, (n_springs, 2), bay by bay
    sensor_springs: Indices
    """Springs that span each segment's ring plane, ``(n_segments, n_per_plane)``; the first starts on clockwise strand
    0, "the first helix"."""
    rhombi: Indices  # front, left, rear and right crossing of every complete rhombus, (n_rhombi, 4)

    @property
    def n_strands(self) -> int:
        """Number of strands (helices)."""
        return self.vertices_m.shape[0]

    @property
    def n_per_plane(self) -> int:
        """Number of crossings on each plane, half the number of helices."""
        return self.n_strands // 2

    @property
    def n_crossings(self) -> int:
        """Number of crossings, each a pin."""
        return self.crossing_strands.shape[0]

    @property
    def length_m(self) -> float:
        """Length of the mesh along the body axis."""
        return float(self.vertices_m[0, -1, 0])

    def along(self, values: ArrayLike, x_m: Array) -> Array:
        """Spreads numbers of the segments over places along the body.

        Args:
            values: One for each segment, ``(n_segments, ..)``.
            x_m: Places along the body at rest, ``(n,)``.

        Returns:
            Those of the segment whose ring is nearest to each place, the mean of two midway between them, ``(n, ..)``.
        """
        away = np.abs(np.subtract.outer(x_m, self.plane_x_m[self.ring_planes]))
        nearest = away <= away.min(axis=1, keepdims=True) + _SAME_PLACE * self.length_m
        return (nearest / nearest.sum(axis=1, keepdims=True)) @ np.asarray(values, dtype=float)

    @cached_property
    def crossings_m(self) -> Array:
        """Position of every crossing, shape ``(n_crossings, 3)``."""
        return self.vertices_m[: self.n_per_plane, self.crossing_vertex].swapaxes(0, 1).reshape(-1, 3)

    @cached_property
    def crossing_plane(self) -> Indices:
        """Plane of every crossing, shape ``(n_crossings,)``."""
        return np.arange(self.n_crossings) // self.n_per_plane

    @cached_property
    def strand_length_m(self) -> float:
        """Length of one strand along its straight elements."""
        return float(np.linalg.norm(np.diff(self.vertices_m[0], axis=0), axis=1).sum())

    @cached_property
    def spring_length_m(self) -> Array:
        """Length of every axial spring at rest, shape ``(n_springs,)``."""
        front, rear = self.crossings_m[self.springs[:, 0]], self.crossings_m[self.springs[:, 1]]
        return np.linalg.norm(rear - front, axis=1)

    @cached_property
    def spring_longest_m(self) -> Array:
        """Length of every axial spring at which the strands beside it are straight, shape ``(n_springs,)``."""
        along = np.linalg.norm(np.diff(self.vertices_m, axis=1), axis=2).cumsum(axis=1)
        sides = np.diff(np.insert(along, 0, 0.0, axis=1)[:, self.crossing_vertex], axis=1)
        front, plane = self.springs[:, 0], self.crossing_plane[self.springs[:, 0]]
        beside = front + self.n_per_plane
        return sides[self.crossing_strands[front, 0], plane] + sides[self.crossing_strands[beside, 1], plane + 1]

    @cached_property
    def ring_length_m(self) -> Array:
        """Length of every ring at rest (a closed polygon), shape ``(n_segments,)``."""
        corners = self.crossings_m[self.rings]
        return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).sum(axis=1)


class Rhombus(NamedTuple):
    """One rhombus of the mesh at rest, in closed form: two crossings of a ring, and the two of an axial spring."""

    n_per_plane: int  # rhombi round the body, as many as crossings of a ring
    across_m: float  # distance of neighbouring crossings of a ring
    along_m: float  # distance of the crossings that an axial spring joins, two planes apart
    side_m: float  # length of a strand from one crossing to the next, along its straight elements
    bend_rad: float  # angle by which a strand turns about the body axis in one element

    @property
    def ring_length_m(self) -> float:
        """Length of a ring at rest."""
        return self.n_per_plane * self.across_m

    @property
    def longest_m(self) -> float:
        """Distance along the axis at which the strands are straight: no spring of inextensible strands is longer."""
        return 2.0 * self.side_m

    @property
    def opening_rad(self) -> float:
        """Half the angle at which the two strands of a crossing meet, seen along the ring; pi/2 for flat rings."""
        return asin(min(1.0, self.across_m / hypot(self.across_m, self.along_m)))


def rhombus(n_helices: int, radius_m: float, angular_rate_rad_per_m: float, elements_per_side: int) -> Rhombus:
    """Returns the rhombus of the mesh that `helical_mesh` generates from the same numbers."""
    half = n_helices // 2
    spacing, turn = pi / half / angular_rate_rad_per_m, pi / half
    element = hypot(spacing / elements_per_side, 2.0 * radius_m * sin(turn / elements_per_side / 2.0))
    across = 2.0 * radius_m * sin(turn)
    return Rhombus(half, across, 2.0 * spacing, elements_per_side * element, turn / elements_per_side)


def helical_mesh(
    n_segments: int,
    *,
    n_helices: int = 12,
    radius_m: float | Sequence[float] = 0.16,
    angular_rate_rad_per_m: float = 14.0,
    elements_per_side: int = 3,
    elements_per_end: int | None = None,
    planes_between_rings: int = 4,
    free_planes_at_ends: int = 3,
    rear_overhang_m: float | None = None,
) -> MeshGeometry:
    """Generates the mesh of a worm at rest.

    Args:
        n_segments: Segments; this and all others are fields of `annelid.body.worm.Mesh`, where they are checked.
        n_helices: Strands, half of each handedness.
        radius_m: Radius at rest, m, or that of every ring: linear between two rings, the same beyond the last.
        angular_rate_rad_per_m: Turn of a strand along the axis, rad/m.
        elements_per_side: Elements of a strand between two crossings.
        elements_per_end: Of a free end; as many as of a side by default.
        planes_between_rings: Planes of crossings from one ring to the next.
        free_planes_at_ends: Planes before the first ring and behind the last.
        rear_overhang_m: Length of the strands behind the last plane, m; half a plane's distance by default.
    """
    ends = elements_per_side if elements_per_end is None else elements_per_end
    half = n_helices // 2
    step = 2 * pi / half
    spacing = step / (2 * angular_rate_rad_per_m)
    overhang = spacing / 2 if rear_overhang_m is None else rear_overhang_m
    n_planes = 2 * free_planes_at_ends + (n_segments - 1) * planes_between_rings + 1
    plane_x: Array = spacing * (0.5 + np.arange(n_planes, dtype=np.float64))
    ring_planes = free_planes_at_ends + planes_between_rings * np.arange(n_segments)
    offset = step / 2 + step * floor(pi / 2 / step)

    # Every strand at the planes, at its two ends, and evenly in between.
    knots = np.concatenate([[0.0], plane_x, [plane_x[-1] + overhang]])
    counts = [ends, *[elements_per_side] * (n_planes - 1), ends]
    spans = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(knots, knots[1:], counts, strict=False)]
    x = np.append(np.concatenate(spans), knots[-1])
    turn, phase = angular_rate_rad_per_m * x[None], step * np.arange(half)[:, None]
    angle = np.concatenate([turn + phase, offset - turn - phase])
    radii = np.broadcast_to(radius_m, n_segments)
    radius, largest = np.interp(x, plane_x[ring_planes], radii), float(radii.max())
    y, z = radius * np.cos(angle), largest + radius * np.sin(angle)

    # Strands pair at each plane: i + j is the same number on a whole plane, modulo half.
    total = np.rint((offset - 2 * angular_rate_rad_per_m * plane_x) / step).astype(np.int64)
    clockwise = np.arange(half)
    counter = (total[:, None] - clockwise[None]) % half + half
    springs, sensor_springs = _springs(ring_planes, n_planes, half)

    # Every rhombus by its four corners: front, its two neighbours on the next plane, rear.
    plane, strand = np.meshgrid(np.arange(n_planes - 2), clockwise, indexing="ij")
    lower = (strand - 1) % half
    corners = plane * half + strand, (plane + 1) * half + strand, (plane + 2) * half + lower, (plane + 1) * half + lower
    return MeshGeometry(
        n_segments=n_segments,
        radius_m=largest,
        angular_rate_rad_per_m=angular_rate_rad_per_m,
        vertices_m=np.stack([np.broadcast_to(x, angle.shape), y, z], axis=-1),
        crossing_vertex=ends + elements_per_side * np.arange(n_planes),
        crossing_strands=np.stack([np.broadcast_to(clockwise, counter.shape), counter], axis=-1).reshape(-1, 2),
        plane_x_m=plane_x,
        ring_planes=ring_planes,
        rings=ring_planes[:, None] * half + clockwise[None],
        springs=springs,
        sensor_springs=sensor_springs,
        rhombi=np.stack(corners, axis=-1).reshape(-1, 4),
    )


def _springs(ring_planes: Indices, n_planes: int, half: int) -> tuple[Indices, Indices]:
    """Lays springs over two planes: one bay round each ring, and further bays end to end where they fit.

    A strand advances by one angular step over two planes, so the crossing at the same angle lies on the
    clockwise strand one lower.
    """
    bays: list[int] = []
    start = (ring_planes[0] - 1) % 2
    for ring in ring_planes:
        bays.extend(range(start, int(ring) - 2, 2))
        bays.append(int(ring) - 1)
        start = int(ring) + 1
    bays.extend(range(start, n_planes - 2, 2))
    strand = np.arange(half)
    front = np.asarray(bays)[:, None] * half + strand[None]
    rear = (np.asarray(bays)[:, None] + 2) * half + (strand[None] - 1) % half
    springs = np.stack([front, rear], axis=-1).reshape(-1, 2)
    sensor_bay = np.asarray([bays.index(int(ring) - 1) for ring in ring_planes])
    return springs, sensor_bay[:, None] * half + strand[None]


def norm(vectors: Array) -> Array:
    """Returns the lengths of vectors, ``(.., 3)``, along the last axis."""
    squares = vectors * vectors
    # In this order the last bit is that of numpy's einsum and of a dot product.
    return np.sqrt((squares[..., 0] + squares[..., 2]) + squares[..., 1])


def cross(first: Array, second: Array) -> Array:
    """Returns the vector products over the first axis, ``(3, ..)``; several times as fast as `numpy.cross`."""
    return first.take(_NEXT, 0) * second.take(_LAST, 0) - first.take(_LAST, 0) * second.take(_NEXT, 0)

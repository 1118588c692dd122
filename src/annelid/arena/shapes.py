"""The shapes of relief and pipes as triangles, to be drawn."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from annelid.arena.course import UP, Bore, Course, Straight
from annelid.arena.surface import Hills, PipeWall, Stairs, ground_of
from annelid.config import Arena
from annelid.protocols import Array

PIPE_GRAIN_M = 0.03
"""Length of a pipe's triangles."""
AROUND = 48
"""Triangle edges round a pipe."""
ENTRY_SHOWN_M = 0.15
EXIT_SHOWN_M = 1.2
GROUND_AHEAD_M = 6.0
GROUND_BEHIND_M = 1.5
GROUND_HALF_WIDTH_M = 2.0
"""How much is drawn of what goes on for ever: behind the worm's rear, beyond the last change, round the worm."""
GROUND_GRAIN_M = 0.03
ROUNDED_GRAIN = 6
"""Edges of a drawn rounding."""


@dataclass(frozen=True)
class Shape:
    """Triangles that face the onlooker.

    Attributes:
        vertices_m: Their corners, m, ``(n_vertices, 3)``.
        faces: Corners of each, anticlockwise as they are seen, ``(n_faces, 3)``.
    """

    vertices_m: Array
    faces: NDArray[np.int32]


def shape_of(arena: Arena, length_m: float) -> Shape | None:
    """Returns the shape of an arena's ground, or None where a plane does.

    Args:
        arena: The arena.
        length_m: Length of the worm, which stands or lies in it.
    """
    surface = ground_of(arena)
    if isinstance(surface, PipeWall):
        return _tube(surface, length_m)
    if isinstance(surface, Stairs):
        return _flight(surface)
    if isinstance(surface, Hills):
        return _field(surface)
    return None


def last_change_m(course: Course, bore: Bore) -> float:
    """Returns the arc length at which a pipe's last curve or change of its bore ends, m."""
    ends = [piece.first_m for piece in course.pieces if isinstance(piece, Straight) and isfinite(piece.first_m)]
    return max([*ends, float(bore.arc_m[-1])])


def frames_along(course: Course, arc_m: Array) -> tuple[Array, Array, Array]:
    """Returns the centre line's points at arc lengths and two unit vectors across it, ``(n, 3)`` each.

    The second one points as far upwards as it can, so the rings drawn with them are not twisted.
    """
    foot = course.at(arc_m)
    side: Array = np.cross(foot.tangent, UP)
    side = side / np.linalg.norm(side, axis=-1, keepdims=True)
    up: Array = np.cross(side, foot.tangent)
    return foot.point_m, side, up


def _tube(wall: PipeWall, length_m: float) -> Shape:
    first, last = -(length_m + ENTRY_SHOWN_M), last_change_m(wall.course, wall.bore) + EXIT_SHOWN_M
    arc = np.linspace(first, last, int((last - first) / PIPE_GRAIN_M) + 2)
    centre, side, up = frames_along(wall.course, arc)
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    across = np.cos(angle)[:, np.newaxis] * side[:, np.newaxis] + np.sin(angle)[:, np.newaxis] * up[:, np.newaxis]
    rings = centre[:, np.newaxis] + wall.bore.at(arc)[0][:, np.newaxis, np.newaxis] * across
    return Shape(rings.reshape(-1, 3), _grid_faces(len(arc), AROUND, closed=True))


def _flight(stairs: Stairs) -> Shape:
    profile = stairs.profile
    turn = np.linspace(0.0, np.pi / 2, ROUNDED_GRAIN)
    r, h = profile.rounding_m, profile.height_m
    riser = np.concatenate(
        [
            np.stack([-r + r * np.sin(turn), r - r * np.cos(turn)], axis=-1),
            np.stack([r - r * np.cos(turn), h - r + r * np.sin(turn)], axis=-1),
        ]
    )
    n_steps = max(int((GROUND_AHEAD_M - profile.start_m) / profile.length_m), 1)
    risers = [riser + np.array([profile.start_m + k * profile.length_m, k * h]) for k in range(n_steps)]
    end = [[GROUND_AHEAD_M, n_steps * h]] if n_steps * profile.length_m + profile.start_m < GROUND_AHEAD_M else []
    line = np.concatenate([[[-GROUND_BEHIND_M, 0.0]], *risers, np.reshape(end, (-1, 2))])
    across = np.linspace(-GROUND_HALF_WIDTH_M, GROUND_HALF_WIDTH_M, 9)
    x, y = np.meshgrid(-line[:, 0], across, indexing="ij")
    z = np.broadcast_to(line[:, 1:] + stairs.level_m, x.shape)
    return Shape(np.stack([x, y, z], axis=-1).reshape(-1, 3), _grid_faces(*x.shape)[:, ::-1])


def _field(hills: Hills) -> Shape:
    ahead = np.arange(-GROUND_BEHIND_M, GROUND_AHEAD_M, GROUND_GRAIN_M)
    across = np.arange(-GROUND_HALF_WIDTH_M, GROUND_HALF_WIDTH_M, GROUND_GRAIN_M)
    x, y = np.meshgrid(-ahead, across, indexing="ij")
    height, _ = hills.ground.height(np.stack([x, y], axis=-1))
    return Shape(np.stack([x, y, height + hills.level_m], axis=-1).reshape(-1, 3), _grid_faces(*x.shape)[:, ::-1])


def _grid_faces(n_along: int, n_across: int, *, closed: bool = False) -> NDArray[np.int32]:
    """Corners of the triangles between rows of vertices, ``(n_faces, 3)``; closed rows are rings."""
    n_cells = n_across if closed else n_across - 1
    row, column = np.meshgrid(np.arange(n_along - 1), np.arange(n_cells), indexing="ij")
    a, b = row * n_across + column, row * n_across + (column + 1) % n_across
    c, d = a + n_across, b + n_across
    return np.stack([a, c, b, b, c, d], axis=-1).reshape(-1, 3).astype(np.int32)

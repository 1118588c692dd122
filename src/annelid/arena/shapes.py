"""Shapes as triangles, to be drawn, and how much is drawn of a ground that has no end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


def grid_faces(n_along: int, n_across: int, *, closed: bool = False) -> NDArray[np.int32]:
    """Corners of the triangles between rows of vertices, ``(n_faces, 3)``; closed rows are rings."""
    n_cells = n_across if closed else n_across - 1
    row, column = np.meshgrid(np.arange(n_along - 1), np.arange(n_cells), indexing="ij")
    a, b = row * n_across + column, row * n_across + (column + 1) % n_across
    c, d = a + n_across, b + n_across
    return np.stack([a, c, b, b, c, d], axis=-1).reshape(-1, 3).astype(np.int32)

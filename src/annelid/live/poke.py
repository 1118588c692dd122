"""What a click hits."""

from __future__ import annotations

import numpy as np

from annelid.morphology import Array

REACH_M = 0.04
"""Distance from the line of sight within which a point of the mesh is hit; its meshes are wider than a mouse."""


def struck(points_m: Array, origin_m: Array, direction: Array) -> Array | None:
    """Returns the point that a ray hits first.

    Args:
        points_m: Points of the worm, m, ``(n, 3)``.
        origin_m: Where the ray begins, m, ``(3,)``.
        direction: Its unit direction, ``(3,)``.

    Returns:
        The nearest to the origin of all points within `REACH_M` of the ray, ``(3,)``, or None.
    """
    offsets = points_m - origin_m
    depth = offsets @ direction
    beside = np.linalg.norm(offsets - depth[:, np.newaxis] * direction, axis=-1)
    hit = np.flatnonzero((beside < REACH_M) & (depth > 0))
    return points_m[hit[depth[hit].argmin()]] if hit.size else None

"""What has been published of the physical robot that the paper compares its model with."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from annelid.config.run import published_worms
from annelid.protocols import Array

ROBOT_ELONGATION_M: tuple[float, ...] = tuple(published_worms()["wang"][0]["numbers"]["elongation_mean_max_m"][0])
"""Largest elongation of the robot's segments 1-4 while it walks straight on flat ground, m."""


def relative_to_first(elongation_m: ArrayLike) -> Array:
    """Divides the elongations of segments, m, ``(n_segments,)``, by that of segment 1."""
    elongation = np.asarray(elongation_m, dtype=float)
    return elongation / elongation[0]

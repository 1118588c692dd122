"""What has been published of the physical robot that the paper compares its model with."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from annelid.protocols import Array

ROBOT_ELONGATION_M = (0.0615, 0.0382, 0.0478, 0.0598)
"""Largest elongation of the robot's segments 1-4 while it walks straight on flat ground, m: each the mean of the left
and the right stretch sensor. Riddle et al. 2023, section 4, from data of Wang. Its Fig. 9 shows the readings over
time as a graph; numbers are given of these maxima only.
"""


def relative_to_first(elongation_m: ArrayLike) -> Array:
    """Divides the elongations of segments, m, ``(n_segments,)``, by that of segment 1."""
    elongation = np.asarray(elongation_m, dtype=float)
    return elongation / elongation[0]

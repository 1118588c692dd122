"""What has been published of the physical robot that the paper compares its model with."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

ROBOT_ELONGATION_M = (0.0615, 0.0382, 0.0478, 0.0598)
"""Largest elongation of the robot's segments 1-4 while it walks straight on flat ground, m: each the mean of the left
and the right stretch sensor. Riddle et al. 2023, section 4, from data of Wang. Its Fig. 9 shows the readings over
time as a graph; numbers are given of these maxima only.
"""


def relative_to_first(elongation_m: ArrayLike) -> NDArray[np.float64]:
    """Divides the elongations of segments by that of segment 1.

    Args:
        elongation_m: Shape ``(n_segments,)``, m.

    Returns:
        Shape ``(n_segments,)``; the first is 1.
    """
    elongation = np.asarray(elongation_m, dtype=float)
    return elongation / elongation[0]

"""The kinematic tube of Huang et al.: a braided mesh with rigid sides, without forces, in closed form.

Crossings lie on planes across the axis, ``n`` on each, evenly round it and turned by ``pi / n`` from one plane to the
next. Neighbours on adjacent planes are joined by straight sides of the one length ``s``. Where planes of radii ``R_1``
and ``R_2`` are ``d`` apart, ``s^2 = d^2 + R_1^2 + R_2^2 - 2 R_1 R_2 cos(pi / n)``. In a uniform tube a rhombus is
``l = 2 d`` long, a ring through the crossings of a plane measures ``C = 2 n R sin(pi / n)``, and so

    l^2 + w^2 = 4 s^2   with   w = C / (n cos(pi / 2n)),

the planar worm's rhombus with the width ``w``: ring length against segment length is a quarter of an ellipse.

Source: the construction of Huang et al. as described by Riddle et al. 2023, section 3 ("rigid side lengths", no
forces); the closed form is derived here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from annelid.protocols import Array


def segment_length(ring_length_m: ArrayLike, side_m: float, n_per_plane: int) -> Array:
    """Returns the length of a rhombus along a uniform tube, m, of the ring length's shape.

    Raises:
        ValueError: The sides are too short for such a ring.
    """
    width = np.asarray(ring_length_m, dtype=np.float64) / (n_per_plane * np.cos(np.pi / (2 * n_per_plane)))
    square = (2.0 * side_m) ** 2 - width * width
    if np.any(square < 0.0):
        raise ValueError(f"ring_length_m = {ring_length_m} is too large for sides of side_m = {side_m:g}")
    return np.sqrt(square)

"""The kinematic tube of Huang et al.: a braided mesh with rigid sides, without forces, in closed form.

Crossings lie on planes across the axis, ``n`` on each, evenly round it and turned by half a step, ``pi / n``, from one
plane to the next. Neighbours on adjacent planes are joined by straight sides of the one length ``s``. Where planes of
radii ``R_1`` and ``R_2`` are ``d`` apart,

    s^2 = d^2 + R_1^2 + R_2^2 - 2 R_1 R_2 cos(pi / n)

In a uniform tube a rhombus is ``l = 2 d`` long, a ring through the crossings of a plane measures
``C = 2 n R sin(pi / n)``, and so

    l^2 + w^2 = 4 s^2   with   w = C / (n cos(pi / 2n))

which is the planar worm's rhombus with the width ``w``. Ring length against segment length is thus a quarter of an
ellipse, whatever the forces. Lengths in m.

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
    width = _width(ring_length_m, n_per_plane)
    return _other_diagonal(width, side_m, "ring_length_m", ring_length_m)


def ring_length(segment_length_m: ArrayLike, side_m: float, n_per_plane: int) -> Array:
    """Returns the length of a ring through the crossings of a plane of a uniform tube, m; of the argument's shape.

    Raises:
        ValueError: The sides are too short for such a segment.
    """
    width = _other_diagonal(
        np.asarray(segment_length_m, dtype=np.float64), side_m, "segment_length_m", segment_length_m
    )
    return width * n_per_plane * np.cos(np.pi / (2 * n_per_plane))


def tube(plane_radius_m: ArrayLike, side_m: float, n_per_plane: int) -> Array:
    """Returns the crossings of a tube whose planes may differ in their radii.

    Args:
        plane_radius_m: Radius of every plane, m, shape ``(n_planes,)``.
        side_m: Length of every side, m.
        n_per_plane: Crossings on each plane, at least 3.

    Returns:
        Positions, m, shape ``(n_planes, n_per_plane, 3)``, the first plane at x = 0. Crossing ``i`` of a plane is
        joined to crossings ``i`` and ``i - 1`` of the next if that is an odd one, ``i`` and ``i + 1`` else.

    Raises:
        ValueError: The sides are too short for two neighbouring planes.
    """
    radius = np.asarray(plane_radius_m, dtype=np.float64)
    across = radius[:-1] ** 2 + radius[1:] ** 2 - 2.0 * radius[:-1] * radius[1:] * np.cos(np.pi / n_per_plane)
    if np.any(across > side_m**2):
        plane = int(np.argmax(across > side_m**2))
        raise ValueError(
            f"side_m = {side_m:g} is too short to join planes of the radii {radius[plane]:g} and {radius[plane + 1]:g}"
        )
    x = np.concatenate([[0.0], np.cumsum(np.sqrt(side_m**2 - across))])
    turn = np.pi / n_per_plane * (np.arange(len(radius)) % 2)
    angle = turn[:, np.newaxis] + 2.0 * np.pi / n_per_plane * np.arange(n_per_plane)
    ring = radius[:, np.newaxis]
    return np.stack(
        [np.broadcast_to(x[:, np.newaxis], angle.shape), ring * np.cos(angle), ring * np.sin(angle)], axis=-1
    )


def _width(ring_length_m: ArrayLike, n_per_plane: int) -> Array:
    return np.asarray(ring_length_m, dtype=np.float64) / (n_per_plane * np.cos(np.pi / (2 * n_per_plane)))


def _other_diagonal(diagonal_m: Array, side_m: float, name: str, given: ArrayLike) -> Array:
    square = (2.0 * side_m) ** 2 - diagonal_m * diagonal_m
    if np.any(square < 0.0):
        raise ValueError(f"{name} = {given} is too large for sides of side_m = {side_m:g}")
    return np.sqrt(square)

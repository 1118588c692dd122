"""How far a contraction spreads through the mesh: the diagonals of every rhombus against rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.morphology import Array, Indices, MeshGeometry


@dataclass(frozen=True, slots=True)
class Deformation:
    """Relative change of every rhombus' diagonals against rest, ``(..., n_rhombi)``."""

    axial: Array  # of the diagonal from the front to the rear corner
    lateral: Array  # of the diagonal between the left and the right corner


def rhombus_diagonals(crossings_m: ArrayLike, rhombi: Indices) -> tuple[Array, Array]:
    """Measures the diagonals of rhombi.

    Args:
        crossings_m: Positions of the crossings, m, ``(..., n_crossings, 3)``.
        rhombi: Crossings at the corners, ``(n_rhombi, 4)``.

    Returns:
        Axial and lateral diagonals, m, ``(..., n_rhombi)`` each.
    """
    front, left, rear, right = np.moveaxis(np.asarray(crossings_m, dtype=float)[..., rhombi, :], -2, 0)
    return np.linalg.norm(rear - front, axis=-1), np.linalg.norm(right - left, axis=-1)


def deformation(crossings_m: ArrayLike, geometry: MeshGeometry) -> Deformation:
    """Compares every rhombus with its shape at rest.

    Args:
        crossings_m: Positions of the crossings, m, ``(..., n_crossings, 3)``.
        geometry: The mesh at rest.
    """
    axial, lateral = rhombus_diagonals(crossings_m, geometry.rhombi)
    rest_axial, rest_lateral = rhombus_diagonals(geometry.crossings_m, geometry.rhombi)
    return Deformation(axial / rest_axial - 1.0, lateral / rest_lateral - 1.0)


def rhombus_plane(geometry: MeshGeometry) -> Indices:
    """Crossing plane of each rhombus' left and right corner, through its middle, shape ``(n_rhombi,)``."""
    return geometry.crossing_plane[geometry.rhombi[:, 1]]


def actuated(geometry: MeshGeometry) -> NDArray[np.bool_]:
    """Which rhombi have a ring muscle across them, shape ``(n_rhombi,)``."""
    return np.isin(rhombus_plane(geometry), geometry.ring_planes)


def distance_from_ring_m(geometry: MeshGeometry, segment: int) -> Array:
    """Distance along the resting body from the ring of a segment to the middle of each rhombus.

    Args:
        geometry: The mesh at rest.
        segment: The segment, from 0.

    Returns:
        Distances, m, negative towards the front, ``(n_rhombi,)``.
    """
    return geometry.plane_x_m[rhombus_plane(geometry)] - geometry.plane_x_m[geometry.ring_planes[segment]]


def plane_means(values: ArrayLike, geometry: MeshGeometry) -> Array:
    """Averages values round each plane that has rhombi.

    Args:
        values: One for each rhombus, ``(.., n_rhombi)``.
        geometry: The mesh.

    Returns:
        Means, front to back, ``(.., n_planes - 2)``.
    """
    array = np.asarray(values, dtype=float)
    plane = rhombus_plane(geometry)
    return np.stack([array[..., plane == p].mean(axis=-1) for p in np.unique(plane)], axis=-1)

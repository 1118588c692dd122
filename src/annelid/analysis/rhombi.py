"""How far a contraction spreads through the mesh: the diagonals of every rhombus against rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.errors import RunFileError
from annelid.morphology import Indices, MeshGeometry
from annelid.protocols import Array
from annelid.simulation.runfile import Run


@dataclass(frozen=True, slots=True)
class Deformation:
    """Relative change of every rhombus' diagonals against rest.

    Attributes:
        axial: Of the diagonal from the front to the rear corner, a fraction, shape ``(..., n_rhombi)``.
        lateral: Of the diagonal between the left and the right corner, a fraction, same shape.
    """

    axial: Array
    lateral: Array


def rhombus_diagonals(crossings_m: ArrayLike, rhombi: Indices) -> tuple[Array, Array]:
    """Measures the straight lines between opposite corners.

    Args:
        crossings_m: Positions of the crossings, m, shape ``(..., n_crossings, 3)``.
        rhombi: Front, left, rear and right crossing of each rhombus, shape ``(n_rhombi, 4)``.

    Returns:
        Axial and lateral diagonals, m, each of shape ``(..., n_rhombi)``.
    """
    corners = np.asarray(crossings_m, dtype=float)[..., rhombi, :]
    axial = np.linalg.norm(corners[..., 2, :] - corners[..., 0, :], axis=-1)
    lateral = np.linalg.norm(corners[..., 3, :] - corners[..., 1, :], axis=-1)
    return axial, lateral


def deformation(crossings_m: ArrayLike, geometry: MeshGeometry) -> Deformation:
    """Compares every rhombus with its shape at rest.

    Args:
        crossings_m: Positions of the crossings, m, shape ``(..., n_crossings, 3)``.
        geometry: The mesh at rest.
    """
    axial, lateral = rhombus_diagonals(crossings_m, geometry.rhombi)
    rest_axial, rest_lateral = rhombus_diagonals(geometry.crossings_m, geometry.rhombi)
    return Deformation(axial / rest_axial - 1.0, lateral / rest_lateral - 1.0)


def nearest_frame(run: Run, time_s: float) -> int:
    """Finds the recorded posture nearest to a time.

    Args:
        run: The run of a 3D worm.
        time_s: The time, s.

    Returns:
        Its index along the run's ``frame`` dimension.

    Raises:
        RunFileError: No postures recorded, or the time lies more than a frame's interval outside of them.
    """
    if "crossing_position" not in run.data or run.data.sizes.get("frame", 0) == 0:
        raise RunFileError(f"{run.path} holds no recorded postures of a 3D worm")
    times = run.data["frame_time"].values
    margin = float(np.diff(times).max()) if len(times) > 1 else 0.0
    if not times[0] - margin <= time_s <= times[-1] + margin:
        raise RunFileError(
            f"{run.path} holds no posture at {time_s:g} s: it was recorded from {times[0]:g} to {times[-1]:g} s"
        )
    return int(np.abs(times - time_s).argmin())


def rhombus_plane(geometry: MeshGeometry) -> Indices:
    """Crossing plane of each rhombus' left and right corner, through its middle, shape ``(n_rhombi,)``."""
    return geometry.crossing_plane[geometry.rhombi[:, 1]]


def actuated(geometry: MeshGeometry) -> NDArray[np.bool_]:
    """Tells which rhombi have a ring muscle across them, shape ``(n_rhombi,)``."""
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
    """Averages values of rhombi round each plane that has some.

    Args:
        values: One value a rhombus, ``(.., n_rhombi)``.
        geometry: The mesh at rest.

    Returns:
        Means from front to back, ``(.., n_planes - 2)``.
    """
    array = np.asarray(values, dtype=float)
    plane = rhombus_plane(geometry)
    return np.stack([array[..., plane == p].mean(axis=-1) for p in np.unique(plane)], axis=-1)

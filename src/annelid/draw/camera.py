"""Where the worm is seen from: named views, and the distance at which the whole worm fits."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.errors import RunFileError, suggest

VIEWS_DEG = {
    "isometric": (52.0, -24.0),
    "side": (90.0, -8.0),
    "top": (90.0, -89.0),
    "front": (15.0, -12.0),
    "course": (90.0, -89.0),
}
"""Azimuth and elevation of the line of sight; the first segment starts on the left, or nearest."""
FIXED = frozenset({"course"})  # views that stand still and show the whole course; the others follow the worm

FIELD_OF_VIEW_DEG = 30.0
MARGIN = 0.84  # share of the picture that the worm may fill: 8 % stay free on each side


def view_angles(name: str) -> tuple[float, float]:
    """Returns azimuth and elevation of a named view, degrees.

    Raises:
        RunFileError: No view has that name.
    """
    if name not in VIEWS_DEG:
        raise RunFileError(f"unknown camera {name!r}: {suggest(name, VIEWS_DEG)}")
    return VIEWS_DEG[name]


def fitting_distance(offsets_m: ArrayLike, azimuth_deg: float, elevation_deg: float, aspect: float) -> float:
    """Finds the distance from which every point is in the picture.

    Args:
        offsets_m: Points relative to the one that the camera looks at, m, shape ``(n, 3)``.
        azimuth_deg: Direction of sight, about z.
        elevation_deg: Direction of sight, negative when looking down.
        aspect: Width over height of the picture.

    Returns:
        Distance from the camera to the point looked at, m.
    """
    points = np.asarray(offsets_m, dtype=float)
    right, up, sight = picture_axes(azimuth_deg, elevation_deg)
    half_height = math.tan(math.radians(FIELD_OF_VIEW_DEG) / 2) * MARGIN
    needed = np.maximum(np.abs(points @ up) / half_height, np.abs(points @ right) / (half_height * aspect))
    return float(np.max(needed - points @ sight))


def picture_axes(
    azimuth_deg: float, elevation_deg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Returns the unit vectors of a view: to the right and up in the picture, and along the line of sight.

    Args:
        azimuth_deg: Direction of the line of sight about the vertical, degrees.
        elevation_deg: Its angle above the horizontal, degrees; negative looks down.
    """
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    level = math.cos(elevation)
    sight = np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])
    right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
    return right, np.cross(right, sight), sight


def picture_points(
    offsets_m: ArrayLike, azimuth_deg: float, elevation_deg: float, distance_m: float, aspect: float
) -> NDArray[np.float64]:
    """Finds where points appear in a perspective picture.

    Args:
        offsets_m: Points from the centre of the picture, m, ``(..., 3)``.
        azimuth_deg: As of `picture_axes`.
        elevation_deg: As of `picture_axes`.
        distance_m: Of the camera from the centre, m.
        aspect: Width of the picture over its height.

    Returns:
        Places as shares of the picture's width and height from its upper left corner, shape ``(..., 2)``.
    """
    points = np.asarray(offsets_m, dtype=float)
    right, up, sight = picture_axes(azimuth_deg, elevation_deg)
    height = 2.0 * math.tan(math.radians(FIELD_OF_VIEW_DEG) / 2) * (points @ sight + distance_m)
    return np.stack([0.5 + points @ right / (height * aspect), 0.5 - points @ up / height], axis=-1)

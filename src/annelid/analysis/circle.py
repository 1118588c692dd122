"""A circle through a track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

_CLEARLY = 3.0
"""An arc is one where it bulges by more than this many times what the points are off it."""


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle fitted to a track.

    Attributes:
        centre_m: Its centre, x and y, m.
        radius_m: Its radius, m.
        angle_rad: Angle that the track covers seen from the centre, positive to the left (from x to y), rad.
        off_m: Root mean square of the points' distances from the circle, m.
    """

    centre_m: tuple[float, float]
    radius_m: float
    angle_rad: float
    off_m: float

    @property
    def signed_radius_m(self) -> float:
        """The radius, positive for a track that turns left, m."""
        return self.radius_m if self.angle_rad > 0 else -self.radius_m

    @property
    def bulge_m(self) -> float:
        """How far the arc stands off its chord, at most the diameter, m."""
        return self.radius_m * (1.0 - float(np.cos(min(abs(self.angle_rad) / 2, np.pi))))

    @property
    def is_told(self) -> bool:
        """Whether the track bends clearly more than it swings."""
        return self.bulge_m > _CLEARLY * self.off_m and self.bulge_m > 1e-9 * self.radius_m


def fitted_circle(points_m: ArrayLike) -> Circle | None:
    """Fits a circle to points of a track in the order of time.

    The sum of ``(|p|^2 + b . p + c)^2`` over its mean squared slope is smallest (Taubin 1991), which unlike plain
    least squares does not draw the radius of a short noisy arc in.

    Args:
        points_m: Positions seen from above, m, ``(n, 2)``.

    Returns:
        The circle; None for fewer than three points or for points on a line.
    """
    points = np.asarray(points_m, dtype=float)
    if len(points) < 3:
        return None
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    square = x * x + y * y
    mean = square.mean()
    if not mean > 0:
        return None
    columns = np.stack([(square - mean) / (2.0 * np.sqrt(mean)), x, y], axis=-1)
    a, b, c = np.linalg.svd(columns, full_matrices=False)[2][-1]
    curved = a / (2.0 * np.sqrt(mean))
    if abs(curved) * np.sqrt(mean) < 1e-9:
        return None
    centre = -np.array([b, c]) / (2.0 * curved)
    radius = float(np.sqrt(centre @ centre + mean))
    away = np.hypot(x - centre[0], y - centre[1])
    angle = np.unwrap(np.arctan2(y - centre[1], x - centre[0]))
    off = float(np.sqrt(((away - radius) ** 2).mean()))
    place = middle + centre
    return Circle((float(place[0]), float(place[1])), radius, float(angle[-1] - angle[0]), off)

"""How much each segment lengthens, in both readings, and how much the middle lags behind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, slots=True)
class Elongation:
    """Elongation of every segment during a run, in several readings.

    The paper does not say how it read its Fig. 7; its numbers come out as the peak to peak of the spring on
    the first helix, so that reading stands beside the plainer one, the mean of a segment's sensors, and the range
    over all of them.

    Attributes:
        first_helix_pp_m: Largest minus smallest length of the first helix's spring, m, ``(n_segments,)``.
        least_pp_m: The same of the sensor with which it is least, m, same shape.
        most_pp_m: The same of the sensor with which it is most, m, same shape.
        mean_max_m: Largest mean length of the segment's sensors above their rest length, m, same shape.
    """

    first_helix_pp_m: NDArray[np.float64]
    least_pp_m: NDArray[np.float64]
    most_pp_m: NDArray[np.float64]
    mean_max_m: NDArray[np.float64]


def elongation(stretch_m: ArrayLike, rest_m: ArrayLike) -> Elongation:
    """Reads the elongation of every segment.

    Args:
        stretch_m: Sensor lengths, m, shape ``(n_times, n_segments, n_sensors)``; sensor 0 on the first helix.
        rest_m: Their lengths at rest, m, shape ``(n_segments, n_sensors)``.

    Returns:
        All readings.
    """
    stretch = np.asarray(stretch_m, dtype=float)
    rest = np.asarray(rest_m, dtype=float)
    peak_to_peak = np.ptp(stretch, axis=0)
    return Elongation(
        first_helix_pp_m=peak_to_peak[:, 0],
        least_pp_m=peak_to_peak.min(axis=1),
        most_pp_m=peak_to_peak.max(axis=1),
        mean_max_m=stretch.mean(axis=2).max(axis=0) - rest.mean(axis=1),
    )


def middle_deficit(elongation_m: ArrayLike) -> float:
    """How far the interior segments stay below the first: ``1 - mean(interior) / first``.

    With three segments this is the paper's "segment 2 below segment 1" (39.4 %).

    Args:
        elongation_m: Elongation of each segment, m, shape ``(n_segments,)``, at least three.

    Returns:
        A fraction; NaN where the first segment does not elongate.
    """
    values = np.asarray(elongation_m, dtype=float)
    return float(1.0 - values[1:-1].mean() / values[0]) if values[0] > 0 else float("nan")


def interior_deficit(elongation_m: ArrayLike) -> float:
    """How far the interior segments stay below both ends: ``1 - mean(interior) / mean(ends)``.

    Args:
        elongation_m: Elongation of each segment, m, shape ``(n_segments,)``, at least three.

    Returns:
        A fraction; NaN where the ends do not elongate.
    """
    values = np.asarray(elongation_m, dtype=float)
    ends = (values[0] + values[-1]) / 2.0
    return float(1.0 - values[1:-1].mean() / ends) if ends > 0 else float("nan")


def end_difference(elongation_m: ArrayLike) -> float:
    """How far the last segment stays below the first: ``1 - last / first``, a fraction (NaN if unmoved)."""
    values = np.asarray(elongation_m, dtype=float)
    return float(1.0 - values[-1] / values[0]) if values[0] > 0 else float("nan")

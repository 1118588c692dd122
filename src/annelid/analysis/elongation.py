"""How much each segment lengthens, in several readings, and how far the middle stays below the ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from annelid.protocols import Array


@dataclass(frozen=True, slots=True)
class Elongation:
    """Elongation of every segment during a run, in several readings, ``(n_segments,)`` each.

    The paper does not say how it read its Fig. 7; its numbers come out as the peak to peak of the spring on the first
    helix. Beside it stand the plainer mean of a segment's sensors, and the range over all of them.
    """

    first_helix_pp_m: Array  # largest minus smallest length of the first helix's spring
    least_pp_m: Array  # the same of the sensor with which it is least
    most_pp_m: Array  # the same of the sensor with which it is most
    mean_max_m: Array  # largest mean length of the segment's sensors above their rest length


def elongation(stretch_m: ArrayLike, rest_m: ArrayLike) -> Elongation:
    """Reads elongations from sensor lengths, m, ``(n_times, n_segments, n_sensors)``, and their lengths at rest."""
    stretch, rest = np.asarray(stretch_m, dtype=float), np.asarray(rest_m, dtype=float)
    peak_to_peak = np.ptp(stretch, axis=0)
    return Elongation(
        first_helix_pp_m=peak_to_peak[:, 0],
        least_pp_m=peak_to_peak.min(axis=1),
        most_pp_m=peak_to_peak.max(axis=1),
        mean_max_m=stretch.mean(axis=2).max(axis=0) - rest.mean(axis=1),
    )


def middle_deficit(elongation_m: ArrayLike) -> float:
    """How far the interior segments stay below the first: ``1 - mean(interior) / first``, NaN if that is unmoved.

    With three segments this is the paper's "segment 2 below segment 1" (39.4 %).
    """
    values = np.asarray(elongation_m, dtype=float)
    return _deficit(values[1:-1].mean(), values[0])


def interior_deficit(elongation_m: ArrayLike) -> float:
    """How far the interior segments stay below both ends: ``1 - mean(interior) / mean(ends)``."""
    values = np.asarray(elongation_m, dtype=float)
    return _deficit(values[1:-1].mean(), (values[0] + values[-1]) / 2.0)


def end_difference(elongation_m: ArrayLike) -> float:
    """How far the last segment stays below the first: ``1 - last / first``."""
    values = np.asarray(elongation_m, dtype=float)
    return _deficit(values[-1], values[0])


def _deficit(less: float, full: float) -> float:
    return float(1.0 - less / full) if full > 0 else float("nan")

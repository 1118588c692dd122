"""How far segments elongate, read from the springs that are a worm's stretch sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from annelid.analysis.numbers import finite, finite_each, number
from annelid.simulation.runfile import Recorded


@dataclass(frozen=True, kw_only=True)
class Elongation:
    """How far segments elongate."""

    elongation_first_helix_pp_m: list[float | None] | None = number(
        "longest less shortest length at the first stretch sensor, which lies on the first helix or on the left side",
        "sensor range",
        "cm",
        per_segment=True,
    )
    elongation_least_pp_m: list[float | None] | None = number(
        "sensor range of the segment's sensor at which it is least", "least sensor range", "cm", per_segment=True
    )
    elongation_most_pp_m: list[float | None] | None = number(
        "sensor range of the segment's sensor at which it is most", "most sensor range", "cm", per_segment=True
    )
    elongation_mean_max_m: list[float | None] | None = number(
        "largest mean of the segment's stretch sensors above rest", "elongation", "cm", per_segment=True
    )
    middle_deficit: float | None = number(
        "by how much interior segments stay below the first, at the first sensor", "middle deficit", "%"
    )
    middle_deficit_mean: float | None = number(
        "by how much interior segments stay below the first, mean of the sensors", "middle deficit, mean", "%"
    )
    end_difference: float | None = number(
        "by how much the last segment stays below the first, at the first sensor", "end difference", "%"
    )


def elongation(data: Mapping[str, Recorded]) -> Elongation:
    """Reads the elongation of every segment from a run's signals.

    The paper does not say how it read its Fig. 7; its numbers come out as the peak to peak on the first helix.
    """
    if "stretch_length" not in data or not data["time"].values.size:
        return Elongation()
    stretch, rest = data["stretch_length"].values, data["stretch_rest_length"].values
    peak_to_peak = np.ptp(stretch, axis=0)
    first_helix, mean = peak_to_peak[:, 0], stretch.mean(axis=2).max(axis=0) - rest.mean(axis=1)
    several = stretch.shape[2] > 1
    return Elongation(
        elongation_first_helix_pp_m=finite_each(first_helix),
        elongation_least_pp_m=finite_each(peak_to_peak.min(axis=1)) if several else None,
        elongation_most_pp_m=finite_each(peak_to_peak.max(axis=1)) if several else None,
        elongation_mean_max_m=finite_each(mean),
        middle_deficit=finite(middle_deficit(first_helix)),
        middle_deficit_mean=finite(middle_deficit(mean)),
        end_difference=finite(end_difference(first_helix)),
    )


def middle_deficit(elongation_m: ArrayLike) -> float:
    """How far the interior segments stay below the first: ``1 - mean(interior) / first``, NaN without any or unmoved.

    With three segments this is the paper's "segment 2 below segment 1" (39.4 %).
    """
    values = np.asarray(elongation_m, dtype=float)
    return _deficit(values[1:-1].mean() if len(values) > 2 else np.nan, values[0])


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

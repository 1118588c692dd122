"""From measured cases to conclusions: errors against a converged run, the Pareto front, the exponent of the cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

JUDGING = ("elongation_max", "period")
"""The errors that decide: the larger of the two is the error of a case."""


def errors(measured: Mapping[str, Any], reference: Mapping[str, Any]) -> dict[str, Any]:
    """Compares a run with a converged one.

    Args:
        measured: A `annelid.analysis.Summary` as a mapping.
        reference: The same of the converged run.

    Returns:
        Relative errors, as fractions, of the shortest ring, of each segment's elongation and the largest of these, and
        of the period; ``travel_m``, the difference of the travel, m; and ``largest``, of `JUDGING`. Each is None where
        one of the two runs lacks the quantity, or the reference's is zero.
    """
    elongation = _elongation_errors(measured["elongation_mean_max_m"], reference["elongation_mean_max_m"])
    found: dict[str, Any] = {
        "ring_length_min": _relative(measured["ring_length_min_m"], reference["ring_length_min_m"]),
        "elongation": elongation,
        "elongation_max": _largest(elongation),
        "period": _relative(measured["period_s"], reference["period_s"]),
        "travel_m": _difference(measured["travel_m"], reference["travel_m"]),
    }
    return found | {"largest": _largest([found[name] for name in JUDGING])}


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float | None:
    """Slope of log(cost) against log(size) by least squares; None for fewer than two sizes."""
    if len(set(sizes)) < 2:
        return None
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def front(points: Mapping[str, tuple[float, float]]) -> list[str]:
    """Names the points that no other one beats, from the fastest to the most exact.

    Args:
        points: Speed and error of each; more of the first and less of the second is better.

    Returns:
        Names of those for which no other point is at least as good in both and better in one.
    """
    best = []
    least = float("inf")
    for name, (_, error) in sorted(points.items(), key=lambda item: (-item[1][0], item[1][1])):
        if error < least:
            best.append(name)
            least = error
    return best


def _elongation_errors(measured: Sequence[Any] | None, reference: Sequence[Any] | None) -> list[float | None] | None:
    if measured is None or reference is None:
        return None
    return [_relative(*pair) for pair in zip(measured, reference, strict=True)]


def _relative(value: float | None, reference: float | None) -> float | None:
    if value is None or not reference:
        return None
    return abs(value - reference) / abs(reference)


def _difference(value: float | None, reference: float | None) -> float | None:
    return None if value is None or reference is None else abs(value - reference)


def _largest(values: Sequence[float | None] | None) -> float | None:
    """The largest, or None where one is missing: an error that is not known is not small."""
    if not values or any(value is None for value in values):
        return None
    return max(value for value in values if value is not None)

"""How sure a mean over repeated runs is."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan

import numpy as np

CONFIDENCE = 0.95
Estimate = tuple[float, float, float]
"""A mean and the ends of its 95 % interval."""


def mean_and_interval(values: Sequence[float]) -> Estimate:
    """Returns the mean of numbers and the ends of its 95 % interval by Student's t; NaN where there are too few."""
    from scipy.stats import sem, t

    if not len(values):
        return nan, nan, nan
    mean, n = float(np.mean(values)), len(values)
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, n - 1) * sem(values)) if n > 1 else nan
    return mean, mean - half, mean + half

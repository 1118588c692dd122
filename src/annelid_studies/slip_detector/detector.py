"""A slip detector from what a robot can sense: how long its segments are, and what load they bear.

Stretch gives how fast segments move apart, so the speed of each against all others, but not against the ground. Load
gives the rest: a crawling worm's inertia is small beside friction, and friction opposes slip in proportion to load. So
the segments that slide forwards over the ground bear as much as those that slide backwards, and the ground moves at the
median of the segments' speeds, weighted by their loads. What bears load and differs from it slips. Riddle et al. 2023
point to this combination of sensors; how they are combined is our own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from annelid.control import lengthening_m
from annelid.protocols import Array, Sensation

TIME_CONSTANT_S = 0.03
"""Of the first-order filter on lengths and loads."""
LEAST_LOAD_N = 1.0
"""A segment that bears less does not slip."""
LIMIT_M_PER_S = 0.1
"""Estimated speed over the ground above which a segment is said to slip."""
SPRINGS_PER_SEGMENT = 1.5
"""By how many times a segment lengthens more than its stretch sensor."""


class SlipDetector:
    """Estimates every segment's speed over the ground, and which ones slip.

    Attributes:
        n_segments: Number of segments.
        speed_m_per_s: Estimated speed of each segment over the ground, positive towards the front, ``(n_segments,)``.
        bears: Which segments bear enough load to slip, ``(n_segments,)``.
    """

    def __init__(self, n_segments: int) -> None:
        """Takes the number of segments."""
        self.n_segments = n_segments
        self.reset()

    def reset(self) -> None:
        """Forgets all readings."""
        self._time_s = np.nan
        self._longer_m, self._load_N, self.speed_m_per_s = np.zeros((3, self.n_segments))
        self.bears = np.zeros(self.n_segments, dtype=bool)

    def read(self, sensation: Sensation) -> NDArray[np.bool_]:
        """Reads what the body senses; call it once for every movement of the body.

        Args:
            sensation: Lengths, touch and time are used.

        Returns:
            Which segments slip, ``(n_segments,)``; none at the first reading, or if no time has passed.
        """
        longer_m = SPRINGS_PER_SEGMENT * lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        load_N = sensation.touch_N.sum(axis=1)
        passed_s = sensation.time_s - self._time_s
        self._time_s = sensation.time_s
        if not passed_s > 0.0:
            self._longer_m, self._load_N = longer_m, load_N
            return np.zeros(self.n_segments, dtype=bool)
        share = passed_s / (TIME_CONSTANT_S + passed_s)
        before = self._longer_m
        self._longer_m = before + share * (longer_m - before)
        self._load_N = self._load_N + share * (load_N - self._load_N)
        self.speed_m_per_s = ground_speed((self._longer_m - before) / passed_s, self._load_N)
        self.bears = self._load_N >= LEAST_LOAD_N
        return (np.abs(self.speed_m_per_s) > LIMIT_M_PER_S) & self.bears


def ground_speed(lengthening_m_per_s: Array, load_N: Array) -> Array:
    """Estimates the speed of every segment over the ground, m/s, by the balance of Coulomb's friction.

    Neighbours part at the mean of the rates at which both lengthen; the first and the last segment touch with the tip,
    which is half a segment farther out. The ground moves at the weighted median of the segments' speeds: friction on
    the faster ones balances that on the slower ones.
    """
    parting = 0.5 * (lengthening_m_per_s[1:] + lengthening_m_per_s[:-1])
    speed = np.append(parting[::-1].cumsum()[::-1], 0.0)
    speed[0] += 0.5 * lengthening_m_per_s[0]
    speed[-1] -= 0.5 * lengthening_m_per_s[-1]
    return speed - weighted_median(speed, load_N)


def weighted_median(values: Array, weights: Array) -> float:
    """Returns the value below and above which there is at most half of the weight; the mean if there is none."""
    total = weights.sum()
    if not total > 0.0:
        return float(values.mean())
    order = np.argsort(values, kind="stable")
    share = weights[order].cumsum() / total
    return float(values[order][np.searchsorted(share, 0.5)])

"""A slip detector from what a robot can sense: how long its segments are, and what load they bear.

Stretch gives how fast segments move apart, so the speed of each against all others, but not against the ground. Load
gives the rest: a crawling worm's inertia is small beside friction, and friction opposes slip in proportion to load. So
the segments that slide forwards over the ground bear as much as those that slide backwards, and the ground moves at the
median of the segments' speeds, weighted by their loads. What bears load and differs from it slips. Riddle et al. 2023
point to this combination of sensors; how they are combined is our own.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field

import numpy as np
from numpy.typing import NDArray

from annelid.control import lengthening_m
from annelid.errors import require_at_least, require_positive
from annelid.protocols import Array, Sensation


@dataclass
class SlipDetector:
    """Estimates every segment's speed over the ground, and which ones slip.

    Attributes:
        n_segments: Number of segments.
        time_constant_s: Of the first-order filter on lengths and loads, s.
        least_load_N: A segment that bears less does not slip, N.
        limit_m_per_s: Estimated speed over the ground above which a segment is said to slip, m/s.
        springs_per_segment: Length of a segment over that of its stretch sensor: by how many times the segment
            lengthens more than the sensor.
        speed_m_per_s: Estimated speed of each segment over the ground, positive towards the front, ``(n_segments,)``.
        bears: Which segments bear enough load to slip, ``(n_segments,)``.

    Raises:
        ConfigError: Fewer than 2 segments, a time constant or a limit that is not positive, or a share below 0.
    """

    n_segments: int
    _: KW_ONLY
    time_constant_s: float = 0.03
    least_load_N: float = 1.0
    limit_m_per_s: float = 0.1
    springs_per_segment: float = 1.5
    speed_m_per_s: Array = field(init=False)
    bears: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        require_at_least(2, n_segments=self.n_segments)
        require_positive(time_constant_s=self.time_constant_s, limit_m_per_s=self.limit_m_per_s)
        require_at_least(0, least_load_N=self.least_load_N, springs_per_segment=self.springs_per_segment)
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
        longer_m = self.springs_per_segment * lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        load_N = sensation.touch_N.sum(axis=1)
        passed_s = sensation.time_s - self._time_s
        self._time_s = sensation.time_s
        if not passed_s > 0.0:
            self._longer_m, self._load_N = longer_m, load_N
            return np.zeros(self.n_segments, dtype=bool)
        share = passed_s / (self.time_constant_s + passed_s)
        before = self._longer_m
        self._longer_m = before + share * (longer_m - before)
        self._load_N = self._load_N + share * (load_N - self._load_N)
        self.speed_m_per_s = ground_speed((self._longer_m - before) / passed_s, self._load_N)
        self.bears = self._load_N >= self.least_load_N
        return (np.abs(self.speed_m_per_s) > self.limit_m_per_s) & self.bears


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

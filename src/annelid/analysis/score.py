"""The score of a rhythm: is it ordered, and how regular is it?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.analysis.rhythm import (
    CONTRACTED,
    contractions,
    in_order,
    is_continued,
    segment_activation,
    segment_intervals,
    startup_end,
)
from annelid.control.sns import paper_controller
from annelid.protocols import Array

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

SHORTEST_S = 0.02
"""Contractions, and interruptions of one, that are shorter do not count, s."""
LEAST_LENGTHENING_M = 0.0025
"""Segments that lengthen by less than twice this are not moved, m."""
DESIGN_INTERVAL_S = 0.875
"""Interval of successive onsets by design at a gate time constant of 300 ms, whatever N (Riddle et al. 2022), s."""
SILENCE = 2.0
"""A run is silent if nothing has begun for longer than this many expected intervals."""
MOST_PERIOD_CV = 0.2
"""Largest coefficient of variation of an ordered rhythm's periods."""
LEAST_CONCENTRATION = 0.5
"""Least mean resultant length of the lags of one pair of neighbours in an ordered rhythm."""
WAVE_TOLERANCE = 0.375
"""Largest distance of a segment from its place in a wave, in steps of 1/N of the period."""
COUNT_TOLERANCE = 0.25
"""How near the number of contracted segments must be to the larger of two numbers of fronts to tell for it."""

UNEVEN = "regular but not a wave"
"""Reason of the verdict on a rhythm that fails to be ordered by its spacing only."""

_DESIGN_GATE_MS = 300.0

Verdict = Literal["ordered", "disordered", "silent"]


@dataclass(frozen=True, slots=True)
class RhythmScore:
    """The score of a rhythm; `score` says how each number is found.

    Attributes:
        verdict: ``"ordered"``, ``"disordered"`` or ``"silent"``; None for a run too short to tell.
        reason: Why, in a short phrase.
        order: Segments (from 1) in the order of their onsets, the initial state's first.
        period_s: Mean interval between successive onsets of the same segment, s; None if none repeats.
        period_cv: Standard deviation of those intervals over their mean; None with fewer than two of them.
        regularity: Mean resultant length of the lags between neighbours, in [0, 1]: 1 for an even wave; None without
            a lag.
        direction: +1 for a wave from front to rear (1-2-..-N), -1 from rear to front, 0 for neither.
        wave_fronts: How many waves travel at once, 1 for the paper's; None unless ordered.
        mean_contracted: Mean number of segments contracted at once from the first onset after the start-up on.
        last_onset_s: Time of the last onset, s; None if there is none.
    """

    verdict: Verdict | None
    reason: str
    order: tuple[int, ...]
    period_s: float | None
    period_cv: float | None
    regularity: float | None
    direction: Literal[-1, 0, 1]
    wave_fronts: int | None
    mean_contracted: float
    last_onset_s: float | None

    @property
    def is_regular(self) -> bool:
        """Whether neighbours take turns with steady periods and lags, be they those of an even wave or not."""
        return self.verdict == "ordered" or self.reason == UNEVEN

    @property
    def is_one_wave(self) -> bool:
        """Whether segments contract in order, in one wave from front to rear."""
        return self.verdict == "ordered" and self.direction == 1 and self.wave_fronts == 1


def rhythm_score(run: Run, after_s: float = 0.0) -> RhythmScore:
    """Scores the rhythm of a run as `score` does.

    The expected interval is the design's: 0.875 s, scaled by the gate time constant where the controller is the
    synthetic nervous system.

    Args:
        run: A run, opened with `annelid.open_run`.
        after_s: Judge only what comes after this simulated time, as if the run continued another, s.

    Raises:
        ValueError: The run file holds no activation.
    """
    times, judged = _judged(run, "activation", after_s)
    network = paper_controller(run.config.controller)
    gate_ms = network.gate_time_constant_ms if network is not None else _DESIGN_GATE_MS
    activation = segment_activation(run.data["activation"].values, run.config.body.n_segments)
    return score(times, activation[judged], DESIGN_INTERVAL_S * gate_ms / _DESIGN_GATE_MS)


def lengthening_score(run: Run, after_s: float = 0.0) -> RhythmScore:
    """Scores the rhythm in which a worm's segments lengthen, as `score` does; the muscles' word is not taken.

    A segment counts as contracted while its mean lengthening is at least half of its own largest, and not at all if
    that is below 5 mm.

    Args:
        run: As for `rhythm_score`.
        after_s: As for `rhythm_score`.

    Raises:
        ValueError: The run file holds no stretch sensors.
    """
    times, judged = _judged(run, "stretch_length", after_s)
    lengthening = (run.data["stretch_length"] - run.data["stretch_rest_length"]).mean("sensor")
    lengthening = lengthening.transpose("time", "segment").values[judged]
    largest = np.maximum(lengthening.max(axis=0, initial=0.0), 2.0 * LEAST_LENGTHENING_M)
    return score(times, lengthening / largest)


def _judged(run: Run, signal: str, after_s: float) -> tuple[Array, NDArray[np.bool_]]:
    """Times of the samples from one on, and which of all they are."""
    if signal not in run.data:
        raise ValueError(f"{run.path} holds no {signal}")
    times = run.data["time"].values
    judged = times >= after_s
    return times[judged], judged


def score(time_s: ArrayLike, activation: ArrayLike, interval_s: float = DESIGN_INTERVAL_S) -> RhythmScore:
    """Tells whether segments contract in order, and how regularly.

    **Onsets.** A segment is contracted while its activation is at least 0.5. Interruptions below 20 ms are bridged,
    then contractions below 20 ms left out. An onset in the first sampling interval from time zero belongs to the
    initial state: it stands in the order and counts as a contraction, but no cycle begins with it. In a run whose
    first sample is later, what is contracted there has no onset.

    **Cycles and lags.** A cycle is the time from one onset of a segment to its next. The segments stand in a closed
    ring, 1-2-..-N-1. The lag of a segment behind the one before it is its onset's phase in that one's cycle, or one
    minus that one's phase in its own cycle; both count. The period is the mean of all cycles; ``regularity`` is the
    mean resultant length of all lags together, that is ``|mean(exp(2 pi i lag))|``.

    **Verdict**, the first that holds:

    1. silent: nothing has begun for longer than 2 expected intervals. Expected is the longest interval between any
       two successive onsets, and as long as no segment has gone through a cycle, no less than ``interval_s``. The
       reason begins with "stalled" if a segment stays contracted.
    2. disordered: a cycle in which a neighbour in the ring does not contract exactly once.
    3. None, too short: a segment has not contracted twice, or a pair of neighbours has no lag. Two cycles of all
       segments are enough, and the initial contraction counts as one of segment 1's.
    4. disordered: ``period_cv`` above 0.2; or lags of one pair with a mean resultant length below 0.5; or "regular but
       not a wave": the winding number W, the sum of the mean lags round the ring, is not in 1 .. N-1, or some segment
       is farther than 3/8 of a step of 1/N from its place in the even wave in which all lags are W/N.
    5. ordered.

    **Fronts.** W fronts that travel to the rear and N - W that travel forwards have the same onsets. The smaller number
    is taken, unless ``mean_contracted`` is within 0.25 of the larger: where each contraction hands over to the next,
    as many segments are contracted as there are fronts. So 1-3-2 is one front forwards where one of the three segments
    is contracted at once, and two fronts to the rear where two are. What this cannot tell apart: a wave 1-2-3 whose
    contractions last two thirds of the period is called two fronts forwards. With W = N/2 the direction is 0.

    Args:
        time_s: Sample times, s, rising, shape ``(n_times,)``.
        activation: Activation of each segment, in [0, 1], shape ``(n_times, n_segments)``, at least 3 segments.
        interval_s: Expected interval between successive onsets where the run shows none, s.

    Returns:
        The score.

    Raises:
        ValueError: Fewer than 3 segments.
    """
    times = np.asarray(time_s, dtype=float)
    values = np.asarray(activation, dtype=float)
    n = values.shape[1]
    if n < 3:
        raise ValueError(f"a rhythm needs at least 3 segments, not {n}")
    found = [contractions(times, of_segment, shortest_s=SHORTEST_S) for of_segment in values.T]
    onsets = [c[c[:, 0] > times[0], 0] if is_continued(times) else c[:, 0] for c in found]
    events = in_order(onsets)
    started = startup_end(times)
    judged = [of_segment[of_segment > started] for of_segment in onsets]
    periods = segment_intervals(onsets, started)
    cycle_lags = [_lags(judged[i], judged[(i + 1) % n]) for i in range(n)]
    lags = [np.concatenate([np.empty(0), *of_pair]) for of_pair in cycle_lags]
    pooled = np.concatenate(lags)
    from_s = min((of_segment[0] for of_segment in judged if of_segment.size), default=-np.inf)
    contracted = (values[times >= from_s] >= CONTRACTED).sum(axis=1)
    mean_contracted = float(contracted.mean()) if contracted.size else 0.0
    period_cv = float(periods.std() / periods.mean()) if periods.size > 1 else None
    direction, fronts = 0, None

    verdict: Verdict | None
    if silence := _silence(times, events, periods.size > 0, interval_s):
        stuck = [i + 1 for i, c in enumerate(found) if c.size and np.isinf(c[-1, 1])]
        one = len(stuck) == 1
        named = f"segment{'' if one else 's'} {', '.join(map(str, stuck))} stay{'s' if one else ''}"
        verdict, reason = "silent", f"stalled: {named} contracted" if stuck else silence
    elif pair := next((i + 1 for i, of_pair in enumerate(cycle_lags) if any(len(lag) != 1 for lag in of_pair)), 0):
        verdict, reason = "disordered", f"segments {pair} and {pair % n + 1} do not take turns"
    elif min(map(len, onsets)) < 2 or min(map(len, lags)) < 1:
        verdict, reason = None, "too short: fewer than two cycles"
    elif period_cv is not None and period_cv > MOST_PERIOD_CV:
        verdict, reason = "disordered", f"periods vary by {100 * period_cv:.0f} %"
    elif min(map(_resultant, lags)) < LEAST_CONCENTRATION:
        verdict, reason = "disordered", "lags between neighbours wander"
    else:
        mean_lags = [_mean_phase(of_pair) for of_pair in lags]
        winding = round(sum(mean_lags))
        # How far segments stray from the even wave, in steps of 1/N.
        excess = np.cumsum([0.0, *mean_lags[:-1]]) - np.arange(n) * winding / n
        if float(np.ptp(excess) / 2 * n) > WAVE_TOLERANCE or not 0 < winding < n:
            verdict, reason = "disordered", UNEVEN
        else:
            direction, fronts = _fronts(winding, n, mean_contracted)
            way = {1: " from front to rear", -1: " from rear to front", 0: ""}[direction]
            verdict, reason = "ordered", f"a wave of {fronts} front{'' if fronts == 1 else 's'}{way}"
    return RhythmScore(
        verdict=verdict,
        reason=reason,
        order=tuple(segment for _, segment in events),
        period_s=float(periods.mean()) if periods.size else None,
        period_cv=period_cv,
        regularity=_resultant(pooled) if pooled.size else None,
        direction=direction,
        wave_fronts=fronts,
        mean_contracted=mean_contracted,
        last_onset_s=events[-1][0] if events else None,
    )


def _lags(front: Array, rear: Array) -> list[Array]:
    """Lags of ``rear`` behind ``front``, an array for each cycle of either."""
    return [*_phases(front, rear), *(1.0 - phases for phases in _phases(rear, front))]


def _phases(cycles: Array, onsets: Array) -> list[Array]:
    return [(onsets[(onsets >= a) & (onsets < b)] - a) / (b - a) for a, b in pairwise(cycles)]


def _silence(times: Array, events: Sequence[tuple[float, int]], cycled: bool, interval_s: float) -> str:
    """Says since when nothing has begun, or nothing while that is not long."""
    if not times.size:
        return ""
    longest = max((b - a for (a, _), (b, _) in pairwise(events)), default=0.0)
    expected = longest if cycled else max(longest, interval_s)
    last = events[-1][0] if events else times[0]
    if times[-1] - last <= SILENCE * expected:
        return ""
    return f"no contraction begins after {last:.2f} s" if events else "no contraction begins"


def _resultant(phases: Array) -> float:
    return float(np.abs(np.exp(2j * np.pi * phases).mean()))


def _mean_phase(phases: Array) -> float:
    """Circular mean, in [0, 1)."""
    return float(np.angle(np.exp(2j * np.pi * phases).mean()) / (2 * np.pi) % 1.0)


def _fronts(winding: int, n: int, mean_contracted: float) -> tuple[Literal[-1, 0, 1], int]:
    """Direction and number of fronts of a wave."""
    if 2 * winding == n:
        return 0, winding
    smaller, larger = sorted((winding, n - winding))
    fronts = larger if abs(mean_contracted - larger) <= COUNT_TOLERANCE else smaller
    return 1 if fronts == winding else -1, fronts

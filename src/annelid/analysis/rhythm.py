"""When which segment contracts: onsets, their order, the period and the wave; and the score of a rhythm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.analysis.numbers import number
from annelid.control.sns import paper_controller
from annelid.protocols import Array
from annelid.simulation.runfile import Run

CONTRACTED = 0.5  # activation above which a muscle counts as contracted (half of its range)
LEAST_SEGMENTS = 2  # that can have an order
SHORTEST_S = 0.02  # contractions, and interruptions of one, that are shorter do not count in a score, s
LEAST_LENGTHENING_M = 0.0025  # segments that lengthen by less than twice this are not moved, m
DESIGN_INTERVAL_S = 0.875
"""Interval of successive onsets by design at a gate time constant of 300 ms, whatever N (Riddle et al. 2022), s."""
SILENCE = 2.0  # a run is silent if nothing has begun for longer than this many expected intervals
MOST_PERIOD_CV = 0.2  # largest coefficient of variation of an ordered rhythm's periods
LEAST_CONCENTRATION = 0.5  # least mean resultant length of the lags of one pair of neighbours in an ordered rhythm
WAVE_TOLERANCE = 0.375  # largest distance of a segment from its place in a wave, in steps of 1/N of the period
COUNT_TOLERANCE = 0.25
"""Largest difference of the number of contracted segments from the larger of two numbers of fronts that selects it."""
UNEVEN = "regular but not a wave"  # reason of the verdict on a rhythm that fails to be ordered by its spacing only
_DESIGN_GATE_MS = 300.0

Verdict = Literal["ordered", "disordered", "silent"]


@dataclass(frozen=True, kw_only=True)
class Rhythm:
    """When which segment contracts. The numbers whose name begins with ``rhythm_`` are those of `RhythmScore`."""

    order: list[int] = number("segments, from 1, in the order of their contractions", in_sweeps=False, factory=list)
    onsets_s: list[float] = number("times of those contractions", in_sweeps=False, factory=list)
    wave: bool | None = number("whether the order is 1-2-..-N over and over; in a sweep 1 or 0")
    full_cycles: int = number("how many times N successive onsets ran 1-2-..-N", default=0)
    period_s: float | None = number("mean interval between successive contractions of a segment", "period", "s")
    period_std_s: float | None = number("standard deviation of those intervals", "period, deviation", "s")
    rhythm_verdict: Verdict | None = number("ordered, disordered or silent; none if too short", in_sweeps=False)
    rhythm_reason: str | None = number("why, in a short phrase", in_sweeps=False)
    rhythm_regularity: float | None = number("how even the lags between neighbours are: 1 for an even wave")


@dataclass(frozen=True, slots=True)
class RhythmScore:
    """The score of a rhythm; `score` says how each number is found.

    Attributes:
        verdict: ``"ordered"``, ``"disordered"`` or ``"silent"``; None for a run too short to decide.
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


def segment_activation(activation: ArrayLike, n_segments: int) -> Array:
    """Averages activation over each segment's ring or half-rings.

    Args:
        activation: Of every muscle, ``(n_times, n_muscles)``.
        n_segments: Segments.

    Returns:
        Activation of every segment, ``(n_times, n_segments)``.
    """
    values = np.asarray(activation, dtype=float)
    return values.reshape(len(values), n_segments, values.shape[1] // n_segments).mean(axis=2)


def contractions(time_s: ArrayLike, signal: ArrayLike, threshold: float = CONTRACTED, shortest_s: float = 0.0) -> Array:
    """Finds from when to when a signal is at or above a threshold, interpolating linearly between samples.

    Interruptions below ``shortest_s`` are bridged, then contractions below it left out. What is contracted at the first
    sample begins there; what is contracted at the last ends at infinity, and is as long as was seen of it.

    Args:
        time_s: Times of the samples, s, ``(n_times,)``.
        signal: The signal, ``(n_times,)``.
        threshold: Contracted is at least this.
        shortest_s: Shorter interruptions and contractions do not count, s.

    Returns:
        Onset and release of each contraction, s, shape ``(n_contractions, 2)``.
    """
    times = np.asarray(time_s, dtype=float)
    values = np.asarray(signal, dtype=float)
    on = values >= threshold
    before = np.flatnonzero(on[1:] != on[:-1])
    fraction = (threshold - values[before]) / (values[before + 1] - values[before])
    edges = (times[before] + fraction * (times[before + 1] - times[before])).tolist()
    started = [float(times[0])] if on.size and on[0] else []
    unended = [np.inf] if on.size and on[-1] else []
    onsets, releases = np.array([*started, *edges, *unended]).reshape(-1, 2).T
    apart = onsets[1:] - releases[:-1] >= shortest_s
    onsets, releases = onsets[np.append(True, apart)[: onsets.size]], releases[np.append(apart, True)[: releases.size]]
    seen_s = np.minimum(releases, times[-1] if times.size else 0.0) - onsets
    return np.stack([onsets, releases], axis=1)[seen_s >= shortest_s]


def stretches(on: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Returns from which sample up to which (not with it) a signal is on, without a break."""
    edges = np.flatnonzero(np.diff(on, prepend=False, append=False))
    return list(zip(edges[0::2].tolist(), edges[1::2].tolist(), strict=True))


def rhythm(time_s: ArrayLike, activation: ArrayLike) -> Rhythm:
    """Describes the rhythm of a run from times, s, ``(n_times,)``, and segments' activation, ``(n_times, n_segments)``.

    An onset in the first sampling interval belongs to the initial state: no interval that begins with one counts
    towards the period. A continued run, whose first sample is later than time zero, has no initial state: what is
    contracted there has begun before, and the wave may begin at any segment.
    """
    times = np.asarray(time_s, dtype=float)
    signals = np.asarray(activation, dtype=float)
    _, onsets, started = _onsets(times, signals)
    events, periods = _in_order(onsets), _intervals(onsets, started)
    order = [segment for _, segment in events]
    return Rhythm(
        order=order,
        onsets_s=[onset for onset, _ in events],
        period_s=float(periods.mean()) if periods.size else None,
        period_std_s=float(periods.std()) if periods.size > 1 else None,
        wave=is_wave(order, signals.shape[1], any_start=started == -np.inf),
        full_cycles=full_cycles(order, signals.shape[1]),
    )


def run_rhythm(run: Run) -> Rhythm:
    """Describes the rhythm in which a run's muscles are activated, without its score; empty without samples of it."""
    data = run.variables
    if "activation" not in data or not data["time"].values.size:
        return Rhythm()
    return rhythm(data["time"].values, segment_activation(data["activation"].values, run.config.body.n_segments))


def scored_rhythm(run: Run) -> Rhythm:
    """Describes the rhythm of a run with the score of the whole of it, where there is one."""
    found = run_rhythm(run)
    if "activation" not in run.variables or run.config.body.n_segments < LEAST_SEGMENTS:
        return found
    score = rhythm_score(run)
    return replace(found, rhythm_verdict=score.verdict, rhythm_reason=score.reason, rhythm_regularity=score.regularity)


def is_wave(order: Sequence[int], n_segments: int, any_start: bool = False) -> bool | None:
    """Whether an order of contraction is 1-2-..-N repeated, from 1 or from any segment on; None if too short."""
    start = order[0] - 1 if order and any_start else 0
    if any(segment != (start + i) % n_segments + 1 for i, segment in enumerate(order)):
        return False
    return True if len(order) >= n_segments else None


def full_cycles(order: Sequence[int], n_segments: int) -> int:
    """Counts the stretches of N successive onsets that run 1-2-..-N."""
    cycle = list(range(1, n_segments + 1))
    return sum(list(order[i : i + n_segments]) == cycle for i in range(len(order)))


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
    activation = segment_activation(run.variables["activation"].values, run.config.body.n_segments)
    return score(times, activation[judged], DESIGN_INTERVAL_S * gate_ms / _DESIGN_GATE_MS)


def lengthening_score(run: Run, after_s: float = 0.0) -> RhythmScore:
    """Scores the rhythm in which a worm's segments lengthen, whatever the activation of its muscles, as `score` does.

    A segment counts as contracted while its mean lengthening is at least half of its own largest, and not at all if
    that is below 5 mm.

    Args:
        run: As for `rhythm_score`.
        after_s: As for `rhythm_score`.

    Raises:
        ValueError: The run file holds no stretch sensors.
    """
    times, judged = _judged(run, "stretch_length", after_s)
    stretch, rest = (run.variables[name].values for name in ("stretch_length", "stretch_rest_length"))
    lengthening = (stretch - rest).mean(axis=2)[judged]
    largest = np.maximum(lengthening.max(axis=0, initial=0.0), 2.0 * LEAST_LENGTHENING_M)
    return score(times, lengthening / largest)


def _judged(run: Run, signal: str, after_s: float) -> tuple[Array, NDArray[np.bool_]]:
    """Times of the samples from one on, and which of all they are."""
    if signal not in run.variables:
        raise ValueError(f"{run.path} holds no {signal}")
    times = run.variables["time"].values
    judged = times >= after_s
    return times[judged], judged


def score(time_s: ArrayLike, activation: ArrayLike, interval_s: float = DESIGN_INTERVAL_S) -> RhythmScore:
    """Decides whether segments contract in order, and how regularly.

    **Onsets.** A segment is contracted while its activation is at least 0.5; interruptions, then contractions below 20
    ms do not count. An onset in the first sampling interval from time zero belongs to the initial state: it stands in
    the order and counts as a contraction, but no cycle begins with it. In a run whose first sample is later, what is
    contracted there has no onset.

    **Cycles and lags.** A cycle is the time from one onset of a segment to its next. The segments stand in a closed
    ring, 1-2-..-N-1. The lag of a segment behind the one before it is its onset's phase in that one's cycle, or one
    minus that one's phase in its own cycle; both count. ``regularity`` is ``|mean(exp(2 pi i lag))|`` over all lags.

    **Verdict**, the first that holds:

    1. silent: nothing has begun for longer than 2 expected intervals. Expected is the longest interval between any
       two successive onsets, and as long as no segment has gone through a cycle, no less than ``interval_s``.
    2. disordered: a cycle in which a neighbour in the ring does not contract exactly once.
    3. None, too short: a segment has not contracted twice, or a pair of neighbours has no lag; also of one segment.
    4. disordered: ``period_cv`` above 0.2; or lags of one pair with a mean resultant length below 0.5; or "regular but
       not a wave": the winding number W, the sum of the mean lags round the ring, is not in 1 .. N-1, or some segment
       is farther than 3/8 of a step of 1/N from its place in the even wave in which all lags are W/N.
    5. ordered.

    **Fronts.** W fronts that travel to the rear and N - W that travel forwards have the same onsets. The smaller number
    is taken, unless ``mean_contracted`` is within 0.25 of the larger, as where each contraction hands over to the next.
    So a wave 1-2-3 whose contractions last two thirds of the period is called two fronts forwards. With W = N/2 the
    direction is 0.

    Args:
        time_s: Sample times, s, rising, shape ``(n_times,)``.
        activation: Activation of each segment, in [0, 1], shape ``(n_times, n_segments)``.
        interval_s: Expected interval between successive onsets where the run shows none, s.
    """
    times = np.asarray(time_s, dtype=float)
    values = np.asarray(activation, dtype=float)
    n = values.shape[1]
    found, onsets, started = _onsets(times, values, SHORTEST_S)
    events, periods = _in_order(onsets), _intervals(onsets, started)
    judged = [of_segment[of_segment > started] for of_segment in onsets]
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
    elif n < LEAST_SEGMENTS:
        verdict, reason = None, "one segment has no order"
    elif pair := next((i + 1 for i, of_pair in enumerate(cycle_lags) if any(len(lag) != 1 for lag in of_pair)), 0):
        verdict, reason = "disordered", f"segments {pair} and {pair % n + 1} do not take turns"
    elif min(map(len, onsets)) < 2 or min(map(len, lags)) < 1:
        verdict, reason = None, "too short: fewer than two cycles"
    elif period_cv is not None and period_cv > MOST_PERIOD_CV:
        verdict, reason = "disordered", f"periods vary by {100 * period_cv:.0f} %"
    elif min(np.abs(_resultant(of_pair)) for of_pair in lags) < LEAST_CONCENTRATION:
        verdict, reason = "disordered", "lags between neighbours wander"
    else:
        mean_lags = [float(np.angle(_resultant(of_pair)) / (2 * np.pi) % 1.0) for of_pair in lags]
        winding = round(sum(mean_lags))
        # How far segments stray from the even wave, in steps of 1/N.
        excess = np.cumsum([0.0, *mean_lags[:-1]]) - np.arange(n) * winding / n
        if float(np.ptp(excess) / 2 * n) > WAVE_TOLERANCE or not 0 < winding < n:
            verdict, reason = "disordered", UNEVEN
        else:
            direction, fronts = _fronts(winding, n, mean_contracted)
            heading = {1: " from front to rear", -1: " from rear to front", 0: ""}[direction]
            verdict, reason = "ordered", f"a wave of {fronts} front{'' if fronts == 1 else 's'}{heading}"
    return RhythmScore(
        verdict=verdict,
        reason=reason,
        order=tuple(segment for _, segment in events),
        period_s=float(periods.mean()) if periods.size else None,
        period_cv=period_cv,
        regularity=float(np.abs(_resultant(pooled))) if pooled.size else None,
        direction=direction,
        wave_fronts=fronts,
        mean_contracted=mean_contracted,
        last_onset_s=events[-1][0] if events else None,
    )


def _onsets(times: Array, signals: Array, shortest_s: float = 0.0) -> tuple[list[Array], list[Array], float]:
    """Contractions and onsets of every segment, and until when onsets belong to the initial state.

    A continued run has no initial state (minus infinity); what is contracted at its first sample has no onset.
    """
    found = [contractions(times, one, shortest_s=shortest_s) for one in signals.T]
    if times.size and times[0] > 0:
        return found, [c[c[:, 0] > times[0], 0] for c in found], -np.inf
    return found, [c[:, 0] for c in found], float(times[min(1, times.size - 1)]) if times.size else 0.0


def _in_order(onsets_s: Sequence[Array]) -> list[tuple[float, int]]:
    """The onsets of all segments with the segment (from 1), by time; simultaneous ones by segment."""
    return sorted((float(onset), i + 1) for i, of_one in enumerate(onsets_s) for onset in of_one)


def _intervals(onsets_s: Sequence[Array], after_s: float) -> Array:
    """The intervals between successive onsets of the same segment that begin after ``after_s``, s."""
    return np.concatenate([np.empty(0), *(np.diff(onsets[onsets > after_s]) for onsets in onsets_s)])


def _lags(front: Array, rear: Array) -> list[Array]:
    """Lags of ``rear`` behind ``front``, an array for each cycle of either."""
    return [*_phases(front, rear), *(1.0 - phases for phases in _phases(rear, front))]


def _phases(cycles: Array, onsets: Array) -> list[Array]:
    return [(onsets[(onsets >= a) & (onsets < b)] - a) / (b - a) for a, b in pairwise(cycles)]


def _silence(times: Array, events: Sequence[tuple[float, int]], cycled: bool, interval_s: float) -> str:
    """Says since when nothing has begun; nothing while that is not long."""
    if not times.size:
        return ""
    longest = max((b - a for (a, _), (b, _) in pairwise(events)), default=0.0)
    expected = longest if cycled else max(longest, interval_s)
    last = events[-1][0] if events else times[0]
    if times[-1] - last <= SILENCE * expected:
        return ""
    return f"no contraction begins after {last:.2f} s" if events else "no contraction begins"


def _resultant(phases: Array) -> np.complex128:
    """Mean of unit vectors at these phases: its length says how concentrated they are, its angle is their mean."""
    return np.exp(2j * np.pi * phases).mean()


def _fronts(winding: int, n: int, mean_contracted: float) -> tuple[Literal[-1, 0, 1], int]:
    """Direction and number of fronts of a wave."""
    if 2 * winding == n:
        return 0, winding
    smaller, larger = sorted((winding, n - winding))
    fronts = larger if abs(mean_contracted - larger) <= COUNT_TOLERANCE else smaller
    return 1 if fronts == winding else -1, fronts

"""When which segment contracts: onsets, their order, the period and the wave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from annelid.protocols import Array

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

CONTRACTED = 0.5
"""Activation above which a muscle counts as contracted (half of its range)."""


@dataclass(frozen=True, slots=True)
class Rhythm:
    """The rhythm of a run.

    Attributes:
        order: Segments (counted from 1) in the order of their contractions.
        onsets_s: Time of each contraction's onset, s, aligned with ``order``.
        period_s: Mean interval between successive onsets of the same segment, s; None if none repeats.
        period_std_s: Standard deviation of those intervals, s; None with fewer than two of them.
        wave: Whether the order is 1-2-..-N over and over; None while it is, but for less than one cycle.
        full_cycles: How many times N successive onsets ran 1-2-..-N.
    """

    order: tuple[int, ...]
    onsets_s: tuple[float, ...]
    period_s: float | None
    period_std_s: float | None
    wave: bool | None
    full_cycles: int


def segment_activation(activation: ArrayLike, n_segments: int) -> Array:
    """Averages activation over each segment's muscles (one ring, or a left and a right half).

    Args:
        activation: Shape ``(n_times, n_muscles)``, muscles segment by segment.
        n_segments: Number of segments, a divisor of ``n_muscles``.

    Returns:
        Shape ``(n_times, n_segments)``.
    """
    values = np.asarray(activation, dtype=float)
    return values.reshape(len(values), n_segments, values.shape[1] // n_segments).mean(axis=2)


def contractions(time_s: ArrayLike, signal: ArrayLike, threshold: float = CONTRACTED, shortest_s: float = 0.0) -> Array:
    """Finds from when to when one signal is at or above a threshold, interpolating linearly between samples.

    Args:
        time_s: Sample times, s, rising, shape ``(n_times,)``.
        signal: Same shape.
        threshold: In the signal's unit.
        shortest_s: Interruptions shorter than this are bridged, then contractions shorter than this left out, s.

    Returns:
        Onset and release of each contraction, s, shape ``(n_contractions, 2)``. What is contracted at the first
        sample begins there; what is contracted at the last ends at infinity, and is as long as was seen of it.
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


def is_continued(time_s: ArrayLike) -> bool:
    """Tells a run that continues another, whose first sample is later than time zero."""
    return bool(np.size(time_s)) and bool(np.asarray(time_s)[0] > 0)


def startup_end(time_s: ArrayLike) -> float:
    """Returns until when onsets belong to the initial state, s: the first sampling interval, minus infinity without."""
    times = np.asarray(time_s, dtype=float)
    if is_continued(times):
        return -np.inf
    return float(times[min(1, times.size - 1)]) if times.size else 0.0


def in_order(onsets_s: Sequence[Array]) -> list[tuple[float, int]]:
    """Returns the onsets of all segments with the segment (from 1), by time; simultaneous ones by segment."""
    return sorted((float(onset), i + 1) for i, of_one in enumerate(onsets_s) for onset in of_one)


def segment_intervals(onsets_s: Sequence[Array], after_s: float) -> Array:
    """Returns the intervals between successive onsets of the same segment that begin after ``after_s``, s."""
    return np.concatenate([np.empty(0), *(np.diff(onsets[onsets > after_s]) for onsets in onsets_s)])


def rhythm(time_s: ArrayLike, activation: ArrayLike) -> Rhythm:
    """Describes the rhythm of a run.

    An onset in the first sampling interval of a run belongs to the initial state, not to the rhythm: no interval
    that begins with one counts towards the period. A continued run, whose first sample is later than time zero,
    has no initial state: what is contracted there has begun before, and the wave may begin at any segment.

    Args:
        time_s: Sample times, s, shape ``(n_times,)``.
        activation: Activation of each segment, in [0, 1], shape ``(n_times, n_segments)``.
    """
    times = np.asarray(time_s, dtype=float)
    signals = np.asarray(activation, dtype=float).T
    continued = is_continued(times)
    onsets = [contractions(times, one)[int(continued and one[0] >= CONTRACTED) :, 0] for one in signals]
    events = in_order(onsets)
    order = tuple(segment for _, segment in events)
    periods = segment_intervals(onsets, startup_end(times))
    return Rhythm(
        order=order,
        onsets_s=tuple(onset for onset, _ in events),
        period_s=float(periods.mean()) if periods.size else None,
        period_std_s=float(periods.std()) if periods.size > 1 else None,
        wave=is_wave(order, len(signals), any_start=continued),
        full_cycles=full_cycles(order, len(signals)),
    )


def run_rhythm(run: Run) -> Rhythm | None:
    """Describes the rhythm in which a run's muscles are activated; None without samples of activation."""
    data = run.data
    if "activation" not in data or not data.sizes.get("time"):
        return None
    return rhythm(data["time"].values, segment_activation(data["activation"].values, run.config.body.n_segments))


def is_wave(order: tuple[int, ...], n_segments: int, any_start: bool = False) -> bool | None:
    """Tells whether an order of contraction is 1-2-..-N repeated; None where it is too short to tell.

    Args:
        order: Segments (counted from 1) in the order of their contractions.
        n_segments: Number of segments.
        any_start: The order may begin within a cycle, as that of a continued run does.
    """
    start = order[0] - 1 if order and any_start else 0
    if any(segment != (start + i) % n_segments + 1 for i, segment in enumerate(order)):
        return False
    return True if len(order) >= n_segments else None


def full_cycles(order: tuple[int, ...], n_segments: int) -> int:
    """Counts the stretches of N successive onsets that run 1-2-..-N."""
    cycle = tuple(range(1, n_segments + 1))
    return sum(order[i : i + n_segments] == cycle for i in range(len(order)))

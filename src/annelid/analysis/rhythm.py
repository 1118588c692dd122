"""When which segment contracts: onsets, their order, the period and the wave."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

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


def segment_activation(activation: ArrayLike, n_segments: int) -> NDArray[np.float64]:
    """Averages activation over each segment's muscles (one ring, or a left and a right half).

    Args:
        activation: Shape ``(n_times, n_muscles)``, muscles segment by segment.
        n_segments: Number of segments, a divisor of ``n_muscles``.

    Returns:
        Shape ``(n_times, n_segments)``.
    """
    values = np.asarray(activation, dtype=float)
    return values.reshape(len(values), n_segments, -1).mean(axis=2)


def onset_times(time_s: ArrayLike, signal: ArrayLike, threshold: float = CONTRACTED) -> list[float]:
    """Finds when one signal rises through a threshold, interpolating linearly between samples.

    Args:
        time_s: Sample times, s, rising, shape ``(n_times,)``.
        signal: Same shape. A signal at or above the threshold at the first sample has an onset there.
        threshold: In the signal's unit.

    Returns:
        Onset times, s, rising.
    """
    times = np.asarray(time_s, dtype=float)
    values = np.asarray(signal, dtype=float)
    rising = np.flatnonzero((values[:-1] < threshold) & (values[1:] >= threshold))
    fraction = (threshold - values[rising]) / (values[rising + 1] - values[rising])
    onsets = times[rising] + fraction * (times[rising + 1] - times[rising])
    started = [float(times[0])] if len(values) and values[0] >= threshold else []
    return started + onsets.tolist()


def rhythm(time_s: ArrayLike, activation: ArrayLike) -> Rhythm:
    """Describes the rhythm of a run.

    An onset in the first sampling interval of a run belongs to the initial state, not to the rhythm: no interval
    that begins with one counts towards the period. A continued run, whose first sample is later than time zero,
    has no initial state: what is contracted there has begun before, and the wave may begin at any segment.

    Args:
        time_s: Sample times, s, shape ``(n_times,)``.
        activation: Activation of each segment, in [0, 1], shape ``(n_times, n_segments)``.

    Returns:
        The rhythm. Simultaneous onsets are ordered by segment.
    """
    times = np.asarray(time_s, dtype=float)
    values = np.asarray(activation, dtype=float)
    n_segments = values.shape[1]
    continued = bool(len(times)) and times[0] > 0
    by_segment = [
        onset_times(times, values[:, i])[int(continued and values[0, i] >= CONTRACTED) :] for i in range(n_segments)
    ]
    events = sorted((onset, i + 1) for i, onsets in enumerate(by_segment) for onset in onsets)
    order = tuple(segment for _, segment in events)
    start_ends_s = times[min(1, len(times) - 1)] if len(times) else 0.0
    periods = [b - a for onsets in by_segment for a, b in pairwise(onsets) if continued or a > start_ends_s]
    return Rhythm(
        order=order,
        onsets_s=tuple(onset for onset, _ in events),
        period_s=float(np.mean(periods)) if periods else None,
        period_std_s=float(np.std(periods)) if len(periods) > 1 else None,
        wave=is_wave(order, n_segments, any_start=continued),
        full_cycles=full_cycles(order, n_segments),
    )


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

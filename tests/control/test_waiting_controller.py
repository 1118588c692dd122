"""The network that waits for rest, on a body whose lengths lag behind."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from circuits import controller, felt

from annelid.control import CircuitController
from annelid.protocols import Array

LONGEST_M, TOLERANCE_M, LAG_S = 0.06, 0.006, 0.06
SENSOR = {"tolerance_m": TOLERANCE_M, "startup_hold_s": 0.2}
Onset = tuple[float, int, Array]
"""Time of a contraction's begin, s, the segment, and all segments' lengthening then, m."""


def waiting(n_segments: int = 4, **network: float) -> CircuitController:
    return controller("sns-waiting", n_segments, sensor=SENSOR, network=network)


def crawl(
    one: CircuitController,
    longest_m: Sequence[float],
    lag_s: float | Sequence[float] = LAG_S,
    duration_s: float = 10.0,
) -> tuple[list[Onset], Array]:
    """Onsets on a body whose lengths follow activation with a lag, and all activations, ``(n_steps, n_segments)``."""
    longer = np.zeros(len(longest_m))
    onsets: list[Onset] = []
    trace = np.zeros((round(duration_s / 0.001), len(longest_m)))
    one.reset(0)
    for step in range(len(trace)):
        trace[step] = one.step(felt(longer, 0.001 * step))
        before = trace[step - 1] if step else np.zeros_like(longer)
        begun = np.flatnonzero((trace[step] > 0.5) & (before <= 0.5))
        onsets += [(0.001 * step, int(segment), longer.copy()) for segment in begun]
        longer += 0.001 / np.asarray(lag_s) * (np.asarray(longest_m) * trace[step] - longer)
    return onsets, trace


def left_m(onsets: Sequence[Onset]) -> Array:
    """By how much the segment that contracted before is longer than at rest at each onset but the first, m."""
    return np.array([longer[before] for (_, before, _), (_, _, longer) in pairwise(onsets)])


def order(onsets: Sequence[Onset]) -> list[int]:
    return [segment for _, segment, _ in onsets]


@pytest.mark.parametrize(("n_segments", "lag_s"), [(3, 0.03), (4, 0.06), (6, 0.1)])
def test_a_segment_contracts_once_the_one_before_is_back_at_rest(n_segments: int, lag_s: float) -> None:
    onsets, _ = crawl(waiting(n_segments), [LONGEST_M] * n_segments, lag_s)
    assert order(onsets) == [k % n_segments for k in range(len(onsets))]
    assert len(onsets) > 8
    assert np.all(left_m(onsets) <= TOLERANCE_M)
    # From the sensor to the contraction some 25 ms go by. At the start segment 1's sensor is held off for longer.
    assert np.all(left_m(onsets)[1:] > TOLERANCE_M * np.exp(-0.04 / lag_s))


@pytest.mark.parametrize("stuck", [[1], [2, 3], [0, 1, 2, 3]])
def test_a_segment_that_never_leaves_rest_has_its_turn_and_passes_the_wave_on(stuck: list[int]) -> None:
    longest = [0.0 if segment in stuck else LONGEST_M for segment in range(4)]
    onsets, trace = crawl(waiting(), longest)
    assert order(onsets) == [k % 4 for k in range(len(onsets))]
    assert len(onsets) > 8
    ended_s = 0.001 * (1.0 + np.flatnonzero(((trace[1:] <= 0.5) & (trace[:-1] > 0.5)).any(axis=1)))
    lasted_s = np.array([end - onset for end, (onset, _, _) in zip(ended_s, onsets, strict=False)])[1:]
    assert lasted_s == pytest.approx(0.8, rel=0.1), "as long as the half-centre has it"


def test_a_segment_that_is_not_back_in_time_contracts_again() -> None:
    onsets, _ = crawl(waiting(), [LONGEST_M] * 4, [LAG_S, 0.6, LAG_S, LAG_S])
    assert len(onsets) > 5
    assert order(onsets) == [0, *[1] * (len(onsets) - 1)]

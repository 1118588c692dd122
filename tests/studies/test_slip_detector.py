"""The slip detector, against worms whose segments move over the ground at known speeds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.protocols import SIDES, Array, Sensation
from annelid_studies.slip_detector.detector import SPRINGS_PER_SEGMENT, SlipDetector, ground_speed, weighted_median

N = 5
RATES = st.lists(st.floats(-0.2, 0.2), min_size=N, max_size=N).map(np.array)


def felt(time_s: float, longer_m: Array, load_N: Array) -> Sensation:
    rest, nothing = np.full((N, 2), 0.075), np.zeros(0)
    touch = np.repeat(load_N[:, None] / len(SIDES), len(SIDES), axis=1)
    return Sensation(time_s, rest + longer_m[:, None], rest, nothing, nothing, nothing, nothing, touch)


@given(rates=RATES, anchor=st.integers(0, N - 1))
def test_a_segment_that_bears_most_of_the_weight_stands_still(rates: Array, anchor: int) -> None:
    load = np.full(N, 0.1)
    load[anchor] = 5.0
    assert ground_speed(rates, load)[anchor] == pytest.approx(0.0, abs=1e-12)


@given(rates=RATES, load=st.lists(st.floats(0.01, 10.0), min_size=N, max_size=N).map(np.array))
def test_friction_forwards_and_backwards_balance_and_segments_part_as_they_lengthen(rates: Array, load: Array) -> None:
    speed = ground_speed(rates, load)
    assert load[speed > 1e-9].sum() <= 0.5 * load.sum() + 1e-9
    assert load[speed < -1e-9].sum() <= 0.5 * load.sum() + 1e-9
    inner = 0.5 * (rates[1:-2] + rates[2:-1])
    assert speed[1:-2] - speed[2:-1] == pytest.approx(inner, abs=1e-12)
    # From tip to ring of its neighbour: its own outer half, and half of either.
    assert speed[0] - speed[1] == pytest.approx(rates[0] + 0.5 * rates[1], abs=1e-12)
    assert speed[-2] - speed[-1] == pytest.approx(rates[-1] + 0.5 * rates[-2], abs=1e-12)


@given(rates=RATES, load=st.lists(st.floats(0.01, 10.0), min_size=N, max_size=N).map(np.array))
def test_a_worm_that_is_turned_round_slips_the_other_way(rates: Array, load: Array) -> None:
    forth, back = ground_speed(rates, load), ground_speed(rates[::-1], load[::-1])[::-1]
    # Where half of the weight is on either side, the ground may be anywhere in between.
    shares = np.sort(load[np.argsort(forth)].cumsum() / load.sum())
    if np.abs(shares - 0.5).min() > 1e-6:
        assert forth == pytest.approx(-back, abs=1e-9)


def test_the_weighted_median_is_the_median_of_equal_weights() -> None:
    values = np.array([3.0, -1.0, 7.0, 2.0, 0.0])
    assert weighted_median(values, np.full(5, 2.0)) == 2.0
    assert weighted_median(values, np.array([0.0, 0.0, 1.0, 0.0, 0.0])) == 7.0
    assert weighted_median(values, np.zeros(5)) == pytest.approx(2.2)


def read(speed_m_per_s: float, load_front_N: float, seconds: float = 0.5) -> tuple[np.ndarray, SlipDetector]:
    """Segment 2 lengthens evenly, while the rear stands; returns the last reading."""
    detector = SlipDetector(N)
    load = np.array([load_front_N, 0.0, 8.0, 8.0, 8.0])
    told = np.zeros(N, dtype=bool)
    for i in range(round(seconds / 0.01)):
        longer = np.zeros(N)
        longer[1] = speed_m_per_s * 0.01 * i / SPRINGS_PER_SEGMENT
        told = detector.read(felt(0.01 * i, longer, load))
    return told, detector


def test_a_dragged_front_is_told_and_one_in_the_air_is_not() -> None:
    told, detector = read(0.4, 3.0)
    assert told.tolist() == [True, False, False, False, False]
    assert detector.speed_m_per_s[0] == pytest.approx(0.4, rel=0.01)
    assert detector.speed_m_per_s[3:] == pytest.approx(np.zeros(2), abs=1e-12)
    told, _ = read(0.4, 0.0)
    assert not told.any()
    told, _ = read(0.05, 3.0)
    assert not told.any(), "below the limit"


def test_the_first_reading_and_one_at_the_same_time_tell_nothing() -> None:
    detector = SlipDetector(N)
    load = np.full(N, 4.0)
    assert not detector.read(felt(0.0, np.zeros(N), load)).any()
    assert not detector.read(felt(0.0, np.array([0.1, 0, 0, 0, 0]), load)).any()
    detector.read(felt(0.01, np.array([0.2, 0, 0, 0, 0]), load))
    assert np.abs(detector.speed_m_per_s).max() > 0
    detector.reset()
    assert not detector.speed_m_per_s.any()

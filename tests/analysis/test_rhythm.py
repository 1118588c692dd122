from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis.rhythm import full_cycles, is_wave, rhythm, score
from synthetic import wave_activation


@given(
    n_segments=st.integers(3, 12),
    period_s=st.floats(0.9, 6.0),
    start_s=st.floats(0.05, 1.0),
    cycles=st.integers(2, 4),
)
def test_a_shifted_and_scaled_wave_gives_its_period_order_and_cycles(
    n_segments: int, period_s: float, start_s: float, cycles: int
) -> None:
    share_s = period_s / n_segments
    interval_s = 0.0005
    end_s = start_s + cycles * period_s - 0.5 * share_s
    time = np.arange(0.0, end_s, interval_s)
    activation = wave_activation(time, n_segments, period_s, start_s, rise_s=0.02)
    found, scored = rhythm(time, activation), score(time, activation)
    assert (scored.verdict, scored.direction, scored.wave_fronts) == ("ordered", 1, 1)
    assert (list(scored.order), scored.period_s) == (found.order, found.period_s)
    assert scored.regularity == pytest.approx(1.0, abs=1e-6)
    onsets = start_s + share_s * np.arange(cycles * n_segments)
    assert found.order == list(range(1, n_segments + 1)) * cycles
    np.testing.assert_allclose(found.onsets_s, onsets, atol=1e-9)
    assert found.period_s == pytest.approx(period_s, abs=1e-9)
    assert found.period_std_s == pytest.approx(0.0, abs=1e-9)
    assert found.wave is True
    assert found.full_cycles == cycles


def pulses(time: np.ndarray, *onsets: float) -> np.ndarray:
    """Contracted for half a second from each onset on."""
    return sum((((time >= t) & (time < t + 0.5)).astype(float) for t in onsets), np.zeros_like(time))


def test_an_interval_that_begins_with_the_initial_state_never_counts() -> None:
    time = np.linspace(0.0, 10.0, 10_001)
    found = rhythm(time, np.stack([pulses(time, 0.0, 1.0, 4.0), pulses(time, 2.0), pulses(time, 3.0)], axis=1))
    assert found.period_s == pytest.approx(3.0, abs=1e-3)
    alone = rhythm(time, np.stack([pulses(time, 0.0, 2.4), pulses(time, 1.0), pulses(time, 1.7)], axis=1))
    assert (alone.period_s, alone.period_std_s) == (None, None)


def test_a_continued_run_has_no_initial_state() -> None:
    """What is contracted at its first sample began before; the wave may begin at any segment."""
    time = np.linspace(5.6, 15.6, 10_001)
    activation = np.stack([pulses(time, 5.0, 8.0, 11.0, 14.0), pulses(time, 6.0, 9.0), pulses(time, 7.0, 10.0)], axis=1)
    activation[0, 0] = activation[1, 0] = 1.0
    found = rhythm(time, activation)
    assert found.order[:4] == [2, 3, 1, 2]
    assert found.period_s == pytest.approx(3.0, abs=1e-3)
    assert rhythm(time[:6000], activation[:6000]).wave is True


def test_first_activation_recorded_one_sample_late_is_still_the_initial_state() -> None:
    # A file whose first sample was taken before the controller acted.
    time = np.linspace(0.0, 10.0, 2001)
    first = pulses(time, 0.0, 1.0, 4.0)
    first[0] = 0.0
    found = rhythm(time, np.stack([first, pulses(time, 2.0), pulses(time, 3.0)], axis=1))
    assert found.onsets_s[0] == pytest.approx(0.0025)
    assert found.period_s == pytest.approx(3.0, abs=1e-9)


def test_a_silent_worm_has_no_rhythm() -> None:
    found = rhythm(np.arange(10) * 0.1, np.zeros((10, 3)))
    assert (found.order, found.onsets_s, found.period_s, found.wave, found.full_cycles) == ([], [], None, None, 0)


def test_wave_and_cycles_of_an_order(subtests: pytest.Subtests) -> None:
    for order, wave, cycles in (
        ((1, 2, 3, 1, 2, 3), True, 2),
        ((1, 2, 3, 1, 2), True, 1),
        ((1, 2), None, 0),
        ((2, 3, 1, 2, 3), False, 1),
        ((1, 3, 2, 1, 3, 2), False, 0),
        ((1, 2, 3, 3, 1, 2, 3), False, 2),
    ):
        with subtests.test(f"{order!r:.60}"):
            assert is_wave(order, 3) is wave
            assert full_cycles(order, 3) == cycles

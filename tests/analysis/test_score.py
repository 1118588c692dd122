"""The score of rhythms whose answer is known: even waves, silence, stalls, faults and noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from annelid.analysis import RhythmScore, lengthening_score, rhythm_score
from annelid.analysis.rhythm import contractions, rhythm, score
from annelid.config import load_config
from annelid.simulation import Run
from synthetic import wave_activation, wave_data

INTERVAL_S = 0.005


def pulses(time: np.ndarray, onsets: np.ndarray | list[float], length_s: float) -> np.ndarray:
    """Contracted for ``length_s`` from each onset on."""
    begin = np.asarray(onsets, dtype=float)[:, None]
    return ((time >= begin) & (time < begin + length_s)).any(axis=0).astype(float)


def places(order: tuple[int, ...]) -> np.ndarray:
    """Phase of each segment's onset where segments contract in this order at even intervals."""
    return np.argsort(order) / len(order)


def train(
    phases: np.ndarray,
    period_s: float,
    *,
    duty: float = 0.3,
    cycles: int = 4,
    start_s: float = 0.1,
    jitter: float = 0.0,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Each segment contracts once a period at its phase; ``jitter`` is the standard deviation in periods."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, start_s + cycles * period_s, INTERVAL_S)
    stray = jitter * rng.standard_normal((len(phases), cycles))
    onsets = start_s + period_s * (phases[:, None] + np.arange(cycles) + stray)
    return time, np.stack([pulses(time, of_segment, duty * period_s) for of_segment in onsets], axis=1)


def wave_phases(n: int, fronts: int, direction: int) -> np.ndarray:
    return (np.arange(n) * direction * fronts / n) % 1.0


@settings(max_examples=60)
@given(
    n=st.integers(3, 12),
    fronts=st.integers(1, 5),
    direction=st.sampled_from([-1, 1]),
    period_s=st.floats(1.0, 6.0),
    jitter=st.floats(0.0, 0.05),
    seed=st.integers(0, 99),
)
def test_an_even_wave_gives_its_fronts_direction_and_period(
    n: int, fronts: int, direction: int, period_s: float, jitter: float, seed: int
) -> None:
    assume(2 * fronts < n)
    # Far less than a step of 1/N, so that the true answer stays the same.
    signals = train(
        wave_phases(n, fronts, direction), period_s, duty=fronts / n, cycles=5, jitter=jitter / n, seed=seed
    )
    found = score(*signals)
    assert (found.verdict, found.wave_fronts, found.direction) == ("ordered", fronts, direction)
    assert found.period_s == pytest.approx(period_s, rel=3 * jitter / n + 0.02)
    assert found.period_cv is not None
    assert found.period_cv < 3 * jitter / n + 0.01
    assert found.regularity is not None
    assert found.regularity > 0.9
    assert found.mean_contracted == pytest.approx(fronts, rel=0.15)


def test_the_number_of_contracted_segments_tells_many_fronts_from_few_the_other_way(subtests: pytest.Subtests) -> None:
    """The same onsets, once handed over to the rear, once to the front."""
    for n, fronts in ((3, 2), (4, 3), (5, 3), (6, 5)):
        with subtests.test(f"{n!r:.60}"):
            phases = wave_phases(n, fronts, 1)
            many = score(*train(phases, 2.0, duty=fronts / n, cycles=8))
            few = score(*train(phases, 2.0, duty=(n - fronts) / n, cycles=8))
            assert many.order == few.order
            assert (many.direction, many.wave_fronts) == (1, fronts)
            assert (few.direction, few.wave_fronts) == (-1, n - fronts)


@pytest.mark.parametrize(("n", "fronts"), [(4, 2), (6, 3)])
def test_a_wave_of_half_as_many_fronts_as_segments_has_no_direction(n: int, fronts: int) -> None:
    found = score(*train(wave_phases(n, fronts, 1), 2.0, duty=0.4))
    assert (found.verdict, found.direction, found.wave_fronts) == ("ordered", 0, fronts)


def test_a_regular_order_that_is_no_wave(subtests: pytest.Subtests) -> None:
    for order in ((1, 3, 2, 4), (1, 2, 4, 3, 5), (1, 2, 3, 5, 4, 6), (1, 4, 2, 5, 3, 6, 7)):
        with subtests.test(f"{order!r:.60}"):
            found = score(*train(places(order), 3.0, duty=1 / len(order)))
            assert found.order[: len(order)] == order
            assert (found.verdict, found.reason) == ("disordered", "regular but not a wave")
            assert (found.direction, found.wave_fronts) == (0, None)
            assert found.period_cv == pytest.approx(0.0, abs=0.01)
            assert found.regularity is not None
            assert found.regularity < 0.95


@settings(max_examples=30)
@given(n=st.integers(3, 8), when=st.floats(0.3, 0.8), extra=st.integers(0, 7))
def test_silence_is_seen_whenever_it_begins(n: int, when: float, extra: int) -> None:
    period_s, duration_s = 0.6 * n, 40.0
    time = np.arange(0.0, duration_s, INTERVAL_S)
    activation = wave_activation(time, n, period_s, 0.2)
    activation[time > when * duration_s] = 0.0
    found = score(time, activation)
    assert found.verdict == "silent"
    assert found.last_onset_s is not None
    assert when * duration_s - 0.6 - 0.02 <= found.last_onset_s <= when * duration_s
    assert found.reason == f"no contraction begins after {found.last_onset_s:.2f} s"
    assert found.wave_fronts is None
    # Over twice the interval is silence, under it is a pause.
    for wait_s, verdict in ((1.1, "ordered"), (1.3, "silent")):
        part = time <= found.last_onset_s + wait_s
        assert score(time[part], activation[part]).verdict == verdict


def test_a_segment_that_never_lets_go_is_a_stall() -> None:
    time = np.arange(0.0, 12.0, INTERVAL_S)
    activation = wave_activation(time, 3, 2.4)
    hold = time >= 5.7  # segment 2's third contraction has begun at 5.6 s
    activation[hold] = (0.0, 1.0, 0.0)
    found = score(time, activation)
    assert (found.verdict, found.reason) == ("silent", "stalled: segment 2 stays contracted")
    assert found.last_onset_s == pytest.approx(5.6)
    both = np.tile([0.0, 1.0, 1.0], (len(time), 1))
    assert score(time, both).reason == "stalled: segments 2, 3 stay contracted"


def test_a_run_without_any_contraction_is_silent_after_twice_the_design_interval() -> None:
    for duration_s, interval_s, verdict in ((1.7, 0.875, None), (1.8, 0.875, "silent"), (1.8, 1.75, None)):
        time = np.arange(0.0, duration_s, INTERVAL_S)
        found = score(time, np.zeros((len(time), 3)), interval_s)
        assert found.verdict == verdict
        assert found == RhythmScore(found.verdict, found.reason, (), None, None, None, 0, None, 0.0, None)


def test_too_short_a_run_gets_no_verdict() -> None:
    time = np.arange(0.0, 5.0, INTERVAL_S)
    activation = wave_activation(time, 3, 2.625)
    # 1 at 0, 2 at 0.875, .., 3 at 4.375 s: two cycles, with the initial contraction of segment 1.
    whole = score(time, activation)
    assert whole.verdict == "ordered"
    assert whole.period_s == pytest.approx(2.625)
    short = score(time[time < 4.3], activation[time < 4.3])
    assert (short.verdict, short.reason) == (None, "too short: fewer than two cycles")
    empty = score([], np.empty((0, 3)))
    assert (empty.verdict, empty.last_onset_s, empty.mean_contracted) == (None, None, 0.0)


def test_a_double_contraction_is_disorder() -> None:
    time, activation = train(wave_phases(4, 1, 1), 2.0, duty=0.1, cycles=5)
    assert score(time, activation).verdict == "ordered"
    activation[:, 2] += pulses(time, [0.1 + 2.0 * 3 + 1.3], 0.1)
    found = score(time, activation)
    assert (found.verdict, found.reason) == ("disordered", "segments 2 and 3 do not take turns")


def test_a_segment_that_misses_a_turn_or_never_contracts_is_disorder() -> None:
    time, activation = train(wave_phases(5, 1, 1), 2.0, cycles=5)
    missing, lame = activation.copy(), activation.copy()
    missing[(time > 3.5) & (time < 5.5), 4] = 0.0
    lame[:, 1] = 0.0
    assert score(time, missing).reason == "segments 4 and 5 do not take turns"
    assert score(time, lame).reason == "segments 1 and 2 do not take turns"


def test_uneven_periods_are_disorder() -> None:
    time = np.arange(0.0, 18.5, INTERVAL_S)
    begin = np.array([0.5, 1.5, 4.0, 5.0, 7.5, 8.5, 11.0, 12.0, 14.5, 15.5, 18.0])
    length = np.diff(begin)
    onsets = [begin[:-1] + length * i / 3 for i in range(3)]
    found = score(time, np.stack([pulses(time, of_segment, 0.2) for of_segment in onsets], axis=1))
    assert found.verdict == "disordered"
    assert found.reason.startswith("periods vary by")
    assert found.period_cv is not None
    assert found.period_cv > 0.2


def test_wandering_lags_are_disorder() -> None:
    """Neighbours take turns, but 2 and 4 wander through the whole of the cycle of 1 and 3 and back."""
    count = np.arange(24)
    shift = 0.5 - 0.45 * np.cos(2 * np.pi * count / 24)
    odd, even = 0.2 + 2.0 * count, 0.2 + 2.0 * (count + shift)
    time = np.arange(0.0, 48.0, INTERVAL_S)
    found = score(time, np.stack([pulses(time, of_segment, 0.05) for of_segment in (odd, even, odd, even)], axis=1))
    assert (found.verdict, found.reason) == ("disordered", "lags between neighbours wander")
    assert found.regularity is not None
    assert found.regularity < 0.5


@settings(max_examples=25)
@given(seed=st.integers(0, 999), n=st.integers(3, 6))
def test_flicker_round_the_threshold_makes_no_onsets(seed: int, n: int) -> None:
    """Slow ramps under noise cross the threshold many times; spikes of 15 ms do so anywhere."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 6.0 * n, 0.001)
    clean = wave_activation(time, n, 1.0 * n, 0.5, rise_s=0.1)
    noisy = clean + rng.normal(0.0, 0.04, clean.shape)
    for spike in np.arange(0.95, 6.0 * n - 0.5, 0.47):
        at = (time >= spike) & (time < spike + 0.015)
        noisy[at] = 1.0 - np.round(clean[at])
    quiet, loud = score(time, clean), score(time, noisy)
    assert rhythm(time, noisy).order != quiet.order
    assert (loud.verdict, loud.order, loud.wave_fronts) == ("ordered", quiet.order, 1)
    assert loud.period_s == pytest.approx(quiet.period_s, abs=0.03)


def test_interruptions_are_bridged_before_short_contractions_are_left_out() -> None:
    time = np.arange(0.0, 1.0, 0.001)
    on = pulses(time, [0.1, 0.13, 0.3, 0.6005, 0.99], 0.015) + pulses(time, [0.7], 0.2)
    found = contractions(time, on, shortest_s=0.02)
    np.testing.assert_allclose(found, [[0.1, 0.145], [0.7, 0.9]], atol=1e-3)
    assert len(contractions(time, on)) == 6


def test_a_continued_run_is_judged_from_any_segment_on() -> None:
    time = np.arange(0.0, 20.0, INTERVAL_S)
    activation = wave_activation(time, 4, 3.0, 0.2)
    late = time > 4.0
    found = score(time[late], activation[late])
    assert (found.verdict, found.order[:4], found.wave_fronts) == ("ordered", (3, 4, 1, 2), 1)
    assert found.period_s == pytest.approx(3.0)


def run_of(data: Any, **overrides: Any) -> Run:
    path = Path("run.nc")
    return Run(path, {}, {}, load_config("riddle2023-rods", overrides), "complete", "").with_data(data)


def test_half_rings_count_as_their_segment() -> None:
    data = wave_data(n_segments=3, period_s=2.4, duration_s=8.0)
    halves = data.drop_vars(["ring_length", "muscle_force", "activation"])
    whole = data["activation"].values
    halves["activation"] = (("time", "muscle"), whole.repeat(2, axis=1))
    assert rhythm_score(run_of(halves)) == rhythm_score(run_of(data)) == score(data["time"].values, whole)


def test_the_gate_time_constant_scales_the_wait_for_silence() -> None:
    data = wave_data(duration_s=1.0)
    data["activation"][:] = 0.0
    assert rhythm_score(run_of(data)).verdict is None
    assert rhythm_score(run_of(data, **{"controller.gate_time_constant_ms": 100.0})).verdict == "silent"


def test_what_comes_before_can_be_left_out() -> None:
    data = wave_data(period_s=1.8, duration_s=16.0)
    data["activation"][:800] = np.random.default_rng(1).random((800, 3))
    assert rhythm_score(run_of(data)).verdict == "disordered"
    after = rhythm_score(run_of(data), after_s=4.5)
    assert (after.verdict, after.wave_fronts, after.period_s) == ("ordered", 1, pytest.approx(1.8))
    assert rhythm_score(run_of(data), after_s=99.0).verdict is None
    assert rhythm_score(run_of(data.isel(time=slice(0)))).verdict is None
    with pytest.raises(ValueError, match="holds no activation"):
        rhythm_score(run_of(data.drop_vars("activation")))
    with pytest.raises(ValueError, match="holds no stretch_length"):
        lengthening_score(run_of(data.drop_vars("stretch_length")))


def lengthened(peaks_m: list[float]) -> RhythmScore:
    """The score of segments that lengthen up to these lengths in an even wave 1-2-3, and swing a little between."""
    time = np.arange(0.0, 8.0, 0.01)
    onsets = [np.arange(0.1 + place / 3 * 2.625, 8.0, 2.625) for place in range(3)]
    swing = 0.2 * np.sin(2 * np.pi * 4.0 * time)
    stretch = np.stack([p * (pulses(time, o, 0.8) + swing) for p, o in zip(peaks_m, onsets, strict=True)], axis=1)
    data = wave_data(duration_s=float(time[-1]), interval_s=0.01)
    data = data.assign(stretch_length=xr.DataArray(stretch, dims=("time", "segment")) + data["stretch_rest_length"])
    return lengthening_score(run_of(data))


def test_lengthening_is_scored_whatever_its_size() -> None:
    found = lengthened([0.08, 0.01, 0.03])
    assert (found.verdict, found.direction, found.wave_fronts) == ("ordered", 1, 1)
    assert found.period_s == pytest.approx(2.625, rel=0.02)


def test_a_segment_that_hardly_lengthens_has_no_part_in_the_wave() -> None:
    assert lengthened([0.08, 0.002, 0.08]).verdict != "ordered"

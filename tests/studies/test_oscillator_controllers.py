"""Oscillators as worm controllers: patterns, feedback, state, and runs from beginning to end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis import rhythm_score
from annelid.config import RunConfig, load_config
from annelid.control import OpenLoopController
from annelid.control.open_loop import SineWave, TimedWave
from annelid.errors import ConfigError
from annelid.protocols import Controller, Records, Sensation, Stateful
from annelid.simulation import build_plant, simulate
from annelid_studies.oscillators import HeteroclinicController, PhaseChainController
from annelid_studies.oscillators.controllers import HeteroclinicChannel, PhaseChain

KINDS = ("sine", "timed", "shc", "phase-chain")


def at(time_s: float, n: int = 3, longer_m: Any = 0.0) -> Sensation:
    rest = np.full((n, 2), 0.1)
    stretch = rest + np.broadcast_to(longer_m, n)[:, np.newaxis]
    return Sensation(time_s, stretch, rest, np.ones(n), np.zeros(n), np.zeros((n, 3)), np.zeros(3))


def built(kind: str, n_segments: int = 3, n_muscles: int | None = None) -> Controller:
    size = (n_segments, n_muscles or n_segments)
    match kind:
        case "sine":
            return OpenLoopController(SineWave(), *size)
        case "timed":
            return OpenLoopController(TimedWave(), *size)
        case "shc":
            return HeteroclinicController(HeteroclinicChannel(noise=1e-3), *size, 0.001)
        case _:
            return PhaseChainController(PhaseChain(drive=2.0), *size, 0.001)


def drive(controller: Controller, first: int, steps: int, n: int = 3) -> np.ndarray:
    """Activation over steps of 1 ms, while the segments lengthen and shorten by turns."""
    turn = 2 * np.pi * np.arange(n) / n
    return np.array(
        [controller.step(at(k * 1e-3, n, 0.02 + 0.02 * np.cos(5e-3 * k - turn))) for k in range(first, first + steps)]
    )


@pytest.mark.parametrize("kind", KINDS)
def test_is_a_controller_that_records_and_restores(kind: str) -> None:
    one = built(kind)
    assert isinstance(one, Records)
    assert isinstance(one, Stateful)
    one.reset(7)
    drive(one, 0, 300)
    saved = one.get_state()
    expected = drive(one, 300, 300)
    assert expected.min() >= 0
    assert expected.max() <= 1
    # Another one, with another seed and history, goes on as the first did.
    other = built(kind)
    other.reset(8)
    drive(other, 0, 50)
    assert isinstance(other, Stateful)
    other.set_state(saved)
    np.testing.assert_array_equal(drive(other, 300, 300), expected)
    one.set_state(saved)
    np.testing.assert_array_equal(drive(one, 300, 300), expected)
    named = {signal.name: signal.shape for signal in one.recordable().signals}
    assert {name: np.shape(value) for name, value in one.read(frame=False).items()} == named
    assert one.read(frame=True) == {}


@pytest.mark.parametrize("kind", KINDS)
def test_halves_of_a_ring_contract_alike_and_muscles_must_fit(kind: str) -> None:
    whole, halves = drive(built(kind), 0, 200), drive(built(kind, 3, 6), 0, 200)
    np.testing.assert_array_equal(halves, whole.repeat(2, axis=1))
    with pytest.raises(ConfigError, match=r"n_muscles = 5 .* give 3 \(rings\) or 6 \(half-rings\)"):
        built(kind, 3, 5)


def test_noise_follows_the_seed() -> None:
    one = built("shc")
    runs = []
    for seed in (1, 1, 2):
        one.reset(seed)
        runs.append(drive(one, 0, 400))
    np.testing.assert_array_equal(runs[0], runs[1])
    assert (runs[0] != runs[2]).any()


def test_three_by_one_and_two_by_two_are_the_authors_patterns() -> None:
    """Six segments: 1 s up, 1 s hold, 1 s down; the next 1 s later, or 2 s later with two waves; 6 s a cycle."""
    times = np.arange(6, 18, 0.5)
    turn = np.interp(np.arange(0, 6, 0.5), [0, 1, 2, 3, 6], [0, 1, 1, 0, 0])
    for wave, delay in ((TimedWave(), 1.0), (TimedWave(interval_s=2.0, waves=2), 2.0)):
        assert wave.cycle_s(6) == 6.0
        pattern = wave.activation(times, 6)
        for segment in range(6):
            expected = np.tile(np.roll(turn, round(2 * delay * segment)), 2)
            np.testing.assert_allclose(pattern[:, segment], expected, atol=1e-6)


def test_a_segment_rests_until_its_first_turn() -> None:
    before = TimedWave().activation(np.arange(0, 6, 0.25), 6)
    for segment in range(6):
        assert not before[: 4 * segment + 1, segment].any()
        assert before[4 * segment + 1, segment] == pytest.approx(0.25, abs=1e-6)


@given(rise=st.integers(0, 500), hold=st.integers(1, 500), cycles=st.integers(0, 50), segment=st.integers(0, 5))
def test_a_timed_segment_holds_for_its_number_of_control_steps(rise: int, hold: int, cycles: int, segment: int) -> None:
    """Whichever way the times of the steps are rounded; without a fall it lets go at once."""
    dt, interval = 1e-3, 0.35
    wave = TimedWave(rise_s=rise * dt, hold_s=hold * dt, fall_s=0.0, interval_s=interval)
    start = round((cycles * 6 + segment) * interval / dt)
    steps = np.arange(start, start + 2100)
    on = wave.activation(steps * dt, 6)[:, segment]
    np.testing.assert_allclose(on[:rise], np.arange(rise) / max(rise, 1), atol=1e-6)
    np.testing.assert_allclose(on[rise : rise + hold], 1.0, atol=1e-6)
    assert not on[rise + hold :].any()


def test_a_timed_pattern_that_overtakes_itself_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"rise_s \+ hold_s \+ fall_s = 3: must be at most 1\.5 s, the cycle of 3"):
        TimedWave(interval_s=0.5).build(RunConfig(), build_plant(load_config("riddle2022-planar")))


@given(waves=st.integers(-2, 2), n=st.integers(3, 8), period=st.floats(0.5, 9.0), level=st.floats(0.1, 1.0))
def test_a_sine_travels_by_its_number_of_waves(waves: int, n: int, period: float, level: float) -> None:
    wave = SineWave(period_s=period, waves=waves, level=level)
    times = np.linspace(0, period, 50)
    activation = wave.activation(times, n)
    assert activation.min() >= 0
    assert activation.max() == pytest.approx(level)
    np.testing.assert_allclose(activation[0], activation[-1], atol=1e-9)
    later = wave.activation(times + period * waves / n, n)
    np.testing.assert_allclose(later[:, 1:], activation[:, :-1], atol=1e-9)


def steps_at_first_node(controller: HeteroclinicController, **felt: Any) -> int:
    controller.reset(0)
    for k in range(20_000):
        activation = controller.step(at(k * 1e-3, **felt))
        if activation.argmax() != 0:
            return k
    return 20_000


def test_stretch_of_the_present_segment_ends_its_dwell() -> None:
    one = HeteroclinicController(HeteroclinicChannel(noise=0.0, stretch_cue_m=0.02), 3, 3, 0.001)
    alone = steps_at_first_node(one, longer_m=0.0)
    reached = steps_at_first_node(one, longer_m=[0.021, 0.0, 0.0])
    other = steps_at_first_node(one, longer_m=[0.0, 0.021, 0.021])
    assert other == alone
    # Input rises from bias to bias + gain; what the dwell is shorter by is its logarithm over the leaving rate.
    section = HeteroclinicChannel()
    ratio = (section.bias_per_s + section.feedback_gain_per_s) / section.bias_per_s
    expected = np.log(ratio) * section.saddle_value / section.growth_rate_per_s
    assert (alone - reached) * 1e-3 == pytest.approx(expected, rel=0.1)


def test_a_gain_that_can_silence_the_channel_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"feedback_gain_per_s = 1\.01: must be less than 1, or"):
        HeteroclinicController(HeteroclinicChannel(feedback_gain_per_s=1.01), 3, 3, 0.001)


def test_a_bad_section_is_refused_in_one_sentence(subtests: pytest.Subtests) -> None:
    for controller, sentence in (
        ({"kind": "shc", "noise": 0, "bias_per_s": 0, "feedback_gain_per_s": 0}, "would rest at its first node"),
        ({"kind": "shc", "saddle_value": 1.0}, r"controller\.saddle_value = 1\.0: must be greater than 1"),
        ({"kind": "shc", "feedback": "contact"}, "controller.feedback.*always waits for the stretch"),
        ({"kind": "adaptive", "drive": 1.2}, r"controller\.drive = 1\.2: must be at most 1"),
        ({"kind": "adaptive", "network": {"tau": 3}}, r"unknown field 'controller\.network\.tau'"),
        ({"kind": "phase-chain", "rive": 3}, "did you mean 'drive'"),
        ({"kind": "timed", "rise_s": 0, "hold_s": 0, "fall_s": 0}, "would never contract"),
        ({"kind": "sines"}, "must be one of 'sns', .*did you mean 'sine'"),
    ):
        with subtests.test(f"{controller!r:.60}"):
            with pytest.raises(ConfigError, match=sentence) as caught:
                load_config("riddle2022-planar", {"controller": controller})
            assert "\n" not in str(caught.value)


def planar(kind: str, duration_s: float, **fields: Any) -> RunConfig:
    return load_config("riddle2022-planar", {"controller": {"kind": kind, **fields}, "duration_s": duration_s})


@pytest.mark.parametrize("kind", KINDS)
def test_a_planar_worm_contracts_in_order(kind: str, tmp_path: Path) -> None:
    score = rhythm_score(simulate(planar(kind, 7.5), tmp_path, progress=False))
    assert score.verdict == "ordered", score
    assert list(score.order[:6]) == [1, 2, 3, 1, 2, 3]

"""The robust network: one wave, in time, from any state and under any sensor signal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from math import log

import numpy as np
import pytest

from annelid.errors import ConfigError
from annelid.nervous import Network, Neuron, Stepper, add_half_centre, add_hold
from annelid.nervous.neurons import Array
from annelid.nervous.robust import ENTRAINMENT, ROLES, RobustParameters, robust_network, yielding_hold

BLOCK_MS = 10
TURN_MS = RobustParameters().turn_ms
Signal = Callable[[int, Array], Array]
"""Activity of the stretch sensors, ``(n_copies, n_segments)``, from the number of the block and the contractions."""


def stepper_of(n_segments: int, n_copies: int = 1, parameters: RobustParameters | None = None) -> Stepper:
    return robust_network(n_segments, parameters).compile(1.0, "euler", n_copies)


def contracted(stepper: Stepper, potential: Array) -> Array:
    n_segments = (len(stepper.arrays.neurons) - 1) // len(ROLES)
    return potential[:, :-1].reshape(len(potential), n_segments, len(ROLES))[..., 0]


def record(stepper: Stepper, duration_ms: float, signal: Signal, start: tuple[Array, Array] | None = None) -> Array:
    """Contraction neurons' potentials, mV, ``(n_blocks, n_copies, n_segments)``."""
    state = stepper.initial_state()
    if start is not None:
        state.potential[...], state.gate[...] = start
    trace = [contracted(stepper, state.potential).copy()]
    for block in range(int(duration_ms / BLOCK_MS)):
        stepper.advance(state, 20.0 * signal(block, trace[-1]), BLOCK_MS)
        trace.append(contracted(stepper, state.potential).copy())
    return np.array(trace)


def onsets(trace: Array, from_ms: float = 0.0) -> list[tuple[float, int]]:
    """Times, ms, at which a segment's contraction neuron passes half its range upwards, with the segment from 0."""
    up = (trace[:-1] < 10.0) & (trace[1:] >= 10.0)
    return [(BLOCK_MS * (block + 1.0), segment) for block, segment in np.argwhere(up) if BLOCK_MS * block >= from_ms]


def assert_one_wave_in_time(trace: Array, n_segments: int, from_ms: float) -> None:
    """Every onset is that of the next segment, and every single period within 10 % of design."""
    events = onsets(trace, from_ms)
    assert len(events) >= 2 * n_segments
    assert all(after == (before + 1) % n_segments for (_, before), (_, after) in pairwise(events))
    design_ms = n_segments * TURN_MS
    periods = [events[i + n_segments][0] - events[i][0] for i in range(len(events) - n_segments)]
    assert np.abs(np.array(periods) / design_ms - 1.0).max() <= 0.1


def adversary(kind: str, shape: tuple[int, int], seed: int) -> Signal:
    rng = np.random.default_rng(seed)
    rate = np.exp(rng.uniform(np.log(0.05), np.log(20.0), (shape[0], 1)))
    phase = rng.uniform(0.0, 1.0, shape)
    now = rng.random(shape) < 0.5

    def telegraph(block: int, trace: Array) -> Array:
        now[rng.random(shape) < rate * BLOCK_MS / 1e3] ^= True
        return now.astype(float)

    signals: dict[str, Signal] = {
        "on": lambda block, trace: np.ones(shape),
        "off": lambda block, trace: np.zeros(shape),
        "telegraph": telegraph,
        "noise": lambda block, trace: rng.random(shape),
        "swing": lambda block, trace: 0.5 + 0.5 * np.sin(2 * np.pi * (rate * block * BLOCK_MS / 1e3 + phase)),
        "while contracted": lambda block, trace: (trace > 10.0).astype(float),
        "while expanded": lambda block, trace: (trace < 10.0).astype(float),
    }
    return signals[kind]


ADVERSARIES = ("on", "off", "telegraph", "noise", "swing", "while contracted", "while expanded")


@pytest.mark.parametrize("kind", ADVERSARIES)
@pytest.mark.parametrize(
    ("n", "n_copies"), [(3, 100), *(pytest.param(n, 8, marks=pytest.mark.slow) for n in (8, 12, 24))]
)
def test_one_wave_in_all_copies(kind: str, n: int, n_copies: int) -> None:
    stepper, rng = stepper_of(n, n_copies), np.random.default_rng(1)
    state = stepper.initial_state()
    start = rng.uniform(-40.0, 60.0, state.potential.shape), rng.random(state.gate.shape)
    trace = record(stepper, 4.3 * n * TURN_MS, adversary(kind, (n_copies, n), 2), start)
    for copy in range(n_copies):
        assert_one_wave_in_time(trace[:, copy], n, 2 * n * TURN_MS)


@pytest.mark.parametrize(("n", "level_mV"), [(3, -40.0), (3, 20.0), (24, 10.0)])
def test_segments_that_are_all_alike_do_not_stay_so(n: int, level_mV: float) -> None:
    """All neurons at one potential, all gates alike: silence, or everything at once, ends in one contraction."""
    stepper = stepper_of(n, 3)
    state = stepper.initial_state()
    gate = np.broadcast_to(np.array([0.0, 0.5, 1.0])[:, np.newaxis, np.newaxis], state.gate.shape)
    start = np.full(state.potential.shape, level_mV), gate
    trace = record(stepper, 4.0 * TURN_MS, adversary("on", (3, n), 0), start)
    number = (trace[int(3.0 * TURN_MS / BLOCK_MS) :] > 10.0).sum(axis=2)
    assert number.min() >= 1
    # Two at once only while one hands over to the next.
    assert number.max() <= 2
    assert (number == 1).mean() > 0.9


@pytest.mark.parametrize("excitation_nA", [3.0, 6.0, 12.0])
def test_the_contraction_neuron_rests_at_zero_where_the_rule_says(excitation_nA: float) -> None:
    """An expanded half-centre, constantly excited, with a clamped hold: below 0 with more of it, above with less."""
    p = RobustParameters()
    wanted = yielding_hold(p, excitation_nA)

    def highest_mV(activity: float) -> float:
        network = Network()
        add_half_centre(network, "contraction", "expansion", p, (-p.offset_mV, p.range_mV))
        network.add_neuron("hold", Neuron(bias_nA=p.range_mV * activity), p.range_mV * activity)
        add_hold(network, "hold", "contraction", "expansion", p)
        network.add_input("excitation", "contraction")
        stepper = network.compile()
        return float(stepper.run(np.full((3000, 1), excitation_nA))[2000:, 0, 0].max())

    assert highest_mV(wanted - 0.01) > 0.0
    assert highest_mV(wanted + 0.01) < 0.0


@pytest.mark.parametrize(("turn_ms", "n"), [(300.0, 7), (2000.0, 3)])
def test_the_turn_is_the_designed_one_and_the_flip(turn_ms: float, n: int) -> None:
    trace = record(
        stepper_of(n, parameters=RobustParameters(turn_ms=turn_ms)), 2.2 * n * turn_ms, adversary("off", (1, n), 0)
    )
    events = onsets(trace[:, 0])
    excess_ms = np.array([b - a for (a, _), (b, _) in pairwise(events)])[n - 1 :] - turn_ms
    assert excess_ms.min() >= -BLOCK_MS
    assert excess_ms.max() <= 20.0 + 0.03 * turn_ms


def test_the_sensor_speeds_up_and_slows_down_within_its_bounds() -> None:
    """A segment that lengthens in its turn hands over earlier; one that lacks its usual stretch, later."""
    n, n_turns = 4, 40
    stepper = stepper_of(n, 3)

    def signal(block: int, trace: Array) -> Array:
        usual = block * BLOCK_MS < 0.5 * n_turns * TURN_MS
        return np.stack([trace[0] > 10.0, np.zeros(n), np.full(n, float(usual))])

    trace = record(stepper, n_turns * TURN_MS, signal)
    late = trace[int(0.52 * n_turns * TURN_MS / BLOCK_MS) : int(0.72 * n_turns * TURN_MS / BLOCK_MS)]
    lengthening, nothing, missing = (
        float(np.mean(np.diff([time for time, _ in onsets(late[:, copy])]))) for copy in range(3)
    )
    assert lengthening < nothing < missing
    bound = 2.0 * ENTRAINMENT / log(2.0) + 0.01
    assert all(abs(turn / nothing - 1.0) <= bound for turn in (lengthening, missing))


def test_bad_parameters_are_refused(subtests: pytest.Subtests) -> None:
    for change, words in (
        ({"bifurcation_mV": 0.01}, "bifurcation_mV must be negative"),
        ({"turn_ms": 0.0}, "turn_ms must be positive"),
    ):
        with subtests.test(f"{change!r:.60}"), pytest.raises(ConfigError, match=words):
            replace(RobustParameters(), **change)
    with pytest.raises(ConfigError, match="n_segments must be at least 3, not 2"):
        robust_network(2)

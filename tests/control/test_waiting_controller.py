"""The network that waits for rest: what each of its synapses does, and the wave on a body whose lengths lag behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pytest
from circuits import controller, felt
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.control import CircuitController
from annelid.nervous import Network, Neuron, PeristalsisParameters, Synapse
from annelid.nervous.peristalsis import waiting_network
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


def rest_mV(target: str, clamped: Mapping[str, float], p: PeristalsisParameters, start_mV: float = 0.0) -> float:
    """Where a neuron of the network comes to rest with some of those that act on it clamped, and all others at 0."""
    network, whole = Network(), waiting_network(3, p)
    network.add_neuron(target, whole.neurons[target], start_mV)
    for one in whole.connections:
        if one.target == target:
            if one.source not in network.neurons:
                network.add_neuron(one.source, Neuron(rest_mV=clamped.get(one.source, 0.0)))
            assert isinstance(one.kind, Synapse)
            network.add_synapse(one.source, target, one.kind)
    network.add_input("stretch", target)
    sensed_nA = p.leak_conductance_uS * p.range_mV if target.startswith("sensory") else 0.0
    return float(network.compile().run(np.full((300, 1), sensed_nA))[-1, 0, 0])


parameters = st.builds(
    PeristalsisParameters,
    leak_conductance_uS=st.floats(0.5, 1.5),
    range_mV=st.floats(10, 30),
    inhibitory_reversal_mV=st.floats(-60, -30),
    excitatory_reversal_mV=st.floats(100, 250),
)


@given(p=parameters)
@settings(max_examples=30)
def test_a_memory_is_a_latch_that_only_the_next_one_resets(p: PeristalsisParameters) -> None:
    reach, excitatory = p.range_mV, p.excitatory_reversal_mV
    contracting = 2.0 * reach * excitatory / (excitatory + reach)
    assert rest_mV("memory_2", {"contraction_2": reach}, p) == pytest.approx(contracting)
    assert rest_mV("memory_2", {}, p, contracting) == pytest.approx(reach)
    assert rest_mV("memory_2", {}, p, 0.39 * reach) == pytest.approx(0.0, abs=1e-3)
    assert rest_mV("memory_2", {"memory_3": 0.6 * reach}, p, reach) == pytest.approx(reach)
    for contraction in (0.0, reach):
        assert rest_mV("memory_2", {"contraction_2": contraction, "memory_3": reach}, p, contracting) < 0.4 * reach


@given(p=parameters)
@settings(max_examples=30)
def test_a_relay_silences_the_next_sensory_neuron_where_both_memory_and_sensor_are_on(p: PeristalsisParameters) -> None:
    reach, excitatory = p.range_mV, p.excitatory_reversal_mV
    on = {"memory_2": reach, "sensory_2": reach}
    both, *alone = (rest_mV("relay_2", each, p) for each in (on, {"memory_2": reach}, {"sensory_2": reach}))
    assert both == pytest.approx(reach)
    assert alone == pytest.approx(2 * [reach * excitatory / (2.0 * excitatory - reach)])
    for relay, rest in ((both, 0.0), (alone[0], reach)):
        assert rest_mV("sensory_3", {"relay_2": relay}, p) == pytest.approx(rest, abs=1e-3)
    assert rest_mV("sensory_3", {"contraction_3": reach}, p) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(("n_segments", "held_ms"), [(5, 1), (3, 7), (5, 100)])
def test_whatever_the_sensors_say_a_memory_is_on(n_segments: int, held_ms: int) -> None:
    network, rng, n_copies = waiting_network(n_segments), np.random.default_rng(held_ms), 16
    places = [place for place, name in enumerate(network.neurons) if name.startswith("memory")]
    stepper = network.compile(n_worms=n_copies)
    state, least = stepper.initial_state(), np.inf
    inputs_nA = np.zeros((n_copies, n_segments + 1))
    for _ in range(10_000 // held_ms):
        inputs_nA[:, :n_segments] = 20.0 * (rng.random((n_copies, n_segments)) < rng.choice([0.3, 0.6, 0.9]))
        for _ in range(held_ms):
            stepper.advance(state, inputs_nA)
            least = min(least, state.potential[:, places].max(axis=1).min())
    assert least > 0.6 * 20.0

"""Spiking neurons and synapses, electrical and modulatory synapses, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid.nervous import (
    Channel,
    Firing,
    GapJunction,
    Gate,
    ModulatorySynapse,
    Network,
    Neuron,
    Scheme,
    SpikingSynapse,
    export_network,
    persistent_sodium,
)


def lone(neuron: Neuron) -> Network:
    network = Network()
    network.add_neuron("a", neuron)
    network.add_input("current", "a")
    return network


def spike_times(
    network: Network, currents: np.ndarray, step: float, duration: float, scheme: Scheme = "euler"
) -> list[np.ndarray]:
    """Times of the first neuron's spikes, one list for each current, as one batch."""
    stepper = network.compile(step, scheme, len(currents))
    state = stepper.initial_state()
    fired = np.zeros((round(duration / step), len(currents)), dtype=bool)
    for i in range(len(fired)):
        stepper.advance(state, currents[:, np.newaxis])
        fired[i] = state.fired[:, 0]
    return [step * (1 + np.flatnonzero(column)) for column in fired.T]


@settings(max_examples=20)
@given(
    capacitance=st.floats(2, 20),
    leak=st.floats(0.5, 2),
    threshold=st.floats(1, 15),
    reset=st.floats(-10, 0),
    rest=st.floats(-5, 0.5),
)
def test_f_I_curve_of_the_leaky_integrate_and_fire_neuron(capacitance, leak, threshold, reset, rest):
    neuron = Neuron(capacitance, leak, rest, firing=Firing(threshold, reset))
    drives = np.array([0.9, 0.999, 1.05, 1.5, 3.0])
    currents = drives * leak * (threshold - rest)
    final = rest + currents / leak
    tau, step = capacitance / leak, 0.01 * capacitance / leak
    times = spike_times(lone(neuron), currents, step, 12 * tau)
    assert [len(t) for t in times[:2]] == [0, 0]
    for u, seen in zip(final[2:], times[2:], strict=True):
        period = tau * math.log((u - reset) / (u - threshold))
        # Euler's own decay is (1 - z) a step, z = 0.01; the spike falls on the end of a step.
        discrete = step * math.ceil(math.log((u - threshold) / (u - reset)) / math.log(0.99) - 1e-6)
        np.testing.assert_allclose(np.diff(seen), discrete, rtol=1e-9)
        assert discrete == pytest.approx(period, abs=1.01 * step + 0.006 * period)


@pytest.mark.parametrize("scheme", ["euler", "toolbox", "heun"])
def test_rate_converges_to_the_closed_form_as_the_step_shrinks(scheme):
    neuron = Neuron(5.0, 1.0, firing=Firing(10.0))
    period = 5.0 * math.log(15.0 / 5.0)
    errors = []
    for step in (0.1, 0.01):
        (seen,) = spike_times(lone(neuron), np.array([15.0]), step, 60.0, scheme)
        errors.append(abs(np.diff(seen).mean() - period))
    assert errors[0] < 0.11
    assert errors[1] < 0.011


def test_adaptation_slows_to_the_periodic_solution_of_membrane_and_threshold():
    tau, drive, theta_0, gain = 50.0, 20.0, 5.0, 0.5
    fixed, adapting = (Neuron(5.0, 1.0, firing=Firing(theta_0, 0.0, m, tau)) for m in (0.0, gain))
    (even,) = spike_times(lone(fixed), np.array([drive]), 0.02, 50.0)
    (slowing,) = spike_times(lone(adapting), np.array([drive]), 0.02, 1200.0)
    assert np.ptp(np.diff(even)) < 1e-9
    intervals = np.diff(slowing)
    assert np.all(np.diff(intervals) >= -0.021)

    def excess(period: float) -> float:
        """Threshold above potential at the end of an interval at whose beginning the threshold is the same."""
        reached = drive * (1 - math.exp(-period / 5.0))
        fading = (math.exp(-period / 5.0) - math.exp(-period / tau)) / (1 - tau / 5.0)
        relaxed = 1 - math.exp(-period / tau)
        return theta_0 + gain * drive * (1 - fading / relaxed) - reached

    low, high = 0.5, 50.0
    assert excess(low) > 0 > excess(high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    assert low > 1.2 * intervals[0]
    assert intervals[-50:].mean() == pytest.approx(low, abs=0.025)


@settings(max_examples=20)
@given(tau=st.floats(1, 50), increment=st.floats(0.05, 1.0), period=st.integers(2, 40))
def test_release_of_a_spiking_synapse_jumps_and_decays(tau, increment, period):
    network = Network()
    # Driven for one step in every `period`, far past threshold: it spikes exactly then.
    network.add_neuron("pre", Neuron(1.0, 1.0, firing=Firing(1.0)))
    network.add_neuron("post", Neuron())
    network.add_synapse("pre", "post", SpikingSynapse(0.3, 60.0, tau, increment))
    network.add_input("kick", "pre")
    stepper = network.compile(0.5)
    state = stepper.initial_state()
    release, post = 0.0, 0.0
    for i in range(120):
        post += 0.5 / 5.0 * (-post + 0.3 * release * (60.0 - post))
        stepper.advance(state, np.array([100.0 if i % period == 0 else 0.0]))
        release = release * math.exp(-0.5 / tau)
        if i % period == 0:
            release = min(release + increment, 1.0)
        assert bool(state.fired[0, 0]) == (i % period == 0)
        assert state.release[0, 0] == pytest.approx(release, rel=1e-9)
        assert state.potential[0, 1] == pytest.approx(post, rel=1e-9, abs=1e-12)


def test_mean_conductance_of_a_spiking_synapse_is_that_of_its_rate():
    network = Network()
    network.add_neuron("pre", Neuron(5.0, 1.0, bias_nA=20.0, firing=Firing(5.0)))
    network.add_neuron("post", Neuron())
    network.add_synapse("pre", "post", SpikingSynapse(0.4, 100.0, 30.0, 0.01))
    stepper = network.compile(0.01)
    state = stepper.initial_state()
    released = []
    for _ in range(40000):
        stepper.advance(state)
        released.append(state.release[0, 0])
    period = 5.0 * math.log(20.0 / 15.0)
    assert np.mean(released[20000:]) == pytest.approx(0.01 * 30.0 / period, rel=0.02)


def test_copies_of_a_batch_spike_for_themselves_and_a_copied_state_continues_alike():
    network = lone(Neuron(firing=Firing(3.0, adaptation=0.5)))
    network.add_neuron("b", Neuron())
    network.add_synapse("a", "b", SpikingSynapse(0.5, 100.0, 5.0, 0.5))
    currents = np.array([[0.0], [5.0], [10.0]])
    together, alone = network.compile(0.5, n_worms=3), network.compile(0.5)
    trace = together.run(np.tile(currents, (100, 1, 1)))
    for worm in range(3):
        np.testing.assert_allclose(alone.run(np.tile(currents[worm], (100, 1)))[:, 0], trace[:, worm], rtol=1e-12)
    state = together.initial_state()
    together.run(np.tile(currents, (50, 1, 1)), state)
    again = together.run(np.tile(currents, (50, 1, 1)), state.copy())
    assert np.array_equal(again, together.run(np.tile(currents, (50, 1, 1)), state))
    assert np.ptp(again[:, 2, 0]) > 1.0


@given(
    left=st.floats(-20, 20),
    right=st.floats(-20, 20),
    conductance=st.floats(0, 2),
    leaks=st.tuples(st.floats(0.5, 2), st.floats(0.5, 2)),
    rectified=st.booleans(),
)
@settings(max_examples=40)
def test_electrical_synapse_between_unlike_neurons(left, right, conductance, leaks, rectified):
    network = Network()
    network.add_neuron("left", Neuron(leak_conductance_uS=leaks[0], bias_nA=left))
    network.add_neuron("right", Neuron(leak_conductance_uS=leaks[1], bias_nA=right))
    network.add_gap_junction("left", "right", GapJunction(conductance, rectified))
    end = network.compile(1.0).run(np.empty((400, 0)))[-1, 0]
    g = conductance if not rectified or left / leaks[0] > right / leaks[1] else 0.0
    matrix = np.array([[leaks[0] + g, -g], [-g, leaks[1] + g]])
    np.testing.assert_allclose(end, np.linalg.solve(matrix, [left, right]), atol=1e-9)


def modulated(target: Neuron, *synapses: ModulatorySynapse) -> Network:
    network = Network()
    network.add_neuron("target", target)
    network.add_neuron("source", Neuron())
    network.add_neuron("other", Neuron())
    for name, synapse in zip(("source", "other"), synapses, strict=False):
        network.add_synapse(name, "target", synapse)
    network.add_input("current", "target")
    return network


share = st.floats(-0.2, 1.2)
factor = st.floats(0.2, 5.0)


def opening(s: float) -> float:
    return min(max(s, 0.0), 1.0)


@settings(max_examples=25)
@given(factor=factor, share=share, current=st.floats(-10, 10), rest=st.floats(-5, 5))
def test_modulated_leak_sets_the_steady_state(factor, share, current, rest):
    network = modulated(Neuron(rest_mV=rest), ModulatorySynapse("leak", factor))
    network.add_input("hold", "source")
    inputs = np.tile([current, 20.0 * share], (1500, 1))
    end = network.compile(0.5).run(inputs)[-1, 0, 0]
    assert end == pytest.approx(rest + current / factor ** opening(share), abs=1e-8)


def start_at(network: Network, **potentials: float):
    stepper = network.compile(0.1)
    state = stepper.initial_state()
    for name, value in potentials.items():
        state.potential[0, list(network.neurons).index(name)] = value
    return stepper, state


@given(factor=factor, share=share, second=factor, other=share)
def test_factors_multiply_and_membrane_changes_only_the_rate(factor, share, second, other):
    network = modulated(Neuron(), ModulatorySynapse("membrane", factor), ModulatorySynapse("membrane", second))
    stepper, state = start_at(network, target=0.0, source=20.0 * share, other=20.0 * other)
    stepper.advance(state, np.array([7.0]))
    scale = factor ** opening(share) * second ** opening(other)
    assert state.potential[0, 0] == pytest.approx(0.1 / 5.0 * 7.0 / scale, rel=1e-9)


@given(factor=factor, share=share)
def test_modulated_gates_and_channels(factor, share):
    neuron = Neuron(channels=(persistent_sodium(0.8), Channel(0.5, -40.0, (Gate(0.1, 5.0, power=2.0),))))
    plain, plain_state = start_at(modulated(neuron), target=12.0)
    plain_state.gate[:, :, 0] = 0.2
    before = plain_state.copy()
    plain.advance(plain_state)
    gate_step = plain_state.gate[0, 0, 0] - 0.2
    current = (plain_state.potential[0, 0] - 12.0) * 5.0 / 0.1

    gates, state = start_at(modulated(neuron, ModulatorySynapse("gates", factor)), target=12.0, source=20.0 * share)
    state.gate[...] = before.gate
    gates.advance(state)
    scale = factor ** opening(share)
    assert state.gate[0, 0, 0] - 0.2 == pytest.approx(gate_step / scale, rel=1e-9)
    assert state.potential[0, 0] == pytest.approx(plain_state.potential[0, 0], rel=1e-12)

    network = modulated(neuron, ModulatorySynapse("channels", factor))
    channels, state = start_at(network, target=12.0, source=20.0 * share)
    state.gate[...] = before.gate
    channels.advance(state)
    changed = (state.potential[0, 0] - 12.0) * 5.0 / 0.1
    assert changed + 12.0 == pytest.approx(scale * (current + 12.0), rel=1e-6)
    assert state.gate[0, 0, 0] - 0.2 == pytest.approx(gate_step, rel=1e-9)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Firing(1.0, 1.0), "reset_mV"),
        (lambda: Firing(adaptation_time_constant_ms=0.0), "adaptation_time_constant_ms"),
        (lambda: SpikingSynapse(-1.0, 0.0), "conductance_uS"),
        (lambda: SpikingSynapse(1.0, 0.0, 0.0), "time_constant_ms"),
        (lambda: SpikingSynapse(1.0, 0.0, increment=1.5), "increment"),
        (lambda: ModulatorySynapse("leek", 2.0), "did you mean 'leak'"),  # type: ignore[arg-type]
        (lambda: ModulatorySynapse("leak", 0.0), "factor"),
        (lambda: ModulatorySynapse("leak", 2.0, 5.0, 5.0), "saturation_mV"),
    ],
)
def test_impossible_properties_are_refused(make, field):
    with pytest.raises(ConfigError, match=field):
        make()


def test_a_spiking_synapse_needs_a_source_that_spikes():
    network = lone(Neuron())
    with pytest.raises(ConfigError, match="'a' has no firing"):
        network.add_synapse("a", "a", SpikingSynapse(1.0, 40.0))


@pytest.mark.parametrize(
    ("synapse", "firing", "message"),
    [
        (None, Firing(), "'a' spikes"),
        (ModulatorySynapse("leak", 2.0), None, "joined by a ModulatorySynapse"),
    ],
)
def test_what_sns_toolbox_cannot_take_over_is_refused(synapse, firing, message):
    pytest.importorskip("sns_toolbox", reason="pip install 'annelid[sns]' runs this test")
    network = lone(Neuron(firing=firing))
    if synapse is not None:
        network.add_synapse("a", "a", synapse)
    with pytest.raises(ConfigError, match=message):
        export_network(network)

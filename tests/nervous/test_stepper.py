"""The stepper of many copies against the equations written out neuron by neuron, and its orders of accuracy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid.nervous import (
    Channel,
    GapJunction,
    Gate,
    Network,
    Neuron,
    PeristalsisParameters,
    Synapse,
    persistent_sodium,
)

schemes = st.sampled_from(["euler", "toolbox", "heun"])
TIMESTEP_MS = 0.5


class Plain:
    """One Euler (or gates-first) step at a time, by loops over neurons, channels and connections."""

    def __init__(self, network: Network, dt: float, gates_first: bool) -> None:
        self.network, self.dt, self.gates_first = network, dt, gates_first
        self.u = dict(network.initial_mV)
        self.z = {
            (name, i, k): float(gate.steady(self.u[name]))
            for name, neuron in network.neurons.items()
            for i, channel in enumerate(neuron.channels)
            for k, gate in enumerate(channel.gates)
        }

    def transmitted(self, c) -> float:
        k = c.kind
        return min(max((self.u[c.source] - k.threshold_mV) / (k.saturation_mV - k.threshold_mV), 0.0), 1.0)

    def gate_steps(self) -> dict:
        steps = {}
        for name, neuron in self.network.neurons.items():
            for i, channel in enumerate(neuron.channels):
                for k, gate in enumerate(channel.gates):
                    weight = gate.factor * math.exp(gate.slope_per_mV * (gate.midpoint_mV - self.u[name]))
                    steady = 1 / (1 + weight)
                    if gate.time_constant_ms is None:
                        self.z[name, i, k] = steady
                        continue
                    tau = gate.time_constant_ms * steady * math.sqrt(weight)
                    steps[name, i, k] = self.dt * (steady - self.z[name, i, k]) / tau
        return steps

    def advance(self, inputs) -> None:
        network, dt = self.network, self.dt
        gate_steps = self.gate_steps()
        if self.gates_first:
            for key, step in gate_steps.items():
                self.z[key] += step
        current = {}
        for name, n in network.neurons.items():
            u = self.u[name]
            current[name] = n.bias_nA + n.leak_conductance_uS * (n.rest_mV - u)
            for i, channel in enumerate(n.channels):
                g = channel.conductance_uS
                for k, gate in enumerate(channel.gates):
                    g *= self.z[name, i, k] ** gate.power
                current[name] += g * (channel.reversal_mV - u)
        for c in network.connections:
            k, pre, post = c.kind, self.u[c.source], self.u[c.target]
            if isinstance(k, Synapse):
                current[c.target] += self.transmitted(c) * k.conductance_uS * (k.reversal_mV - post)
            else:
                flow = k.conductance_uS * (max(pre - post, 0.0) if k.rectified else pre - post)
                current[c.target] += flow
                current[c.source] -= flow
        for targets, value in zip(network.inputs.values(), inputs, strict=True):
            for target in targets:
                current[target] += value
        if not self.gates_first:
            for key, step in gate_steps.items():
                self.z[key] += step
        self.u = {name: self.u[name] + dt * current[name] / n.capacitance_nF for name, n in network.neurons.items()}


channels = st.lists(
    st.one_of(
        st.builds(persistent_sodium, st.floats(0.1, 1.5), time_constant_ms=st.floats(50, 300)),
        st.builds(
            lambda g, e, power, slope, tau: Channel(
                g,
                e,
                (
                    Gate(slope, 10.0, power=power),
                    Gate(-slope, 5.0, 0.7, time_constant_ms=tau),
                    Gate(slope, -9.0, 2.0, time_constant_ms=2 * tau),
                ),
            ),
            st.floats(0.1, 1.0),
            st.floats(-40, 110),
            st.integers(1, 3),
            st.floats(0.01, 0.08),
            st.floats(50, 300),
        ),
    ),
    max_size=2,
).map(tuple)
neuron = st.builds(Neuron, st.floats(4, 10), st.floats(0.5, 1.5), st.floats(-5, 5), st.floats(-2, 6), channels)
kinds = st.one_of(
    st.builds(Synapse, st.floats(0, 0.6), st.floats(-60, 194), st.floats(-5, 0), st.floats(5, 30)),
    st.builds(GapJunction, st.floats(0, 0.3), st.booleans()),
)


@st.composite
def networks(draw) -> Network:
    network = Network()
    neurons = draw(st.lists(neuron, min_size=1, max_size=4))
    for i, n in enumerate(neurons):
        network.add_neuron(str(i), n, draw(st.floats(-10, 20)))
    who = st.integers(0, len(neurons) - 1).map(str)
    for source, target, kind in draw(st.lists(st.tuples(who, who, kinds), max_size=8)):
        if isinstance(kind, GapJunction):
            network.add_gap_junction(source, target, kind)
        else:
            network.add_synapse(source, target, kind)
    for k in range(draw(st.integers(0, 2))):
        network.add_input(f"i{k}", draw(st.lists(who, min_size=1, max_size=3, unique=True)))
    return network


def currents(network: Network, seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-5, 20, (*shape, len(network.inputs)))


@settings(max_examples=100)
@given(network=networks(), scheme=st.sampled_from(["euler", "toolbox"]), seed=st.integers(0, 99))
def test_every_step_is_that_of_the_equations(network, scheme, seed):
    stepper = network.compile(TIMESTEP_MS, scheme, n_worms=2)
    state = stepper.initial_state()
    plain = Plain(network, TIMESTEP_MS, scheme == "toolbox")
    for inputs in currents(network, seed, 40):
        stepper.advance(state, inputs)
        plain.advance(inputs)
        np.testing.assert_allclose(state.potential, [list(plain.u.values())] * 2, rtol=1e-11, atol=1e-11)


@settings(max_examples=40)
@given(network=networks(), scheme=schemes, n_worms=st.integers(2, 4), seed=st.integers(0, 99))
def test_copies_have_the_bits_of_single_networks_whose_gates_stay_between_0_and_1(network, scheme, n_worms, seed):
    inputs = currents(network, seed, 40, n_worms)
    batch = network.compile(TIMESTEP_MS, scheme, n_worms)
    start = batch.initial_state()
    start.potential += np.random.default_rng(seed).uniform(-10, 10, start.potential.shape)
    single = network.compile(TIMESTEP_MS, scheme)
    together = batch.run(inputs, start.copy())
    for worm in range(n_worms):
        state = single.initial_state()
        state.potential[0] = start.potential[worm]
        state.gate[...] = start.gate[worm]
        alone = single.run(inputs[:, worm], state)
        np.testing.assert_array_equal(together[:, worm], alone[:, 0])
        assert np.all((state.gate >= 0.0) & (state.gate <= 1.0))


def half_centre_with_neighbour(timestep_ms, scheme, duration_ms):
    """A smooth stretch of motion, clear of the corners of the synapses' clip."""
    p = PeristalsisParameters()
    network = Network()
    network.add_neuron("a", Neuron(channels=(p.sodium_channel,)), 5.0)
    network.add_neuron("b", Neuron(channels=(p.sodium_channel,)), 8.0)
    network.add_synapse("a", "b", Synapse(0.1, -40.0, -50.0, 100.0))
    network.add_synapse("b", "a", Synapse(0.1, 194.0, -50.0, 100.0))
    stepper = network.compile(timestep_ms, scheme)
    state = stepper.initial_state()
    state.gate[...] = 0.9
    for _ in range(round(duration_ms / timestep_ms)):
        stepper.advance(state)
    return np.concatenate([state.potential.ravel(), state.gate.ravel()])


@pytest.mark.parametrize(("scheme", "order"), [("euler", 1), ("toolbox", 1), ("heun", 2)])
def test_order_of_accuracy(scheme, order):
    exact = half_centre_with_neighbour(1 / 128, "heun", 16.0)
    errors = [np.linalg.norm(half_centre_with_neighbour(dt, scheme, 16.0) - exact) for dt in (0.5, 0.25, 0.125)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, order, atol=0.15)


def test_one_input_for_all_copies_and_none_for_no_current():
    network = Network()
    network.add_neuron("a", Neuron(capacitance_nF=2.0))
    network.add_neuron("b", Neuron(capacitance_nF=4.0))
    network.add_input("both", ["a", "b"])
    network.add_output("out", "b")
    stepper = network.compile(1.0, n_worms=3)
    state = stepper.initial_state()
    stepper.advance(state, np.array([8.0]))
    np.testing.assert_allclose(state.potential, [[4.0, 2.0]] * 3)
    np.testing.assert_allclose(stepper.outputs(state), [[2.0]] * 3)
    stepper.advance(state)
    np.testing.assert_allclose(state.potential, [[2.0, 1.5]] * 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scheme": "eular"}, "did you mean 'euler'"),
        ({"timestep_ms": 0.0}, "timestep_ms"),
        ({"n_worms": 0}, "n_worms"),
    ],
)
def test_impossible_steppers_are_refused(arguments, message):
    network = Network()
    network.add_neuron("a", Neuron())
    with pytest.raises(ConfigError, match=message):
        network.compile(**arguments)
    with pytest.raises(ConfigError, match="did you mean 'steady'"):
        network.compile().initial_state("stedy")  # type: ignore[arg-type]

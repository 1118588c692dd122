"""The batched stepper against the equations written out neuron by neuron, and its bound on the Euler step."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.nervous import (
    Channel,
    Firing,
    GapJunction,
    Gate,
    ModulatorySynapse,
    Network,
    Neuron,
    SpikingSynapse,
    Synapse,
    persistent_sodium,
)


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
        self.theta = {name: n.firing.threshold_mV for name, n in network.neurons.items() if n.firing is not None}
        self.s = {i: 0.0 for i, c in enumerate(network.connections) if isinstance(c.kind, SpikingSynapse)}

    def scale(self, name: str, quantity: str) -> float:
        product = 1.0
        for c in self.network.connections:
            if isinstance(c.kind, ModulatorySynapse) and c.target == name and c.kind.quantity == quantity:
                product *= c.kind.factor ** self.transmitted(c)
        return product

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
                    tau = gate.time_constant_ms * steady * math.sqrt(weight) * self.scale(name, "gates")
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
            current[name] = n.bias_nA + n.leak_conductance_uS * self.scale(name, "leak") * (n.rest_mV - u)
            for i, channel in enumerate(n.channels):
                g = channel.conductance_uS * self.scale(name, "channels")
                for k, gate in enumerate(channel.gates):
                    g *= self.z[name, i, k] ** gate.power
                current[name] += g * (channel.reversal_mV - u)
        for i, c in enumerate(network.connections):
            k, pre, post = c.kind, self.u[c.source], self.u[c.target]
            if isinstance(k, Synapse):
                current[c.target] += self.transmitted(c) * k.conductance_uS * (k.reversal_mV - post)
            elif isinstance(k, SpikingSynapse):
                current[c.target] += self.s[i] * k.conductance_uS * (k.reversal_mV - post)
            elif isinstance(k, GapJunction):
                flow = k.conductance_uS * (max(pre - post, 0.0) if k.rectified else pre - post)
                current[c.target] += flow
                current[c.source] -= flow
        for (_, targets), value in zip(network.inputs.items(), inputs, strict=True):
            for target in targets:
                current[target] += value
        new = {}
        for name, n in network.neurons.items():
            new[name] = self.u[name] + dt * current[name] / (n.capacitance_nF * self.scale(name, "membrane"))
        if not self.gates_first:
            for key, step in gate_steps.items():
                self.z[key] += step
        fired = set()
        for name, theta in self.theta.items():
            n = network.neurons[name]
            f = n.firing
            assert f is not None
            target = f.threshold_mV + f.adaptation * (self.u[name] - n.rest_mV)
            self.theta[name] = theta + dt * (target - theta) / f.adaptation_time_constant_ms
            if new[name] >= self.theta[name]:
                new[name] = f.reset_mV
                fired.add(name)
        for i, s in self.s.items():
            c = network.connections[i]
            k = c.kind
            assert isinstance(k, SpikingSynapse)
            s *= math.exp(-dt / k.time_constant_ms)
            self.s[i] = min(s + k.increment, 1.0) if c.source in fired else s
        self.u = new


channels = st.lists(
    st.one_of(
        st.builds(persistent_sodium, st.floats(0.1, 1.5), time_constant_ms=st.floats(50, 300)),
        st.builds(
            lambda g, e, power, slope, tau: Channel(
                g,
                e,
                (Gate(slope, 10.0, power=power), Gate(-slope, 5.0, 0.7, time_constant_ms=tau), Gate(slope, -9.0, 2.0)),
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
firing = st.none() | st.builds(Firing, st.floats(3, 8), st.floats(-5, 1), st.floats(0, 1), st.floats(5, 100))
neuron = st.builds(Neuron, st.floats(4, 10), st.floats(0.5, 1.5), st.floats(-5, 5), st.floats(-2, 6), channels, firing)
kinds = st.one_of(
    st.builds(Synapse, st.floats(0, 0.6), st.floats(-60, 194), st.floats(-5, 0), st.floats(5, 30)),
    st.builds(GapJunction, st.floats(0, 0.3), st.booleans()),
    st.builds(SpikingSynapse, st.floats(0, 0.5), st.floats(-60, 100), st.floats(1, 20), st.floats(0.1, 1)),
    st.builds(
        ModulatorySynapse,
        st.sampled_from(["leak", "channels", "membrane", "gates"]),
        st.floats(0.3, 3),
        st.floats(-5, 0),
        st.floats(5, 30),
    ),
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
        elif not isinstance(kind, SpikingSynapse) or network.neurons[source].firing is not None:
            network.add_synapse(source, target, kind)
    for k in range(draw(st.integers(0, 2))):
        network.add_input(f"i{k}", draw(st.lists(who, min_size=1, max_size=3, unique=True)))
    return network


@settings(max_examples=150)
@given(network=networks(), scheme=st.sampled_from(["euler", "toolbox"]), seed=st.integers(0, 99))
def test_every_step_is_that_of_the_equations(network, scheme, seed):
    stepper = network.compile(0.5, scheme, n_worms=2)
    state = stepper.initial_state()
    plain = Plain(network, 0.5, scheme == "toolbox")
    for inputs in np.random.default_rng(seed).uniform(-5, 20, (40, len(network.inputs))):
        stepper.advance(state, inputs)
        plain.advance(inputs)
        expected = list(plain.u.values())
        near_threshold = [
            abs(u - plain.theta[name]) < 1e-9 for name, u in plain.u.items() if name in plain.theta
        ]  # fired or not is then a matter of rounding
        if any(near_threshold):
            return
        np.testing.assert_allclose(state.potential, [expected] * 2, rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(state.threshold, [list(plain.theta.values())] * 2, rtol=1e-11)

"""Single neurons and pairs against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid.nervous import Channel, GapJunction, Gate, Network, Neuron, Synapse, persistent_sodium

potentials = st.floats(-40, 60)


@given(
    capacitance=st.floats(2, 20),
    leak=st.floats(0.1, 2),
    rest=st.floats(-70, 10),
    bias=st.floats(-5, 5),
    start=potentials,
    current=st.floats(-20, 20),
)
def test_lone_leaky_neuron_follows_the_exponential(capacitance, leak, rest, bias, start, current):
    network = Network()
    network.add_neuron("a", Neuron(capacitance, leak, rest, bias), start)
    network.add_input("current", "a")
    dt, n = 0.5, 100
    z = dt * leak / capacitance
    final = rest + (bias + current) / leak
    inputs = np.full((n, 1), current)
    k = np.arange(n + 1)

    euler = network.compile(dt, "euler").run(inputs)[:, 0, 0]
    np.testing.assert_allclose(euler, final + (start - final) * (1 - z) ** k, rtol=1e-9, atol=1e-9)

    heun = network.compile(dt, "heun").run(inputs)[:, 0, 0]
    exact = final + (start - final) * np.exp(-z * k)
    # Local error z^3/6 of the second-order factor, summed over the steps.
    bound = abs(start - final) * n * z**3 / 6 + 1e-9
    assert np.max(np.abs(heun - exact)) <= bound


def test_gate_start_steady_and_toolbox():
    network = Network()
    network.add_neuron("a", Neuron(channels=(persistent_sodium(1.0),)), 13.0)
    network.add_neuron("b", Neuron())
    network.add_neuron("c", Neuron(channels=(persistent_sodium(1.0),)), -7.0)
    stepper = network.compile()
    steady = stepper.initial_state("steady").gate[0, 0]
    reversed_slope = stepper.initial_state("toolbox").gate[0, 0]
    u = np.array([13.0, -7.0])
    np.testing.assert_allclose(steady, 1 / (1 + 0.5 * np.exp(0.05 * u)), rtol=1e-14)
    np.testing.assert_allclose(reversed_slope, 1 / (1 + 0.5 * np.exp(-0.05 * u)), rtol=1e-14)


def test_stable_timestep_is_where_euler_begins_to_grow() -> None:
    network = Network()
    network.add_neuron("shunting", Neuron(bias_nA=20.0), 20.0)
    network.add_neuron("shunted", Neuron(bias_nA=20.0))
    network.add_synapse("shunting", "shunted", Synapse(19.0, 0.0))

    def last(factor: float) -> float:
        return network.compile(factor * network.stable_timestep_ms()).run(np.empty((400, 0)))[-1, 0, 1]

    assert network.stable_timestep_ms() == pytest.approx(0.5)
    assert last(0.98) == pytest.approx(1.0, abs=0.01)
    assert abs(last(1.05) - 1.0) > 1.0


def test_impossible_properties_are_refused_by_name(subtests: pytest.Subtests) -> None:
    for make, field in (
        (lambda: Neuron(capacitance_nF=0.0), "capacitance_nF"),
        (lambda: Neuron(leak_conductance_uS=-1.0), "leak_conductance_uS"),
        (lambda: Synapse(-0.1, 40.0), "conductance_uS"),
        (lambda: Synapse(0.1, 40.0, 5.0, 5.0), "saturation_mV"),
        (lambda: GapJunction(-0.1), "conductance_uS"),
        (lambda: Channel(-0.1, 40.0), "conductance_uS"),
        (lambda: Gate(0.1, time_constant_ms=0.0), "time_constant_ms"),
        (lambda: Gate(0.1, factor=-1.0), "factor"),
        (lambda: Gate(0.1, factor=0.0, time_constant_ms=10.0), "factor"),
        (lambda: Neuron(capacitance_nF=math.nan), "capacitance_nF"),
    ):
        with subtests.test(f"{make!r:.60}"), pytest.raises(ConfigError, match=field):
            make()

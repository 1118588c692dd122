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


@given(
    presynaptic=st.floats(-10, 40), conductance=st.floats(0, 2), reversal=st.floats(-60, 200), leak=st.floats(0.5, 2)
)
def test_synapse_steady_state(presynaptic, conductance, reversal, leak):
    network = Network()
    network.add_neuron("pre", Neuron(), presynaptic)
    network.add_neuron("post", Neuron(leak_conductance_uS=leak))
    network.add_synapse("pre", "post", Synapse(conductance, reversal))
    network.add_input("hold", "pre")
    trace = network.compile(1.0).run(np.full((400, 1), presynaptic))
    open_fraction = min(max(presynaptic / 20.0, 0.0), 1.0)
    g = conductance * open_fraction
    assert trace[-1, 0, 1] == pytest.approx(g * reversal / (leak + g), abs=1e-9)


def test_synapses_between_the_same_two_neurons_add_up():
    network = Network()
    network.add_neuron("pre", Neuron(bias_nA=30.0), 30.0)
    network.add_neuron("post", Neuron())
    network.add_synapse("pre", "post", Synapse(0.5, 100.0))
    network.add_synapse("pre", "post", Synapse(0.25, -40.0))
    trace = network.compile().run(np.empty((400, 0)))
    assert trace[-1, 0, 1] == pytest.approx((0.5 * 100.0 - 0.25 * 40.0) / 1.75, abs=1e-9)


def test_synapse_transmits_between_its_own_threshold_and_saturation():
    network = Network()
    network.add_neuron("pre", Neuron(rest_mV=-50.0))
    network.add_neuron("post", Neuron())
    network.add_synapse("pre", "post", Synapse(1.0, 60.0, threshold_mV=-60.0, saturation_mV=-20.0))
    trace = network.compile().run(np.empty((400, 0)))
    assert trace[-1, 0, 1] == pytest.approx(0.25 * 60.0 / 1.25, abs=1e-9)


@given(left=st.floats(-20, 20), right=st.floats(-20, 20), conductance=st.floats(0, 2))
def test_gap_junction_steady_state(left, right, conductance):
    network = Network()
    network.add_neuron("left", Neuron(bias_nA=left))
    network.add_neuron("right", Neuron(bias_nA=right))
    network.add_gap_junction("left", "right", GapJunction(conductance))
    trace = network.compile().run(np.empty((400, 0)))
    mean, half_difference = (left + right) / 2, (left - right) / 2 / (1 + 2 * conductance)
    assert trace[-1, 0] == pytest.approx([mean + half_difference, mean - half_difference], abs=1e-9)


@pytest.mark.parametrize(("left", "right", "conducts"), [(10.0, -10.0, True), (-10.0, 10.0, False)])
def test_rectified_gap_junction_conducts_from_source_to_target_only(left, right, conducts):
    network = Network()
    network.add_neuron("left", Neuron(bias_nA=left))
    network.add_neuron("right", Neuron(bias_nA=right))
    network.add_gap_junction("left", "right", GapJunction(0.5, rectified=True))
    trace = network.compile().run(np.empty((400, 0)))
    expected = [left / 2, right / 2] if conducts else [left, right]
    assert trace[-1, 0] == pytest.approx(expected, abs=1e-9)


@given(
    slope=st.floats(-0.2, 0.2), midpoint=potentials, factor=st.floats(0.1, 5), tau=st.floats(50, 500), held=potentials
)
def test_slow_gate_relaxes_with_its_stated_time_constant(slope, midpoint, factor, tau, held):
    gate = Gate(slope, midpoint, factor, time_constant_ms=tau)
    network = Network()
    # No conductance: the gate moves, the potential stays.
    network.add_neuron("a", Neuron(rest_mV=held, channels=(Channel(0.0, 0.0, (gate,)),)))
    stepper = network.compile(0.01)
    state = stepper.initial_state()
    state.gate[...] = 0.25
    stepper.advance(state)
    weight = factor * math.exp(slope * (midpoint - held))
    z_inf = 1 / (1 + weight)
    time_constant = tau * z_inf * math.sqrt(weight)
    assert state.gate[0, 0, 0] == pytest.approx(0.25 + 0.01 * (z_inf - 0.25) / time_constant, rel=1e-9)


@given(powers=st.tuples(st.integers(1, 4), st.integers(1, 3)), held=potentials)
def test_channel_current_multiplies_powers_of_its_gates(powers, held):
    opening = Gate(0.1, 20.0, 2.0, power=powers[0])
    closing = Gate(-0.05, 0.0, 0.5, power=powers[1], time_constant_ms=300.0)
    channel = Channel(0.7, 110.0, (opening, closing))
    # A second channel without slow gate shares the arrays: its empty slot must count as 1.
    plain = Channel(0.3, -30.0, (Gate(0.02, 5.0),))
    network = Network()
    network.add_neuron("a", Neuron(channels=(channel, plain)), held)
    stepper = network.compile(0.1)
    state = stepper.initial_state()
    stepper.advance(state)
    m = 1 / (1 + 2 * math.exp(0.1 * (20 - held)))
    h = 1 / (1 + 0.5 * math.exp(0.05 * held))
    q = 1 / (1 + math.exp(0.02 * (5 - held)))
    current = -held + 0.7 * m ** powers[0] * h ** powers[1] * (110 - held) + 0.3 * q * (-30 - held)
    assert state.potential[0, 0] == pytest.approx(held + 0.1 / 5.0 * current, rel=1e-9, abs=1e-9)


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


@pytest.mark.parametrize(
    ("make", "field"),
    [
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
    ],
)
def test_impossible_properties_are_refused_by_name(make, field):
    with pytest.raises(ConfigError, match=field):
        make()

"""Functional subnetworks: steady states against their closed forms, and those against the ideal operations."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid.nervous import (
    Network,
    Neuron,
    Signals,
    Synapse,
    addition,
    differentiation,
    division,
    integration,
    multiplication,
    subtraction,
    transmission,
)

R = 20.0
signal = st.floats(0.0, R)
carriers = st.builds(
    Signals,
    range_mV=st.just(R),
    leak_conductance_uS=st.floats(0.5, 2.0),
    excitatory_mV=st.floats(100.0, 1000.0),
    inhibitory_mV=st.floats(-200.0, -30.0),
)


def settled(network: Network, signals: Signals, **values: float) -> float:
    """The last output once everything is at rest, for input potentials given by name."""
    step = 0.4 * network.stable_timestep_ms()
    assert set(values) <= set(network.inputs)
    current = np.array([signals.leak_conductance_uS * values.get(name, 0.0) for name in network.inputs])
    stepper = network.compile(step)
    state = stepper.initial_state()
    slowest = max(n.capacitance_nF / n.leak_conductance_uS for n in network.neurons.values())
    for _ in range(math.ceil(30 * slowest / step)):
        stepper.advance(state, current)
    return float(stepper.outputs(state)[0, -1])


def gamma_of(s: Signals, gain: float = 1.0) -> float:
    return gain * R / (s.excitatory_mV - gain * R)


@settings(max_examples=25)
@given(s=carriers, u=signal, gain=st.floats(0.2, 3.0))
def test_transmission_is_exact_at_both_ends_and_known_in_between(s, u, gain):
    def through(potential):
        network = addition((gain,), s)
        return settled(network, s, term_1=potential)

    e = s.excitatory_mV
    assert through(R) == pytest.approx(gain * R, abs=1e-8)
    assert through(u) - gain * u == pytest.approx(gain**2 * u * (R - u) / (e - gain * (R - u)), abs=1e-8)


@settings(max_examples=25)
@given(s=carriers, first=signal, second=signal, gain=st.floats(0.2, 0.5))
def test_addition(s, first, second, gain):
    total = gain * (first + second)
    got = settled(addition((gain, gain), s), s, term_1=first, term_2=second)
    e, reach = s.excitatory_mV, gain * R
    assert got == pytest.approx(e * total / (e - reach + total), abs=1e-8)
    assert got - total == pytest.approx(total * (reach - total) / (e - reach + total), abs=1e-8)


@settings(max_examples=25)
@given(s=carriers, plus=signal, minus=signal, gain=st.floats(0.2, 2.0))
def test_subtraction(s, plus, minus, gain):
    network = subtraction(gain, s)
    got = settled(network, s, plus=plus, minus=minus)
    g_plus, g_minus = (c.kind.conductance_uS / s.leak_conductance_uS for c in network.connections)  # type: ignore[union-attr]
    ideal = gain * (plus - minus)
    factor = (1 + g_plus) / (1 + g_plus * plus / R + g_minus * minus / R)
    assert got == pytest.approx(ideal * factor, abs=1e-8)
    assert factor >= (1 + g_plus) / (1 + g_plus + g_minus) - 1e-12
    assert settled(network, s, plus=plus, minus=plus) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=25)
@given(s=carriers, dividend=signal, divisor=signal, ratio=st.floats(0.05, 0.9))
def test_division(s, dividend, divisor, ratio):
    network = division(ratio, s)
    ideal = dividend / (1 + (1 / ratio - 1) * divisor / R)
    got = settled(network, s, dividend=dividend, divisor=divisor)
    gamma = gamma_of(s)
    expected = dividend / ((1 + gamma * dividend / R) / (1 + gamma) + (1 / ratio - 1) * divisor / R)
    assert got == pytest.approx(expected, abs=1e-8)
    assert ideal - 1e-8 <= got <= (1 + gamma) * ideal + 1e-8
    assert settled(network, s, dividend=R, divisor=R) == pytest.approx(ratio * R, abs=1e-8)


@settings(max_examples=25)
@given(s=carriers, first=signal, second=signal, residue=st.floats(0.3, 4.0))
def test_multiplication(s, first, second, residue):
    network = multiplication(residue, s)
    got = settled(network, s, factor_1=first, factor_2=second)
    ideal, share = first * second / R, second / R
    whole = settled(network, s, factor_1=R, factor_2=second)
    assert whole - second == pytest.approx(residue * (1 - share), abs=1e-8)
    assert ideal - 1e-8 <= got <= (ideal + residue * first / R * (1 - share)) * (1 + gamma_of(s)) + 1e-8


@pytest.mark.parametrize(("slope", "amplification"), [(0.1, 1.0), (-0.05, 1.0), (0.05, 2.0)])
def test_differentiation_of_a_ramp(slope, amplification):
    s, gain, step = Signals(), 50.0, 0.5
    network = differentiation(gain, 2.0, amplification, s)
    t = step * np.arange(1200)
    ramp = (2.0 if slope > 0 else 40.0) + slope * t
    trace = network.compile(step).run(ramp[:, np.newaxis])[:, 0]
    inside = 1100 if slope < 0 else round((18.0 - 2.0) / slope / step)
    inside = min(inside, 1190)
    fast, slow, rate = trace[inside]
    assert fast - slow == pytest.approx(slope * gain / amplification, rel=0.03 if inside < 500 else 1e-3)
    plus, minus = (c.kind for c in network.connections)
    assert isinstance(plus, Synapse)
    assert isinstance(minus, Synapse)
    # The output trails the difference by its own 5 ms, during which a steady ramp changes the conductances little.
    a, b = fast / R, slow / R
    balance = plus.conductance_uS * 194.0 * (a - b)
    expected = balance / (1.0 + plus.conductance_uS * a + minus.conductance_uS * b)
    assert rate == pytest.approx(expected, rel=0.05)
    assert np.sign(rate) == np.sign(slope)


@settings(max_examples=20)
@given(s=carriers, rate=st.floats(2e-4, 5e-3), share=st.floats(0.05, 0.9))
def test_integration_is_exact_in_the_difference_and_holds(s, rate, share):
    network = integration(rate, s)
    capacitance, leak = network.neurons["integral"].capacitance_nF, s.leak_conductance_uS
    step = 0.05 * capacitance / leak
    # Through the given share of the difference's range of 2 R in 2,000 steps: slowly beside the membrane.
    current = share * 2 * R * capacitance / (2000 * step)
    inputs = np.zeros((2600, 1))
    inputs[:2000] = current
    trace = network.compile(step).run(inputs)[:, 0]
    difference = trace[:, 0] - trace[:, 1]
    steps = np.minimum(np.arange(2601), 2000)
    np.testing.assert_allclose(difference + R, steps * step * current / capacitance, atol=1e-9)
    integral, opposite = trace[-1]
    eta = R / -s.inhibitory_mV
    assert R - integral - opposite == pytest.approx(eta * integral * opposite / R, abs=1e-6 * R)


def test_integral_crosses_its_range_at_the_mean_rate_and_stays_at_the_end():
    network = integration(0.001)
    current, step = 0.5, 20.0
    n = round(R / (0.001 * current * step))
    stepper = network.compile(step)
    state = stepper.initial_state()
    trace = stepper.run(np.full((n, 1), current), state)[:, 0, 0]
    assert trace[-1] == pytest.approx(R, rel=0.02)
    stepper.run(np.full((n, 1), current), state)
    stepper.run(np.zeros((1000, 1)), state)
    assert state.potential[0] == pytest.approx([R, 0.0], abs=1e-3)


def test_subnetworks_join_in_one_network_under_prefixes():
    s = Signals()
    network = addition((0.5, 0.5), s, prefix="a_")
    assert subtraction(1.0, s, network, prefix="b_") is network
    network.add_synapse("a_sum", "b_plus", transmission(1.0, s))
    got = settled(network, s, a_term_1=20.0, a_term_2=20.0, b_minus=0.0)
    e, total = s.excitatory_mV, 20.0
    total = e * total / (e - 10.0 + total)
    for _ in range(2):
        total = total * e / (e - (R - total))
    assert got == pytest.approx(total, abs=1e-8)
    with pytest.raises(ConfigError, match="a_term_1"):
        addition((1.0,), s, network, prefix="a_")


def test_stable_timestep_is_where_euler_begins_to_grow():
    def last(factor):
        network = division(0.05)
        stepper = network.compile(factor * network.stable_timestep_ms())
        state = stepper.initial_state()
        for _ in range(400):
            stepper.advance(state, np.array([20.0, 20.0]))
        return stepper.outputs(state)[0, 0]

    assert last(0.98) == pytest.approx(1.0, abs=0.01)
    assert abs(last(1.05) - 1.0) > 1.0
    joined = Network()
    joined.add_neuron("a", Neuron(capacitance_nF=3.0, leak_conductance_uS=1.5))
    assert joined.stable_timestep_ms() == pytest.approx(4.0)


def test_impossible_operations_are_refused(subtests: pytest.Subtests) -> None:
    for make, message in (
        (lambda: transmission(0.0), "gain"),
        (lambda: transmission(9.8), "excitatory_mV / range_mV = 9.7"),
        (lambda: addition(()), "gains"),
        (lambda: division(1.0), "ratio"),
        (lambda: multiplication(20.0), "residue_mV"),
        (lambda: differentiation(gain_ms=-1.0), "gain_ms"),
        (lambda: integration(0.0), "rate_mV_per_nA_ms"),
        (lambda: Signals(inhibitory_mV=1.0), "inhibitory_mV"),
        (lambda: Signals(excitatory_mV=20.0), "excitatory_mV"),
        (lambda: Signals(range_mV=0.0), "range_mV"),
    ):
        with subtests.test(f"{make!r:.60}"), pytest.raises(ConfigError, match=message):
            make()

"""Spiking neurons and synapses, electrical and modulatory synapses, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid.nervous import (
    Firing,
    ModulatorySynapse,
    Network,
    Neuron,
    Scheme,
    SpikingSynapse,
    export_network,
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


def test_impossible_properties_are_refused(subtests: pytest.Subtests) -> None:
    for make, field in (
        (lambda: Firing(1.0, 1.0), "reset_mV"),
        (lambda: Firing(adaptation_time_constant_ms=0.0), "adaptation_time_constant_ms"),
        (lambda: SpikingSynapse(-1.0, 0.0), "conductance_uS"),
        (lambda: SpikingSynapse(1.0, 0.0, 0.0), "time_constant_ms"),
        (lambda: SpikingSynapse(1.0, 0.0, increment=1.5), "increment"),
        (lambda: ModulatorySynapse("leek", 2.0), "did you mean 'leak'"),  # type: ignore[arg-type]
        (lambda: ModulatorySynapse("leak", 0.0), "factor"),
        (lambda: ModulatorySynapse("leak", 2.0, 5.0, 5.0), "saturation_mV"),
    ):
        with subtests.test(f"{make!r:.60}"), pytest.raises(ConfigError, match=field):
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

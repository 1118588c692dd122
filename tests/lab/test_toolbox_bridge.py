"""Networks carried to SNS-Toolbox and back give the same traces there and here."""

import sys
from importlib import import_module
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from annelid.errors import ConfigError, MissingDependency
from annelid.nervous import Channel, GapJunction, Gate, Network, Neuron, Synapse, peristalsis_network, persistent_sodium
from annelid_lab.sns_toolbox import export_network, import_network


def imported(name: str) -> Any:
    """A module of SNS-Toolbox, which needs no more of torch for its numpy backend than that there is one."""
    with pytest.MonkeyPatch.context() as patched:
        if find_spec("torch") is None:
            patched.setitem(sys.modules, "torch", SimpleNamespace(Tensor=type("Tensor", (), {})))
        return import_module(f"sns_toolbox.{name}")


connections: Any = None
networks: Any = None
neurons: Any = None
try:
    connections, networks, neurons = map(imported, ("connections", "networks", "neurons"))
    missing = ""
except ImportError as error:
    missing = str(error)

needs_toolbox = pytest.mark.skipif(
    bool(missing),
    reason=f"SNS-Toolbox cannot be imported ({missing}); pip install --no-deps sns-toolbox runs these tests",
)

TOLERANCE_MV = 1e-8


def toolbox_trace(network, inputs, timestep_ms):
    model = network.compile(dt=timestep_ms, backend="numpy")
    trace = [model.V.copy()]
    for row in inputs:
        model(row)
        trace.append(model.V.copy())
    return np.array(trace)


def our_trace(network, inputs, timestep_ms):
    stepper = network.compile(timestep_ms, "toolbox")
    return stepper.run(inputs, stepper.initial_state("toolbox"))[:, 0]


def assert_same_traces(network, toolbox_network, inputs, timestep_ms, least_motion_mV=0.5):
    ours = our_trace(network, inputs, timestep_ms)
    theirs = toolbox_trace(toolbox_network, inputs, timestep_ms)
    assert np.ptp(ours, axis=0).max() > least_motion_mV
    assert np.max(np.abs(ours - theirs)) <= TOLERANCE_MV


def stretch_inputs(n, steps):
    on = np.random.default_rng(2).random((steps // 100, n)).repeat(100, axis=0) < 0.5
    kick = np.zeros((steps, 1))
    kick[0] = 1.0
    return np.hstack([20.0 * on, kick])


@needs_toolbox
def test_peristalsis_network_exported_and_back() -> None:
    n = 3
    network = peristalsis_network(n)
    exported = export_network(network)
    inputs = stretch_inputs(n, 2000)
    assert_same_traces(network, exported, inputs, 1.0)
    again = import_network(exported)
    assert list(again.neurons) == list(network.neurons)
    assert again.inputs == network.inputs
    assert again.outputs == network.outputs
    assert_same_traces(again, exported, inputs, 1.0)


@needs_toolbox
def test_everything_we_can_say_survives_the_export():
    three_gates = Channel(
        0.4,
        -30.0,
        (
            Gate(0.04, 10.0, 1.3, power=2.0),
            Gate(-0.03, 5.0, 0.8, power=3.0, time_constant_ms=80.0),
            Gate(0.06, 0.0, time_constant_ms=150.0),
        ),
    )
    no_instant_gate = Channel(0.2, 60.0, (Gate(-0.05, 2.0, time_constant_ms=120.0),))
    network = Network("mixed")
    network.add_neuron("plain", Neuron(4.0, 0.5, rest_mV=-3.0, bias_nA=1.5), 2.0)
    network.add_neuron("sodium", Neuron(5.0, 1.0, channels=(persistent_sodium(0.9),)), 12.0)
    network.add_neuron("both", Neuron(6.0, 2.0, channels=(three_gates, no_instant_gate)), -5.0)
    network.add_synapse("plain", "sodium", Synapse(0.3, 100.0, -10.0, 15.0))
    network.add_synapse("sodium", "plain", Synapse(0.6, -40.0))
    network.add_synapse("both", "both", Synapse(0.1, 50.0))
    network.add_gap_junction("plain", "both", GapJunction(0.2))
    network.add_gap_junction("sodium", "both", GapJunction(0.15, rectified=True))
    network.add_input("a", "plain")
    network.add_input("b", "both")
    network.add_output("o", "sodium")
    exported = export_network(network)
    inputs = np.random.default_rng(0).uniform(-15, 15, (2000, 2))
    assert_same_traces(network, exported, inputs, 0.5)
    assert_same_traces(import_network(exported), exported, inputs, 0.5)


@needs_toolbox
def test_populations_patterns_and_matrices_are_imported():
    net = networks.Network(name="populations")
    neuron = neurons.NonSpikingNeuron(membrane_capacitance=3.0, membrane_conductance=2.0, bias=1.0)
    gated = neurons.NonSpikingNeuronWithPersistentSodiumChannel()
    net.add_population(neuron, [4], name="row", initial_value=np.array([1.0, 5.0, 9.0, 20.0]))
    net.add_population(neuron, [2, 2], name="grid")
    net.add_neuron(gated, name="cell", initial_value=15.0)
    net.add_neuron(neuron, name="cell")
    net.add_connection(connections.NonSpikingSynapse(1.2, 90.0), "row", "grid")
    net.add_connection(
        connections.NonSpikingMatrixConnection(
            np.random.default_rng(3).random((4, 4)), np.full((4, 4), -40.0), np.zeros((4, 4)), np.full((4, 4), 20.0)
        ),
        "grid",
        "row",
    )
    kernel = np.ones((3, 3))
    net.add_connection(
        connections.NonSpikingPatternConnection(0.1 * kernel, 50.0 * kernel, 0.0 * kernel, 20.0 * kernel),
        "grid",
        "grid",
    )
    net.add_connection(connections.ElectricalSynapse(0.3), 2, 3)
    net.add_connection(connections.ElectricalSynapse(0.2, rect=True), 3, 1)
    net.add_input("row", size=4, name="drive")
    net.add_input("grid")
    net.add_input("cell")
    net.add_output("grid", name="read")
    net.add_output("row")
    inputs = np.random.default_rng(4).uniform(-5, 30, (2500, 6))
    network = import_network(net)
    assert list(network.neurons)[-3:] == ["grid_3", "cell", "cell_2"]
    assert list(network.inputs) == ["drive", "drive_2", "drive_3", "drive_4", "Input", "Input_2"]
    assert_same_traces(network, net, inputs, 0.4)

    stepper = network.compile(0.4, "toolbox")
    state = stepper.initial_state("toolbox")
    model = net.compile(dt=0.4, backend="numpy")
    for row in inputs[:300]:
        stepper.advance(state, row)
        np.testing.assert_allclose(stepper.outputs(state)[0], model(row), rtol=0, atol=TOLERANCE_MV)


@needs_toolbox
def test_arithmetic_networks_of_the_toolbox(subtests: pytest.Subtests) -> None:
    for name, arguments, n_inputs in (
        ("AdditionNetwork", {"gains": [1.0, -0.5, 2.0]}, 3),
        ("MultiplicationNetwork", {}, 2),
        ("DivisionNetwork", {"gain": 1.0, "ratio": 0.2}, 2),
        ("DifferentiatorNetwork", {}, 1),
        ("IntegratorNetwork", {}, 1),
    ):
        with subtests.test(f"{name!r:.60}"):
            net = getattr(networks, name)(**arguments)
            first = 1 if name == "AdditionNetwork" else 0
            for i in range(first, first + n_inputs):
                net.add_input(i)
            inputs = np.random.default_rng(5).uniform(0, 20, (20, n_inputs)).repeat(100, axis=0)
            assert_same_traces(import_network(net), net, inputs, 0.5)


@needs_toolbox
def test_what_cannot_come_over_is_refused() -> None:
    net = networks.Network(name="spikes")
    net.add_neuron(neurons.SpikingNeuron())
    with pytest.raises(ConfigError, match="'spikes' has spiking"):
        import_network(net)
    net = networks.Network(name="integrator")
    net.add_neuron(neurons.NonSpikingNeuron(membrane_conductance=0.0), name="a")
    with pytest.raises(ConfigError, match="'a' has no leak"):
        import_network(net)
    with pytest.raises(ConfigError, match="not Network"):
        import_network(peristalsis_network(3))


def two_neurons(**properties) -> Network:
    network = Network()
    network.add_neuron("a", Neuron(**properties))
    network.add_neuron("b", Neuron())
    return network


def with_two_synapses() -> Network:
    network = two_neurons()
    network.add_synapse("a", "b", Synapse(1.0, 40.0))
    network.add_synapse("a", "b", Synapse(1.0, -40.0))
    return network


def with_two_junctions() -> Network:
    network = two_neurons()
    network.add_gap_junction("a", "b", GapJunction(1.0))
    network.add_gap_junction("b", "a", GapJunction(1.0))
    return network


def with_shared_input() -> Network:
    network = two_neurons()
    network.add_input("both", ["a", "b"])
    return network


@needs_toolbox
def test_what_the_toolbox_cannot_say_is_refused(subtests: pytest.Subtests) -> None:
    for make, message in (
        (Network, "no neurons"),
        (lambda: two_neurons(leak_conductance_uS=0.0), "no leak"),
        (lambda: two_neurons(channels=(Channel(1.0, 50.0, (Gate(0.1), Gate(0.2))),)), "2 instantaneous"),
        (with_two_synapses, "2 connections"),
        (with_two_junctions, "2 connections"),
        (with_shared_input, "drives 2 neurons"),
    ):
        with subtests.test(f"{make!r:.60}"), pytest.raises(ConfigError, match=message):
            export_network(make())


@pytest.mark.parametrize("bridge", [export_network, import_network])
def test_missing_toolbox_names_the_line_that_installs_it(bridge, monkeypatch):
    for name in ("sns_toolbox", "sns_toolbox.connections", "sns_toolbox.networks", "sns_toolbox.neurons"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingDependency, match=r"pip install 'annelid\[sns\]'"):
        bridge(peristalsis_network(3))

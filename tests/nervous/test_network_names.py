"""A network is built by name, and wrong names are answered in one sentence."""

import pytest

from annelid.errors import ConfigError
from annelid.nervous import GapJunction, Network, Neuron, Synapse


@pytest.fixture
def network() -> Network:
    network = Network("small")
    network.add_neuron("contraction", Neuron())
    network.add_neuron("expansion", Neuron(rest_mV=-3.0))
    network.add_input("drive", "contraction")
    network.add_output("read", "expansion")
    return network


@pytest.mark.parametrize(
    "add",
    [
        lambda n: n.add_synapse("contractoin", "expansion", Synapse(1.0, 40.0)),
        lambda n: n.add_synapse("expansion", "contractoin", Synapse(1.0, 40.0)),
        lambda n: n.add_gap_junction("contractoin", "expansion", GapJunction(1.0)),
        lambda n: n.add_input("i", ["expansion", "contractoin"]),
        lambda n: n.add_output("o", "contractoin"),
    ],
)
def test_unknown_neuron_suggests_the_nearest(network, add):
    with pytest.raises(ConfigError, match=r"unknown neuron 'contractoin': did you mean 'contraction'\?"):
        add(network)
    assert network.connections == []
    assert list(network.inputs) == ["drive"]
    assert list(network.outputs) == ["read"]


def test_duplicate_names_are_refused(subtests: pytest.Subtests, network) -> None:
    for add, kind in (
        (lambda n: n.add_neuron("expansion", Neuron()), "neuron 'expansion'"),
        (lambda n: n.add_input("drive", "expansion"), "input 'drive'"),
        (lambda n: n.add_output("read", "contraction"), "output 'read'"),
    ):
        with subtests.test(f"{add!r:.60}"), pytest.raises(ConfigError, match=f"{kind} exists already"):
            add(network)


def test_empty_network_is_refused():
    with pytest.raises(ConfigError, match="'nothing' has no neurons"):
        Network("nothing").compile()
    with pytest.raises(ConfigError, match="no neurons yet"):
        Network().add_input("i", "a")


def test_arrays_keep_names_and_order_and_cannot_be_written(network):
    arrays = network.arrays()
    assert arrays.neurons == ("contraction", "expansion")
    assert arrays.inputs == ("drive",)
    assert arrays.outputs == ("read",)
    assert arrays.initial_mV.tolist() == [0.0, -3.0]
    with pytest.raises(ValueError, match="read-only"):
        arrays.weights[0, 0] = 1.0

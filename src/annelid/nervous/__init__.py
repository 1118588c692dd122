"""Neurons, synapses, networks and the paper's peristalsis network; knows no engine and no body."""

from annelid.nervous.arrays import NetworkArrays
from annelid.nervous.network import Connection, Network
from annelid.nervous.neurons import Channel, Gate, Neuron, persistent_sodium
from annelid.nervous.peristalsis import (
    Conductances,
    PeristalsisParameters,
    neuron_names,
    peristalsis_network,
)
from annelid.nervous.stepper import GateStart, NetworkState, Scheme, Stepper
from annelid.nervous.synapses import GapJunction, Synapse
from annelid.nervous.toolbox import export_network, import_network

__all__ = [
    "Channel",
    "Conductances",
    "Connection",
    "GapJunction",
    "Gate",
    "GateStart",
    "Network",
    "NetworkArrays",
    "NetworkState",
    "Neuron",
    "PeristalsisParameters",
    "Scheme",
    "Stepper",
    "Synapse",
    "export_network",
    "import_network",
    "neuron_names",
    "peristalsis_network",
    "persistent_sodium",
]

"""Neurons, synapses, networks and the paper's peristalsis network; knows no engine and no body."""

from annelid.lazy import lazy
from annelid.nervous.arrays import NO_GATE, NetworkArrays
from annelid.nervous.functional_subnetworks import (
    Signals,
    addition,
    differentiation,
    division,
    integration,
    multiplication,
    subtraction,
    transmission,
)
from annelid.nervous.half_centre import (
    HalfCentre,
    add_half_centre,
    add_hold,
    find_period,
    half_centre_network,
    half_centre_of_period,
    oscillation_periods,
)
from annelid.nervous.network import Network
from annelid.nervous.neurons import (
    Channel,
    ConnectionKind,
    GapJunction,
    Gate,
    Neuron,
    Synapse,
    persistent_sodium,
)
from annelid.nervous.peristalsis import (
    Conductances,
    PeristalsisParameters,
    adaptive_half_centre,
    adaptive_peristalsis_network,
    drive_conductance_uS,
    neuron_names,
    peristalsis_network,
)
from annelid.nervous.stepper import GateStart, NetworkState, Scheme, Stepper
from annelid.nervous.toml import network_of_tables, network_tables
from annelid.nervous.wiring import Connection

__all__ = [
    "NO_GATE",
    "Channel",
    "Conductances",
    "Connection",
    "ConnectionKind",
    "GapJunction",
    "Gate",
    "GateStart",
    "HalfCentre",
    "Network",
    "NetworkArrays",
    "NetworkState",
    "Neuron",
    "PeristalsisParameters",
    "Scheme",
    "Signals",
    "Stepper",
    "Synapse",
    "adaptive_half_centre",
    "adaptive_peristalsis_network",
    "add_half_centre",
    "add_hold",
    "addition",
    "differentiation",
    "division",
    "drive_conductance_uS",
    "find_period",
    "half_centre_network",
    "half_centre_of_period",
    "integration",
    "multiplication",
    "network_of_tables",
    "network_tables",
    "neuron_names",
    "oscillation_periods",
    "peristalsis_network",
    "persistent_sodium",
    "subtraction",
    "transmission",
]
_SPIKES = "neurons are graded: use a Synapse"
_MODULATION = "nothing is modulated: excite or inhibit by a Synapse"
__getattr__, __dir__ = lazy(
    __name__,
    {
        "Firing": _SPIKES,
        "SpikingSynapse": _SPIKES,
        "Diagram": "annelid.draw.network_figure draws a network, and its method table() has the conductances",
        "Factors": _MODULATION,
        "Modulated": _MODULATION,
        "ModulatorySynapse": _MODULATION,
    },
    ("annelid_studies.oscillators", "annelid_lab.sns_toolbox"),
)

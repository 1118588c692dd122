"""Neurons, synapses, networks and the paper's peristalsis network; knows no engine and no body."""

from annelid.lazy import moved
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
    Firing,
    GapJunction,
    Gate,
    Modulated,
    ModulatorySynapse,
    Neuron,
    SpikingSynapse,
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
from annelid.nervous.stepper import Factors, GateStart, NetworkState, Scheme, Stepper
from annelid.nervous.toml import network_of_tables, network_tables
from annelid.nervous.wiring import Connection

__all__ = [
    "NO_GATE",
    "Channel",
    "Conductances",
    "Connection",
    "ConnectionKind",
    "Factors",
    "Firing",
    "GapJunction",
    "Gate",
    "GateStart",
    "HalfCentre",
    "Modulated",
    "ModulatorySynapse",
    "Network",
    "NetworkArrays",
    "NetworkState",
    "Neuron",
    "PeristalsisParameters",
    "Scheme",
    "Signals",
    "SpikingSynapse",
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
__getattr__ = moved(__name__, "annelid_studies.oscillators", "annelid_lab.sns_toolbox")

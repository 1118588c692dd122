"""Neurons, synapses, networks and the paper's peristalsis network; knows no engine and no body."""

from annelid.nervous.arrays import NetworkArrays
from annelid.nervous.diagram import Diagram
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
from annelid.nervous.phase_chain import DriveResponse, PhaseNetwork, PhaseState, PhaseStepper, phase_chain, steady_lags
from annelid.nervous.shc import (
    HeteroclinicRing,
    HeteroclinicStepper,
    bias_dwell_s,
    handover_input,
    largest_gain_per_s,
    noise_dwell_s,
)
from annelid.nervous.stepper import GateStart, NetworkState, Scheme, Stepper
from annelid.nervous.toolbox import export_network, import_network
from annelid.nervous.wiring import Connection

__all__ = [
    "Channel",
    "Conductances",
    "Connection",
    "ConnectionKind",
    "Diagram",
    "DriveResponse",
    "Firing",
    "GapJunction",
    "Gate",
    "GateStart",
    "HalfCentre",
    "HeteroclinicRing",
    "HeteroclinicStepper",
    "ModulatorySynapse",
    "Network",
    "NetworkArrays",
    "NetworkState",
    "Neuron",
    "PeristalsisParameters",
    "PhaseNetwork",
    "PhaseState",
    "PhaseStepper",
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
    "bias_dwell_s",
    "differentiation",
    "division",
    "drive_conductance_uS",
    "export_network",
    "find_period",
    "half_centre_network",
    "half_centre_of_period",
    "handover_input",
    "import_network",
    "integration",
    "largest_gain_per_s",
    "multiplication",
    "neuron_names",
    "noise_dwell_s",
    "oscillation_periods",
    "peristalsis_network",
    "persistent_sodium",
    "phase_chain",
    "steady_lags",
    "subtraction",
    "transmission",
]

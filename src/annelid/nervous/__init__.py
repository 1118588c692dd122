"""Neurons, synapses, networks and the paper's peristalsis network; knows no engine and no body."""

from annelid.lazy import lazy
from annelid.nervous.arrays import NO_GATE, NetworkArrays
from annelid.nervous.half_centre import HalfCentre, add_half_centre, add_hold
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
    adaptive_peristalsis_network,
    drive_conductance_uS,
    neuron_names,
    peristalsis_network,
)
from annelid.nervous.stepper import GateStart, NetworkState, Scheme, Stepper
from annelid.nervous.toml import network_tables
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
    "Stepper",
    "Synapse",
    "adaptive_peristalsis_network",
    "add_half_centre",
    "add_hold",
    "drive_conductance_uS",
    "network_tables",
    "neuron_names",
    "peristalsis_network",
    "persistent_sodium",
]
_SPIKES = "neurons are graded: use a Synapse"
_MODULATION = "nothing is modulated: excite or inhibit by a Synapse"
_ARITHMETIC = (
    "SNS-Toolbox has such networks (sns_toolbox.networks), and annelid_lab.sns_toolbox.import_network takes them"
)
_PERIODS = "build one by add_half_centre, and vary gate_time_constant_ms"
_SIGNALS = "HalfCentre has the range, the reversal potentials and transmission(gain)"
__getattr__, __dir__ = lazy(
    __name__,
    {
        "Firing": _SPIKES,
        "SpikingSynapse": _SPIKES,
        "Diagram": "annelid.draw.network_figure draws a network, and its method to_toml() has the conductances",
        "Factors": _MODULATION,
        "Modulated": _MODULATION,
        "adaptive_half_centre": "adaptive_peristalsis_network has such half-centres",
        "network_of_tables": "Network.from_toml builds a network from its text",
        "ModulatorySynapse": _MODULATION,
        **dict.fromkeys(
            ("addition", "subtraction", "division", "multiplication", "differentiation", "integration"), _ARITHMETIC
        ),
        **dict.fromkeys(
            ("half_centre_network", "half_centre_of_period", "oscillation_periods", "find_period"), _PERIODS
        ),
        **dict.fromkeys(("Signals", "transmission"), _SIGNALS),
    },
    ("annelid_studies.oscillators", "annelid_lab.sns_toolbox"),
)

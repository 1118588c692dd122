"""The robust peristalsis network under a descending drive: pressed backs make its wave faster.

A descending neuron with activity a = clip(U_d / R, 0, 1), the drive, excites the relays of all segments alike, with a
conductance a g_d. In every segment a pressure neuron, which low-passes the pressure on the back, excites the descending
neuron: pressure on belly and back at once is what a worm feels in a pipe as narrow as itself, and never on open ground.
This is our own derivation.

**Lift.** A resting relay is lifted to ``a g_d E_ex / (Gm + a g_d)``; g_d is chosen so that drive 1 lifts it to the
share ``lift`` of R. Relays act from R / 2 on, so with ``lift`` < 1/2 the drive alone never makes a segment contract:
who is next, and that one is next at a time, stays the business of contraction neurons and charged relays, which count
their turns faster (closed form: `tests/nervous/test_driven.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

from annelid.errors import ConfigError, require_positive
from annelid.nervous.adaptive import DRIVE_NEURON
from annelid.nervous.functional_subnetworks import transmission
from annelid.nervous.network import Network
from annelid.nervous.neurons import Neuron
from annelid.nervous.robust import THRESHOLD, RobustParameters, robust_network
from annelid.nervous.synapses import Synapse

MOTOR = "motor"
"""What the names of the motor neurons begin with."""
_CHARGE = 9.0
"""Conductance that charges a motor neuron, over its leak: it rises ten times as fast as it falls."""
MOTOR_SHARE = _CHARGE / (1.0 + _CHARGE)
"""Share of R at which a motor neuron rests while its segment's contraction neuron is at R or above."""


def add_motor_neurons(network: Network, n_segments: int, parameters: RobustParameters, let_go_ms: float) -> None:
    """Adds a motor neuron to every segment, which outlasts the contraction neuron that excites it.

    It rises with a tenth of the time constant with which it lets go. So a segment is still contracted while the next
    ones contract: several share the wave, the more the shorter the turns are.

    Args:
        network: One that `robust_network` or `driven_robust_network` has built; ``motor_1`` .. ``motor_N`` come last.
        n_segments: Its segments.
        parameters: What it was designed from.
        let_go_ms: Time constant with which a motor neuron falls.
    """
    leak = parameters.leak_conductance_uS
    charge = Synapse(_CHARGE * leak, parameters.range_mV, 0.0, parameters.range_mV)
    for segment in range(1, n_segments + 1):
        network.add_neuron(f"{MOTOR}_{segment}", Neuron(let_go_ms * leak, leak))
        network.add_synapse(f"contraction_{segment}", f"{MOTOR}_{segment}", charge)


@dataclass(frozen=True)
class DriveParameters:
    """What the descending pathway is designed from.

    Attributes:
        lift: Share of R to which drive 1 lifts a resting relay.
        per_segment: Drive that one segment gives whose pressure neuron is at R.
        drive_time_constant_ms: Time constant of the descending neuron.
        pressure_time_constant_ms: Time constant of the pressure neurons.

    Raises:
        ConfigError: A lift outside 0 .. 0.5, without the ends; a share of a segment that is negative; or a time
            constant that is not positive.
    """

    lift: float = 0.45
    per_segment: float = 0.5
    drive_time_constant_ms: float = 200.0
    pressure_time_constant_ms: float = 200.0

    def __post_init__(self) -> None:
        require_positive(
            drive_time_constant_ms=self.drive_time_constant_ms,
            pressure_time_constant_ms=self.pressure_time_constant_ms,
        )
        if not 0.0 < self.lift < THRESHOLD:
            raise ConfigError(f"lift must be between 0 and {THRESHOLD:g}, not {self.lift}")
        if not self.per_segment >= 0:
            raise ConfigError(f"per_segment must not be negative, not {self.per_segment}")

    def relay_uS(self, parameters: RobustParameters) -> float:
        """g_d: conductance from the descending neuron to every relay."""
        return transmission(self.lift, parameters.signals).conductance_uS


def driven_robust_network(
    n_segments: int, parameters: RobustParameters | None = None, pathway: DriveParameters | None = None
) -> Network:
    """Builds the robust peristalsis network with a descending neuron and a pressure neuron in every segment.

    Args:
        n_segments: Number of segments, at least 3.
        parameters: Of the network.
        pathway: Of the descending neuron.

    Returns:
        `annelid.nervous.robust.robust_network` with the neurons ``descending``, ``pressure_1`` .. ``pressure_N`` and
        the inputs ``drive``, ``pressure_1`` .. ``pressure_N`` behind its own. ``Gm R`` nA holds such a neuron at R.

    Raises:
        ConfigError: As `robust_network`.
    """
    p = RobustParameters() if parameters is None else parameters
    d = DriveParameters() if pathway is None else pathway
    network, leak = robust_network(n_segments, p), p.leak_conductance_uS
    network.add_neuron(DRIVE_NEURON, Neuron(d.drive_time_constant_ms * leak, leak))
    network.add_input("drive", DRIVE_NEURON)
    relay = p.excitatory(d.relay_uS(p))
    share = p.excitatory(d.per_segment * leak * p.range_mV / p.excitatory_reversal_mV)
    for segment in range(1, n_segments + 1):
        pressure = f"pressure_{segment}"
        network.add_neuron(pressure, Neuron(d.pressure_time_constant_ms * leak, leak))
        network.add_input(pressure, pressure)
        network.add_synapse(pressure, DRIVE_NEURON, share)
        network.add_synapse(DRIVE_NEURON, f"relay_{segment}", relay)
    return network

"""A peristalsis network whose rhythm goes on whatever the sensors report: the paper's neurons, joined differently.

Each segment has the half-centre of the paper, a hold and a relay. In the paper's network stretch sensors keep segments
expanded, so that a sensor that is always on, or off too early, decides the order. Here, by our own design:

1. *Others suppress, not the sensor.* The hold of a segment is excited by the contraction neurons of all other segments,
   with synapses onto the half-centre that saturate, so that suppression is the same for any number of segments.
2. *A tonic neuron* excites the contraction neuron of segment 1 alone, so silence is unstable.
3. *The half-centre is bistable* (delta < 0): it remembers whose turn it is, however long the segment had rested.
4. *The relay counts the turn.* Its own segment's contraction neuron charges it slowly. At half of its range it ends the
   hold of the next segment and excites its contraction neuron; that contraction suppresses the present segment, and
   discharges the relay through a shunt, so that every turn begins alike.
5. *The sensor entrains.* A stretch neuron and its slow copy, the habit, push the relay with opposite sign through
   saturating synapses: a segment that is longer than it is used to hands over earlier, a shorter one later.

A charging relay follows ``U(t) = R (1 - exp(-t / tau))``, ``tau = C / (Gm + g)`` with the conductance g of its charge.
The hold yields at the relay's potential U* (`yield_mV`), so ``tau = turn / ln(R / (R - U*))``; what the half-centre
takes to flip comes on top, up to 2 % of the paper's 875 ms. Entrainment e keeps the relay's drive within
``(1 +- e) R``, and so a turn within about ``2 e / ln 2`` of itself: 6 % with e = 0.02.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, sqrt

from annelid.errors import ConfigError, require_at_least, require_negative, require_positive
from annelid.nervous.half_centre import HalfCentre, add_half_centre, add_hold
from annelid.nervous.network import Network
from annelid.nervous.neurons import Neuron, Synapse
from annelid.nervous.peristalsis import DRIVE_NEURON, add_drive

ROLES = ("contraction", "expansion", "hold", "relay", "stretch", "habit")
"""The six neurons of a segment, in order."""
TONIC_NEURON = "tonic"
# The relay ends the next segment's hold between this share of R and one window above.
THRESHOLD = 0.5
_WINDOW = 0.05
# The next contraction multiplies the relay's conductance by one more than this.
DISCHARGE = 4.0
# Conductance that charges a motor neuron, over its leak: it rises ten times as fast as it falls, and rests at this
# share of R while its segment's contraction neuron is at R or above.
_MOTOR_CHARGE = 9.0
MOTOR_SHARE = _MOTOR_CHARGE / (1.0 + _MOTOR_CHARGE)


PUSH_NA = 6.0
"""Current of a full relay into the next segment's contraction neuron at rest."""
ENTRAINMENT = 0.02
"""Share of the relay's drive that the sensor may add or take."""
HABIT_MS = 10_000.0
"""Time constant with which the sensor adapts."""


@dataclass(frozen=True)
class RobustParameters(HalfCentre):
    """What the network is designed from: its half-centres, which are bistable, and what was added to them.

    Attributes:
        turn_ms: Time from one segment's contraction to the next one's.

    Raises:
        ConfigError: As `HalfCentre`; a delta that is not negative, or a time that is not positive.
    """

    bifurcation_mV: float = -1.0
    turn_ms: float = 875.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_negative(bifurcation_mV=self.bifurcation_mV)
        require_positive(turn_ms=self.turn_ms)

    @property
    def charge_uS(self) -> float:
        """Conductance with which a contraction neuron at R brings its relay, or another's hold, to R."""
        return self.transmission().conductance_uS

    @property
    def release_uS(self) -> float:
        """Conductance with which a full relay cancels the excitation of a hold by one contraction neuron."""
        return self.cancelling_uS(self.charge_uS, self.range_mV)


def yielding_hold(p: RobustParameters, excitation_nA: float) -> float:
    """Activity a of the hold at which the contraction neuron of an expanded segment comes to inhibit its partner.

    Balance of the contraction neuron at 0 under an excitation I, with its partner at R and a steady gate:
    ``a g_hold E_inh + g_CPG E_inh + G_Na m(0) h(0) E_Na + I = 0``. The segment contracts without a hold if a is
    positive, and can be suppressed if it is below 1.
    """
    drive = excitation_nA + p.sodium_uS * p.sodium_channel.unit_current_mV(0.0)
    return (drive + p.inhibition_uS * p.inhibitory_reversal_mV) / (-p.hold_down_uS * p.inhibitory_reversal_mV)


def yield_opening(p: RobustParameters) -> float:
    """Open share b of the relay's synapses at which the next segment's contraction neuron passes 0.

    The hold, excited by one contraction neuron (g_1) and inhibited by the relay (b g_2), rests at
    ``(g_1 E_ex + b g_2 E_inh) / (Gm + g_1 + b g_2)``. That this is R times `yielding_hold` under the push ``b I`` is a
    quadratic equation for b.
    """
    reach, leak = p.range_mV, p.leak_conductance_uS + p.charge_uS
    alone = yielding_hold(p, 0.0)
    slope = yielding_hold(p, PUSH_NA) - alone
    square = reach * slope * p.release_uS
    linear = p.release_uS * (reach * alone - p.inhibitory_reversal_mV) + reach * slope * leak
    constant = reach * alone * leak - p.charge_uS * p.excitatory_reversal_mV
    return (-linear + sqrt(linear**2 - 4.0 * square * constant)) / (2.0 * square)


def yield_mV(p: RobustParameters) -> float:
    """Potential U* of the relay at which the next segment's hold yields, mV."""
    return p.range_mV * (THRESHOLD + _WINDOW * yield_opening(p))


def robust_network(n_segments: int, parameters: RobustParameters | None = None) -> Network:
    """Builds the robust peristalsis network in its initial state: segment 1 contracted, all others expanded.

    Its neurons are those of every segment by `ROLES`, then the tonic neuron. Inputs are ``stretch_1`` .. ``stretch_N``,
    currents into the stretch neurons and their habits; ``Gm R`` nA drives them to R. Outputs are ``contraction_s`` and
    ``expansion_s`` of every segment.

    Raises:
        ConfigError: Fewer than 3 segments, or parameters that give a negative conductance.
    """
    require_at_least(3, n_segments=n_segments)
    p = parameters or RobustParameters()
    segments, leak, reach = range(1, n_segments + 1), p.leak_conductance_uS, p.range_mV
    tau_ms = p.turn_ms / log(reach / (reach - yield_mV(p)))
    # Both carry the same current into a relay at rest, e Gm R, so that a steady stretch cancels.
    share_nA = ENTRAINMENT * leak * reach
    network = Network(f"robust peristalsis of {n_segments} segments")
    for segment in segments:
        contraction, expansion, hold, relay, stretch, habit = (f"{role}_{segment}" for role in ROLES)
        first = segment == 1
        held = (-p.offset_mV, reach + p.offset_mV)
        add_half_centre(network, contraction, expansion, p, (reach, p.bifurcation_mV) if first else held)
        network.add_neuron(hold, p.leaky_neuron, 0.0 if first else reach)
        network.add_neuron(relay, Neuron(tau_ms * (leak + p.charge_uS), leak), 0.0)
        network.add_neuron(stretch, p.leaky_neuron, 0.0)
        network.add_neuron(habit, Neuron(HABIT_MS * leak, leak), 0.0)
        add_hold(network, hold, down=contraction, up=expansion, half_centre=p)
        network.add_synapse(contraction, relay, p.excitatory(p.charge_uS))
        network.add_synapse(stretch, relay, p.excitatory(share_nA / p.excitatory_reversal_mV))
        network.add_synapse(habit, relay, p.inhibitory(-share_nA / p.inhibitory_reversal_mV))
    network.add_neuron(TONIC_NEURON, Neuron(p.capacitance_nF, leak, bias_nA=leak * reach), reach)
    # What a relay pushes with when the hold yields, so that the first segment takes its turn as all others do.
    tonic_nA = PUSH_NA * yield_opening(p)
    network.add_synapse(TONIC_NEURON, "contraction_1", p.excitatory(tonic_nA / p.excitatory_reversal_mV))
    # Below R / 2 nobody is suppressed: else many segments that all begin to contract could keep each other from it.
    suppression = Synapse(p.charge_uS, p.excitatory_reversal_mV, 0.5 * reach, reach)
    opening = THRESHOLD * reach, (THRESHOLD + _WINDOW) * reach
    release = Synapse(p.release_uS, p.inhibitory_reversal_mV, *opening)
    push = Synapse(PUSH_NA / p.excitatory_reversal_mV, p.excitatory_reversal_mV, *opening)
    discharge = Synapse(DISCHARGE * (leak + p.charge_uS), 0.0, 0.0, reach)
    for segment in segments:
        following = segment % n_segments + 1
        for other in segments:
            if other != segment:
                network.add_synapse(f"contraction_{segment}", f"hold_{other}", suppression)
        network.add_synapse(f"relay_{segment}", f"hold_{following}", release)
        if following != 1:
            network.add_synapse(f"relay_{segment}", f"contraction_{following}", push)
        network.add_synapse(f"contraction_{following}", f"relay_{segment}", discharge)
    for segment in segments:
        network.add_input(f"stretch_{segment}", (f"stretch_{segment}", f"habit_{segment}"))
        network.add_output(f"contraction_{segment}", f"contraction_{segment}")
        network.add_output(f"expansion_{segment}", f"expansion_{segment}")
    return network


def driven_robust_network(
    n_segments: int,
    parameters: RobustParameters | None = None,
    *,
    lift: float = 0.45,
    per_segment: float = 0.5,
    drive_ms: float = 200.0,
    pressure_ms: float = 200.0,
) -> Network:
    """Builds the robust network with a descending neuron and a pressure neuron in every segment.

    With activity a, the drive, the descending neuron excites all relays with a conductance ``a g_d``, which lifts a
    resting one to ``a g_d E_ex / (Gm + a g_d)``, below the half of R at which relays act: the drive alone never makes a
    segment contract, but charged relays count their turns faster. Pressure neurons, which low-pass the pressure on the
    backs, excite the descending one: belly and back are pressed at once only in a pipe as narrow as the worm.

    The neurons ``descending``, ``pressure_1`` .. ``pressure_N`` and the inputs ``drive``, ``pressure_1`` ..
    ``pressure_N`` come behind those of `robust_network`. ``Gm R`` nA keeps such a neuron at R.

    Args:
        n_segments: Number of segments, at least 3.
        parameters: Of the network.
        lift: Share of R, below 1/2, to which drive 1 lifts a resting relay.
        per_segment: Drive that one segment gives whose pressure neuron is at R.
        drive_ms: Time constant of the descending neuron, ms.
        pressure_ms: Time constant of the pressure neurons, ms.

    Raises:
        ConfigError: As `robust_network`, or a lift outside 0 .. 1/2.
    """
    if not 0.0 < lift < THRESHOLD:
        raise ConfigError(f"lift must be between 0 and {THRESHOLD:g}, not {lift}")
    p, segments = parameters or RobustParameters(), range(1, n_segments + 1)
    network, leak = robust_network(n_segments, p), p.leak_conductance_uS
    relays = (f"relay_{segment}" for segment in segments)
    add_drive(network, p, relays, p.transmission(lift).conductance_uS, drive_ms)
    share = p.excitatory(per_segment * leak * p.range_mV / p.excitatory_reversal_mV)
    for segment in segments:
        pressure = f"pressure_{segment}"
        network.add_neuron(pressure, Neuron(pressure_ms * leak, leak))
        network.add_input(pressure, pressure)
        network.add_synapse(pressure, DRIVE_NEURON, share)
    return network


def add_motor_neurons(network: Network, n_segments: int, p: RobustParameters, time_constant_ms: float) -> None:
    """Adds ``motor_1`` .. ``motor_N`` and outputs of the same names, which outlast the contraction neurons.

    They fall with the time constant and rise with a tenth of it. So a segment is still contracted while
    the next ones contract: several share the wave, the more the shorter the turns are.
    """
    leak = p.leak_conductance_uS
    charge = Synapse(_MOTOR_CHARGE * leak, p.range_mV, 0.0, p.range_mV)
    for segment in range(1, n_segments + 1):
        network.add_neuron(f"motor_{segment}", Neuron(time_constant_ms * leak, leak))
        network.add_synapse(f"contraction_{segment}", f"motor_{segment}", charge)
        network.add_output(f"motor_{segment}", f"motor_{segment}")

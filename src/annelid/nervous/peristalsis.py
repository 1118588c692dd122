"""The peristalsis network of Riddle et al. 2022 and 2023, for any number of segments.

Each segment has a half-centre, the contraction neuron (U1 in the papers) against the expansion neuron (U2), a
sensory neuron (U3) that its stretch sensor drives while the segment is at rest length, and a relay (U4) to
the next segment. A segment at rest holds itself expanded (U3 excites U2 and inhibits U1). Once the segment
before it is expanding again and not yet back at rest length, that one's relay silences its sensory neuron:
the hold ends, the half-centre escapes, and the segment contracts. The last relay closes the ring to the first.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

from annelid.errors import ConfigError, require_at_least, require_positive
from annelid.nervous.half_centre import HalfCentre, add_half_centre, add_hold
from annelid.nervous.network import Network
from annelid.nervous.neurons import Neuron

ROLES = ("contraction", "expansion", "sensory", "relay")
"""The four neurons of a segment, in order: U1, U2, U3, U4 of the papers."""


@dataclass(frozen=True)
class Conductances:
    """Derived conductances of the peristalsis network, uS; indices are those of the papers' neurons.

    Attributes:
        sodium: G_Na of the contraction and expansion neurons.
        half_centre: g_CPG, contraction and expansion neurons inhibiting each other.
        sensory_to_expansion: g32, excitatory.
        sensory_to_contraction: g31, inhibitory.
        expansion_to_relay: g24, excitatory.
        sensory_to_relay: g34, inhibitory.
        relay_to_next_sensory: g43, inhibitory, from segment to segment.
    """

    sodium: float
    half_centre: float
    sensory_to_expansion: float
    sensory_to_contraction: float
    expansion_to_relay: float
    sensory_to_relay: float
    relay_to_next_sensory: float

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value >= 0:
                raise ConfigError(
                    f"the design rules give the conductance {field.name} = {value:g} uS, which must not be "
                    "negative: bifurcation_mV and offset_mV must be small beside range_mV"
                )


@dataclass(frozen=True)
class PeristalsisParameters(HalfCentre):
    """What the peristalsis network is designed from: its half-centres, whose range and reversals serve all neurons.

    The defaults are those of Riddle et al. 2022. Delta must be positive: a segment whose hold has ended contracts only
    if its half-centre oscillates by itself.

    Raises:
        ConfigError: A parameter that is not positive, an inhibitory reversal that is not negative, or another
            reversal within the range that it has to drive a neuron through.
    """

    def __post_init__(self) -> None:
        require_positive(bifurcation_mV=self.bifurcation_mV)
        super().__post_init__()

    @cached_property
    def conductances(self) -> Conductances:
        """All conductances: those of `HalfCentre`, and of the relays, with unclipped transmission.

        With the expansion neuron at U2 = R + offset: g24 drives the relay to R while the sensory neuron is silent,
        ``-Gm R + g24 U2 / R (E_ex - R) = 0``; g34 cancels that drive while the sensory neuron is at R; g43 cancels the
        design current of a stretch sensor, ``Gm R + g43 E_inh = 0``.

        Raises:
            ConfigError: A rule gives a negative conductance for these parameters.
        """
        leak, reach, offset = self.leak_conductance_uS, self.range_mV, self.offset_mV
        relay_drive = leak * reach * reach / ((reach + offset) * (self.excitatory_reversal_mV - reach))
        return Conductances(
            sodium=self.sodium_uS,
            half_centre=self.inhibition_uS,
            sensory_to_expansion=self.hold_up_uS,
            sensory_to_contraction=self.hold_down_uS,
            expansion_to_relay=relay_drive,
            sensory_to_relay=self.cancelling_uS(relay_drive, reach + offset),
            relay_to_next_sensory=-(leak * reach) / self.inhibitory_reversal_mV,
        )


def neuron_names(n_segments: int) -> list[str]:
    """Returns the names of all neurons, segment by segment: contraction_1, expansion_1, sensory_1, relay_1, .."""
    return [f"{role}_{segment}" for segment in range(1, n_segments + 1) for role in ROLES]


def peristalsis_network(n_segments: int, parameters: PeristalsisParameters | None = None) -> Network:
    """Builds the peristalsis network in its initial state: segment 1 contracted, all others held expanded.

    Inputs are ``stretch_1`` .. ``stretch_N``, the stretch sensors' currents into the sensory neurons, and
    ``kick``, a current into the first contraction neuron. Outputs are ``contraction_s`` and ``expansion_s`` of
    every segment. Riddle et al. 2022, Fig. 2; Riddle et al. 2023, Fig. 6.

    Args:
        n_segments: Number of segments, at least 3.
        parameters: What to design it from; default: those of the papers.

    Returns:
        A network of ``4 n_segments`` neurons, named by `neuron_names`.

    Raises:
        ConfigError: Fewer than 3 segments, or parameters that give a negative conductance.
    """
    require_at_least(3, n_segments=n_segments)
    p = PeristalsisParameters() if parameters is None else parameters
    g = p.conductances
    leaky = Neuron(p.capacitance_nF, p.leak_conductance_uS)

    network = Network(f"peristalsis of {n_segments} segments")
    for segment in range(1, n_segments + 1):
        first = segment == 1
        contraction, expansion, sensory, relay = (f"{role}_{segment}" for role in ROLES)
        held = (-p.offset_mV, p.range_mV + p.offset_mV)
        add_half_centre(network, contraction, expansion, p, (p.range_mV, 0.0) if first else held)
        network.add_neuron(sensory, leaky, 0.0 if first else p.range_mV)
        network.add_neuron(relay, leaky, 0.0)
        add_hold(network, sensory, down=contraction, up=expansion, half_centre=p)
        network.add_synapse(sensory, relay, p.inhibitory(g.sensory_to_relay))
        network.add_synapse(expansion, relay, p.excitatory(g.expansion_to_relay))
    for segment in range(1, n_segments + 1):
        following = segment % n_segments + 1
        network.add_synapse(f"relay_{segment}", f"sensory_{following}", p.inhibitory(g.relay_to_next_sensory))
    for segment in range(1, n_segments + 1):
        network.add_input(f"stretch_{segment}", f"sensory_{segment}")
        network.add_output(f"contraction_{segment}", f"contraction_{segment}")
        network.add_output(f"expansion_{segment}", f"expansion_{segment}")
    network.add_input("kick", "contraction_1")
    return network

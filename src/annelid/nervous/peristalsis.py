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

from annelid.errors import ConfigError
from annelid.nervous import design
from annelid.nervous.network import Network
from annelid.nervous.neurons import Channel, Neuron, persistent_sodium
from annelid.nervous.synapses import Synapse

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
class PeristalsisParameters:
    """What the peristalsis network is designed from; the defaults are those of Riddle et al. 2022.

    Attributes:
        capacitance_nF: Membrane capacitance C.
        leak_conductance_uS: Leak conductance Gm.
        range_mV: Operating range R.
        bifurcation_mV: delta, where a fully inhibited half-centre neuron comes to rest.
        offset_mV: How far beyond 0 and R a held half-centre lies.
        inhibitory_reversal_mV: E_inh relative to rest.
        excitatory_reversal_mV: E_ex relative to rest.
        sodium_reversal_mV: E_Na relative to rest.
        gate_slope_per_mV: Slope S of the sodium gates.
        gate_time_constant_ms: tau_h,max, which sets the period.

    Raises:
        ConfigError: A parameter that is not positive, an inhibitory reversal that is not negative, or another
            reversal within the range that it has to drive a neuron through.
    """

    capacitance_nF: float = 5.0
    leak_conductance_uS: float = 1.0
    range_mV: float = 20.0
    bifurcation_mV: float = 0.01
    offset_mV: float = 0.1
    inhibitory_reversal_mV: float = -40.0
    excitatory_reversal_mV: float = 194.0
    sodium_reversal_mV: float = 110.0
    gate_slope_per_mV: float = 0.05
    gate_time_constant_ms: float = 300.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value, negative = getattr(self, field.name), field.name == "inhibitory_reversal_mV"
            if not (value < 0 if negative else value > 0):
                raise ConfigError(f"{field.name} must be {'negative' if negative else 'positive'}, not {value}")
        held = self.range_mV + self.offset_mV
        for name in ("excitatory_reversal_mV", "sodium_reversal_mV"):
            if not getattr(self, name) > held:
                raise ConfigError(f"{name} = {getattr(self, name)} must be above range_mV + offset_mV = {held:g}")

    @cached_property
    def conductances(self) -> Conductances:
        """All conductances by the rules of `annelid.nervous.design`.

        Raises:
            ConfigError: A rule gives a negative conductance for these parameters.
        """
        leak, reach, offset = self.leak_conductance_uS, self.range_mV, self.offset_mV
        inhibitory, excitatory = self.inhibitory_reversal_mV, self.excitatory_reversal_mV
        sodium = design.sodium_conductance(leak, reach, self._channel(1.0))
        half_centre = design.half_centre_conductance(leak, self.bifurcation_mV, inhibitory, self._channel(sodium))
        relay_drive = design.relay_drive_conductance(leak, reach, offset, excitatory)
        return Conductances(
            sodium=sodium,
            half_centre=half_centre,
            sensory_to_expansion=design.expansion_drive_conductance(
                leak, reach, offset, half_centre, inhibitory, excitatory
            ),
            sensory_to_contraction=design.contraction_hold_conductance(leak, reach, offset, half_centre, inhibitory),
            expansion_to_relay=relay_drive,
            sensory_to_relay=design.relay_silencing_conductance(reach, offset, relay_drive, excitatory, inhibitory),
            relay_to_next_sensory=design.sensory_silencing_conductance(leak * reach, inhibitory),
        )

    @property
    def sodium_channel(self) -> Channel:
        """The persistent sodium channel of the half-centre's neurons."""
        return self._channel(self.conductances.sodium)

    def _channel(self, conductance_uS: float) -> Channel:
        return persistent_sodium(
            conductance_uS,
            self.sodium_reversal_mV,
            self.range_mV,
            self.gate_slope_per_mV,
            self.gate_time_constant_ms,
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
    if n_segments < 3:
        raise ConfigError(f"n_segments must be at least 3, not {n_segments}")
    p = PeristalsisParameters() if parameters is None else parameters
    g = p.conductances
    inhibitory, excitatory = p.inhibitory_reversal_mV, p.excitatory_reversal_mV
    leaky = Neuron(p.capacitance_nF, p.leak_conductance_uS)
    half_centre = Neuron(p.capacitance_nF, p.leak_conductance_uS, channels=(p.sodium_channel,))

    network = Network(f"peristalsis of {n_segments} segments")
    for segment in range(1, n_segments + 1):
        first = segment == 1
        contraction, expansion, sensory, relay = (f"{role}_{segment}" for role in ROLES)
        network.add_neuron(contraction, half_centre, p.range_mV if first else -p.offset_mV)
        network.add_neuron(expansion, half_centre, 0.0 if first else p.range_mV + p.offset_mV)
        network.add_neuron(sensory, leaky, 0.0 if first else p.range_mV)
        network.add_neuron(relay, leaky, 0.0)
        for source, target, conductance, reversal in (
            (contraction, expansion, g.half_centre, inhibitory),
            (expansion, contraction, g.half_centre, inhibitory),
            (sensory, contraction, g.sensory_to_contraction, inhibitory),
            (sensory, expansion, g.sensory_to_expansion, excitatory),
            (sensory, relay, g.sensory_to_relay, inhibitory),
            (expansion, relay, g.expansion_to_relay, excitatory),
        ):
            network.add_synapse(source, target, Synapse(conductance, reversal, 0.0, p.range_mV))
    for segment in range(1, n_segments + 1):
        following = segment % n_segments + 1
        network.add_synapse(
            f"relay_{segment}",
            f"sensory_{following}",
            Synapse(g.relay_to_next_sensory, inhibitory, 0.0, p.range_mV),
        )
    for segment in range(1, n_segments + 1):
        network.add_input(f"stretch_{segment}", f"sensory_{segment}")
        network.add_output(f"contraction_{segment}", f"contraction_{segment}")
        network.add_output(f"expansion_{segment}", f"expansion_{segment}")
    network.add_input("kick", "contraction_1")
    return network

"""The peristalsis network with pressure feedback: a segment that bears load holds on until the one before is extended.

The network of Riddle et al. (`annelid.nervous.peristalsis`) knows lengths only. On a body with weight a contracting
segment stretches its neighbour, whose stretch sensor then lets go too early: two or three segments contract almost at
once, the front droops and is dragged along the ground. Two neurons a segment and four kinds of synapse even the wave
out, so that no segment lets go of the ground before the one ahead has its length (the aim of the contact feedback of
Daltorio et al. 2013), and each comes back while another one lengthens. All act on sensory neurons, which hold a segment
expanded and end its contraction:

- *Hold*: the pressure neuron, driven by the load that the segment bears, excites the segment's own. A segment that
  stands on the ground holds itself expanded, stretched or not; one that lands while it is contracted soon lets go of
  its contraction and becomes an anchor.
- *Landing*: the pressure neuron excites that of the segment before. That one stays expanded, or ends its contraction
  sooner, while its follower stands on the ground.
- *Release*: the extension neuron, driven by the segment's length, inhibits that of the next segment. It lets go of the
  ground once this one is extended, loaded or not, rather than once this one comes back.
- *Exchange*: the contraction neuron excites that of the segment two before. What lies between the anchors in front and
  behind keeps its length, since one segment shortens while another one lengthens, and neither anchor is pushed along.

Before the first segment comes the last. With all four at zero what remains is the network of Riddle et al. The design
is our own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from annelid.errors import require_at_least, require_positive
from annelid.nervous.functional_subnetworks import transmission
from annelid.nervous.network import Network
from annelid.nervous.neurons import Neuron
from annelid.nervous.peristalsis import PeristalsisParameters, peristalsis_network

ROLES = ("pressure", "extension")
"""The two neurons that a segment has beyond those of the peristalsis network, in order."""


@dataclass(frozen=True)
class PressureParameters:
    """What the network is designed from.

    Attributes:
        peristalsis: The network of Riddle et al.
        hold: Potential that a full pressure neuron alone gives its sensory neuron, over R; 0 for none.
        release: How many times the current of a stretch sensor a full extension neuron cancels; 0 for none.
        landing: Potential that a full pressure neuron alone gives the sensory neuron of the segment before, over R; 0
            for none.
        exchange: Potential that a full contraction neuron alone gives the sensory neuron two segments before, over R; 0
            for none. Three segments have none: there the segment two before is the next one.
        pressure_ms: Time constant of the pressure neurons.

    Raises:
        ConfigError: A time constant that is not positive, or ``hold``, ``release``, ``landing`` or ``exchange``
            below 0.
    """

    peristalsis: PeristalsisParameters = field(default_factory=PeristalsisParameters)
    hold: float = 1.0
    release: float = 1.8
    landing: float = 0.1
    exchange: float = 0.8
    pressure_ms: float = 30.0

    def __post_init__(self) -> None:
        require_positive(pressure_ms=self.pressure_ms)
        require_at_least(0, hold=self.hold, release=self.release, landing=self.landing, exchange=self.exchange)


def pressure_network(n_segments: int, parameters: PressureParameters | None = None) -> Network:
    """Builds the peristalsis network with pressure feedback, in its initial state.

    Args:
        n_segments: Number of segments, at least 3.
        parameters: What to design it from; default: the papers' network and our feedback.

    Returns:
        `annelid.nervous.peristalsis_network` with the neurons ``pressure_s`` and ``extension_s`` of every segment and
        their inputs ``load_s`` and ``length_s``, all behind its own. ``Gm R`` nA is the full scale of these inputs.

    Raises:
        ConfigError: As `peristalsis_network`, or a ``hold``, ``landing`` or ``exchange`` beyond
            what the excitatory reversal potential can give.
    """
    require_at_least(3, n_segments=n_segments)
    design = PressureParameters() if parameters is None else parameters
    p = design.peristalsis
    network = peristalsis_network(n_segments, p)
    leak = p.leak_conductance_uS
    extension = Neuron(p.capacitance_nF, leak)
    for segment in range(1, n_segments + 1):
        network.add_neuron(f"pressure_{segment}", Neuron(design.pressure_ms * leak, leak))
        network.add_neuron(f"extension_{segment}", extension)
    signals = p.signals
    release = p.inhibitory(design.release * p.conductances.relay_to_next_sensory)
    for segment in range(1, n_segments + 1):
        before, two_before = ((segment - 1 - steps) % n_segments + 1 for steps in (1, 2))
        if design.hold > 0:
            network.add_synapse(f"pressure_{segment}", f"sensory_{segment}", transmission(design.hold, signals))
        if design.landing > 0:
            network.add_synapse(f"pressure_{segment}", f"sensory_{before}", transmission(design.landing, signals))
        if design.exchange > 0 and n_segments > 3:
            synapse = transmission(design.exchange, signals)
            network.add_synapse(f"contraction_{segment}", f"sensory_{two_before}", synapse)
        if design.release > 0:
            network.add_synapse(f"extension_{segment}", f"sensory_{segment % n_segments + 1}", release)
        network.add_input(f"load_{segment}", f"pressure_{segment}")
        network.add_input(f"length_{segment}", f"extension_{segment}")
    return network

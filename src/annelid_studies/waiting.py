"""The paper's controller with a gate that waits until a segment is at rest again; our own design."""

from __future__ import annotations

from typing import Literal

from annelid.config import RunConfig
from annelid.control import Circuit, CircuitKind, Sns
from annelid.nervous import Network, PeristalsisParameters, Synapse, peristalsis_network


def waiting_network(n_segments: int, p: PeristalsisParameters) -> Network:
    """Builds a peristalsis network in which a segment waits until the one before is at rest again.

    In the paper's network a segment contracts when the one before begins to lengthen its ring. Here it contracts when
    that one is back at rest length. The relays are joined differently, and a neuron ``memory_s`` of every segment,
    which remembers that it was the last to contract, comes behind those of `peristalsis_network`; inputs and outputs
    are the same. With the conductance ``g = Gm R / (E_ex - R)`` of a `transmission`, and R as the potential of a
    neuron that is on:

    1. *The memory is a latch.* The contraction neuron excites it with g, and so does the memory itself, from 0.4 R on
       and in full from 0.6 R. Without contraction it therefore rests at 0 or at R. The next segment's memory inhibits
       it with ``2 g E_ex / -E_inh``, which balances both excitations at 0. This begins at 0.6 R, where that memory
       already keeps itself, so that the wave is never lost between two segments.
    2. *The relay is a logical AND.* Its segment's memory and sensory neuron excite it with g / 2 each: both bring it to
       R, one alone to ``R E_ex / (2 E_ex - R)``, which is 0.53 R with the papers' constants. Its synapse to the next
       sensory neuron has the paper's g43 and opens over the middle third between these two potentials.
    3. *A contraction that has begun goes on.* The contraction neuron inhibits its own sensory neuron, again with g43,
       until the half-centre ends the contraction, even if the segment has not left its rest length. Such a segment
       passes the wave on like any other.

    A segment that is not back at rest length when its half-centre turns again contracts once more.

    Args:
        n_segments: Number of segments, at least 3.
        p: What to design it from.

    Returns:
        A network of ``5 n_segments`` neurons; at the start segment 1 is contracted, and its memory is on.

    Raises:
        ConfigError: As `peristalsis_network`.
    """
    network = peristalsis_network(n_segments, p)
    network.name = f"waiting peristalsis of {n_segments} segments"
    network.connections[:] = [
        one for one in network.connections if not (one.source.startswith("relay") or one.target.startswith("relay"))
    ]
    reach, excitatory, inhibitory = p.range_mV, p.excitatory_reversal_mV, p.inhibitory_reversal_mV
    through, silencing_uS = p.transmission(), p.conductances.relay_to_next_sensory
    latch = Synapse(through.conductance_uS, excitatory, 0.4 * reach, 0.6 * reach)
    forget = Synapse(p.cancelling_uS(2.0 * through.conductance_uS, reach), inhibitory, 0.6 * reach, reach)
    half = p.excitatory(0.5 * through.conductance_uS)
    alone = reach * excitatory / (2.0 * excitatory - reach)
    both = Synapse(silencing_uS, inhibitory, (2.0 * alone + reach) / 3.0, (alone + 2.0 * reach) / 3.0)
    segments = range(1, n_segments + 1)
    for segment in segments:
        network.add_neuron(f"memory_{segment}", p.leaky_neuron, reach if segment == 1 else 0.0)
    for segment in segments:
        following = segment % n_segments + 1
        contraction, sensory, relay = (f"{role}_{segment}" for role in ("contraction", "sensory", "relay"))
        memory = f"memory_{segment}"
        network.add_synapse(contraction, memory, through)
        network.add_synapse(memory, memory, latch)
        network.add_synapse(f"memory_{following}", memory, forget)
        network.add_synapse(memory, relay, half)
        network.add_synapse(sensory, relay, half)
        network.add_synapse(relay, f"sensory_{following}", both)
        network.add_synapse(contraction, sensory, p.inhibitory(silencing_uS))
    return network


class WaitingSns(CircuitKind):
    """The synthetic nervous system with a gate that waits: `waiting_network`.

    A segment contracts when the one before it is at rest again after its contraction. In the paper's network it does so
    as soon as that one begins to lengthen its ring.
    """

    sensor_fields = Sns.sensor_fields
    tuned = (
        "controller.network.gate_time_constant_ms=80:900:log",
        "controller.network.activation_slope_per_mV=0.1:2:log",
        "sensor.tolerance_m=0.001:0.03:log",
    )
    kind: Literal["sns-waiting"] = "sns-waiting"
    network: Sns = Sns()

    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit, as `CircuitKind.circuit`."""
        network = waiting_network(n_segments, self.network.design)
        return self.network.gated(network, config, n_segments, "synthetic nervous system that waits for rest")

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns what the network rests on."""
        return self.network.cited()

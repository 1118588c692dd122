"""The paper's controller with feedback from pressure, against slip; the design is our own.

On a body with weight a contracting segment stretches its neighbour, whose stretch sensor then switches off too early:
several segments contract at once, and the front drags along the ground. Three kinds of synapse onto sensory neurons,
which keep a segment expanded and end its contraction, even the wave out, so that no segment leaves the ground before
the one ahead has its length (the aim of Daltorio et al. 2013). Before the first segment comes the last.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from annelid.config import RunConfig
from annelid.control import Circuit, CircuitKind, Sense, Sns, Source
from annelid.nervous import Network, Neuron, PeristalsisParameters, peristalsis_network

Strength = Annotated[float, Field(ge=0, le=5)]
LOAD_N = 2.5, 9.0
"""Load of a segment up to which its pressure neuron rests, and that which drives it to R: of the six-segment robot."""
EXTENSION_M = 0.045, 0.055
"""Lengthening from which a segment lets the next one go, and at which it does so in full."""
PRESSURE_MS = 30.0
"""Time constant of the pressure neurons."""


def pressure_network(
    n_segments: int,
    p: PeristalsisParameters,
    *,
    hold: float,
    release: float,
    exchange: float,
    pressure_ms: float = PRESSURE_MS,
) -> Network:
    """Builds the peristalsis network with pressure feedback of the strengths that `PressureSns` describes.

    Neurons ``pressure_s`` and ``extension_s`` of every segment come behind those of `peristalsis_network`, with inputs
    ``load_s`` and ``length_s`` of which ``Gm R`` nA is the full scale. On the ground, full pressure keeps a segment
    expanded, stretched or not, and one that lands becomes an anchor. Of three segments the one two before is the next
    one, so none exchanges.

    Raises:
        ConfigError: As `peristalsis_network`, or a strength beyond what the excitatory reversal can give.
    """
    network, leak = peristalsis_network(n_segments, p), p.leak_conductance_uS
    segments = range(1, n_segments + 1)
    for segment in segments:
        network.add_neuron(f"pressure_{segment}", Neuron(pressure_ms * leak, leak))
        network.add_neuron(f"extension_{segment}", p.leaky_neuron)
    for segment in segments:
        two_before = (segment - 3) % n_segments + 1
        if hold > 0:
            network.add_synapse(f"pressure_{segment}", f"sensory_{segment}", p.transmission(hold))
        if exchange > 0 and n_segments > 3:
            network.add_synapse(f"contraction_{segment}", f"sensory_{two_before}", p.transmission(exchange))
        if release > 0:
            synapse = p.inhibitory(release * p.conductances.relay_to_next_sensory)
            network.add_synapse(f"extension_{segment}", f"sensory_{segment % n_segments + 1}", synapse)
        network.add_input(f"load_{segment}", f"pressure_{segment}")
        network.add_input(f"length_{segment}", f"extension_{segment}")
    return network


class PressureSns(CircuitKind):
    """The synthetic nervous system with pressure feedback against slip.

    A segment that bears load stays expanded until the one before it is extended, and one that begins to contract ends
    the contraction two segments before; any of the three strengths may be 0. A segment's load is the sum of the forces
    on its four sides. As long as segment 1's stretch sensor is kept off at the start, so is its load. Lengths and loads
    are those of the six-segment robot (0.16 m radius, 19 N).
    """

    sensor_fields = Sns.sensor_fields
    tuned = (
        "controller.network.gate_time_constant_ms=80:900:log",
        "controller.hold=0:2",
        "controller.release=0:6",
        "controller.exchange=0:2",
        "sensor.tolerance_m=0.001:0.03:log",
    )
    kind: Literal["sns-pressure"] = "sns-pressure"
    network: Sns = Sns()
    hold: Strength = Field(default=1.0, description="potential over R that full pressure gives its sensory neuron")
    release: float = Field(
        default=1.8, ge=0, le=20, description="sensors' currents that a full extension neuron cancels"
    )
    exchange: Strength = Field(default=0.8, description="potential over R that a contraction gives the one two before")

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has a skin that senses pressure."""
        if not config.body.has_skin:
            raise ValueError(
                f"controller.kind = 'sns-pressure' needs the touch of a skin, which body.kind = {config.body.kind!r} "
                "has not; only the 3D worm ('worm') has"
            )

    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit, as `CircuitKind.circuit`."""
        strengths = self.model_dump(include={"hold", "release", "exchange"})
        network = pressure_network(n_segments, self.network.design, **strengths)
        full_nA, inputs = self.network.full_nA, dict[str, Source]()
        for segment in range(n_segments):
            from_s = config.sensor.startup_hold_s if segment == 0 else 0.0
            inputs[f"load_{segment + 1}"] = Sense.between("touch_N", segment, *LOAD_N, full_nA, from_s)
            inputs[f"length_{segment + 1}"] = Sense.between("lengthening_m", segment, *EXTENSION_M, full_nA)
        name = "synthetic nervous system with pressure feedback"
        return self.network.gated(network, config, n_segments, name, inputs)

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns what the network rests on, and the feedback."""
        return (*self.network.cited(), ("daltorio2013", "the aim of feedback from contact"))

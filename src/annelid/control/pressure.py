"""The paper's controller with feedback from pressure, against slip."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from annelid.config.run import RunConfig
from annelid.control.circuit import Circuit
from annelid.control.circuit_controller import CircuitKind
from annelid.control.senses import Sense, Source
from annelid.control.sns import Sns
from annelid.nervous import peristalsis

Strength = Annotated[float, Field(ge=0, le=5)]
LOAD_N = 2.5, 9.0
"""Load of a segment up to which its pressure neuron rests, and that which drives it to R: of the six-segment robot."""
EXTENSION_M = 0.045, 0.055
"""Lengthening from which a segment lets the next one go, and at which it does so in full."""
PRESSURE_MS = 30.0
"""Time constant of the pressure neurons."""


class PressureSns(CircuitKind):
    """The synthetic nervous system with pressure feedback against slip: `annelid.nervous.peristalsis`.

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
        network = peristalsis.pressure_network(n_segments, self.network.design, **strengths, pressure_ms=PRESSURE_MS)
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

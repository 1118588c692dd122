"""The paper's controller with a descending drive, which sets the rate of its half-centres."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from annelid.config.kinds import Knob
from annelid.config.run import RunConfig
from annelid.config.sections import Share
from annelid.control.circuit import Circuit
from annelid.control.circuit_controller import CircuitKind
from annelid.control.sns import DRIVE_HINT, Sns
from annelid.nervous import peristalsis

DRIVE_MS = 50.0
"""Time constant of the descending neuron."""


class AdaptiveSns(CircuitKind):
    """The synthetic nervous system with a descending neuron, whose activity sets the rate of all half-centres.

    That neuron is silent at the start, and follows the drive with a time constant of 50 ms.
    """

    sensor_fields = Sns.sensor_fields
    tuned = (
        "controller.drive=0:1",
        "controller.network.gate_time_constant_ms=80:900:log",
        "sensor.tolerance_m=0.001:0.03:log",
        "sensor.hysteresis_m=0:0.02",
    )
    kind: Literal["adaptive"] = "adaptive"
    network: Sns = Sns()
    drive: Share = Field(default=0.0, description="0: the half-centres' slow rhythm; 1: about three times as fast")

    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit, as `CircuitKind.circuit`."""
        sns, design = self.network, self.network.design
        return sns.gated(
            peristalsis.adaptive_peristalsis_network(n_segments, design, DRIVE_MS),
            config,
            n_segments,
            "synthetic nervous system with a descending drive",
            inputs={"drive": self.drive * sns.full_nA},
            activities={"drive": [peristalsis.DRIVE_NEURON]},
            constants={"conductance_drive_uS": peristalsis.drive_conductance_uS(design)},
        )

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns what the network rests on, and its drive."""
        return (*self.network.cited(), ("nourse", "the idea of half-centres that adapt their rate"))

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the manual drive."""
        return (Knob("controller.drive", "drive", 1.0, 0.0, 1.0, 0.01, DRIVE_HINT),)

"""The paper's controller with a gate that waits until a segment is at rest again."""

from __future__ import annotations

from typing import Literal

from annelid.config.run import RunConfig
from annelid.control.circuit import Circuit
from annelid.control.circuit_controller import CircuitKind
from annelid.control.sns import Sns
from annelid.nervous import peristalsis


class WaitingSns(CircuitKind):
    """The synthetic nervous system with a gate that waits: `annelid.nervous.peristalsis.waiting_network`.

    A segment contracts when the one before it is at rest again after its contraction. In the paper's network it does so
    as soon as that one begins to lengthen its ring.
    """

    sensor_fields = Sns.sensor_fields
    tuned = (
        "controller.network.gate_time_constant_ms=80:900:log",
        "controller.network.activation_slope_per_mV=0.1:2:log",
        "sensor.tolerance_m=0.001:0.03:log",
        "sensor.hysteresis_m=0:0.02",
    )
    kind: Literal["sns-waiting"] = "sns-waiting"
    network: Sns = Sns()

    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit, as `CircuitKind.circuit`."""
        network = peristalsis.waiting_network(n_segments, self.network.design)
        return self.network.gated(network, config, n_segments, "synthetic nervous system that waits for rest")

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns what the network rests on."""
        return self.network.cited()

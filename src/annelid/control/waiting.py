"""The paper's controller with a gate that waits until a segment is at rest again."""

from __future__ import annotations

from typing import Literal

from annelid.config.run import ControllerKind, RunConfig
from annelid.control.sns import PeristalsisController, Sns
from annelid.nervous import Network, peristalsis
from annelid.protocols import Plant


class WaitingSns(ControllerKind):
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

    def build(self, config: RunConfig, plant: Plant) -> WaitingController:
        """Builds the controller, as `ControllerKind.build`."""
        size = plant.n_segments, plant.n_muscles
        return WaitingController(self, config.sensor, *size, config.clock.control_timestep_s)

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns what the network rests on."""
        return self.network.cited()


class WaitingController(PeristalsisController[WaitingSns]):
    """Drives a worm by `annelid.nervous.peristalsis.waiting_network`.

    The rest, errors too, is as for `annelid.control.SnsController`.
    """

    name = "synthetic nervous system that waits for rest"

    def _network(self, n_segments: int) -> Network:
        return peristalsis.waiting_network(n_segments, self._parameters)

"""The peristalsis network under a descending drive, as a controller."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from annelid.config.kinds import ControllerKind, Knob
from annelid.control.base import Share, Slope, TimeConstant, require_step_within
from annelid.control.sns import PeristalsisController, Sns
from annelid.control.stretch_sensor import lengthening_m
from annelid.nervous import Network, adaptive_peristalsis_network, drive_conductance_uS
from annelid.nervous.peristalsis import DRIVE_NEURON
from annelid.protocols import Array, Plant, Sensation, Values

if TYPE_CHECKING:
    from annelid.config.run import RunConfig


DRIVE_HINT = "Descending drive: more of it makes the wave faster."


class AdaptiveSns(ControllerKind):
    """The synthetic nervous system with a descending neuron, whose activity sets the rate of all half-centres.

    The wanted activity is ``drive + drive_slope_per_s time + stretch_gain_per_m stretch``, clipped to 0 .. 1, with the
    mean lengthening of all segments as stretch: a manual, a timed and a sensory drive. The descending neuron follows it
    with its time constant.
    """

    sensor_fields: ClassVar[frozenset[str]] = Sns.sensor_fields
    tuned: ClassVar[tuple[str, ...]] = (
        "controller.drive=0:1",
        "controller.network.gate_time_constant_ms=80:900:log",
        "sensor.tolerance_m=0.001:0.03:log",
        "sensor.hysteresis_m=0:0.02",
    )
    kind: Literal["adaptive"] = "adaptive"
    network: Sns = Sns()
    drive: Share = Field(default=0.0, description="0: the half-centres' slow rhythm; 1: about three times as fast")
    drive_slope_per_s: Slope = Field(default=0.0, description="change of the manual drive")
    stretch_gain_per_m: float = Field(
        default=0.0, ge=-1000, le=1000, description="drive per mean lengthening of the segments"
    )
    drive_time_constant_s: TimeConstant = Field(default=0.05, description="of the descending neuron")

    def build(self, config: RunConfig, plant: Plant) -> AdaptiveController:
        """Builds the controller, as `ControllerKind.build`."""
        size = plant.n_segments, plant.n_muscles
        return AdaptiveController(self, config.sensor, *size, config.clock.control_timestep_s)

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns what the network rests on, and its drive."""
        return (*self.network.cited(), ("nourse", "the idea of half-centres that adapt their rate"))

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the manual drive."""
        return (Knob("controller.drive", "drive", 1.0, 0.0, 1.0, 0.01, DRIVE_HINT),)


class AdaptiveController(PeristalsisController[AdaptiveSns]):
    """Drives a worm by the peristalsis network with a descending neuron that sets the rate of its half-centres.

    It starts with that neuron silent. The rest, errors too, is as for `annelid.control.SnsController`.
    """

    name = "synthetic nervous system with a descending drive"
    recorded = (*PeristalsisController.recorded, ("drive", (), "1", "activity of the descending neuron"))

    def _network(self, n_segments: int, control_timestep_s: float) -> Network:
        config = self._config
        require_step_within(control_timestep_s, drive_time_constant_s=config.drive_time_constant_s)
        self._every_step_differs = config.drive_slope_per_s != 0.0
        return adaptive_peristalsis_network(n_segments, self._parameters, 1e3 * config.drive_time_constant_s)

    def _set_further(self, inputs_nA: Array, sensation: Sensation, time_s: float, n_taken: int) -> None:
        manual = self._config.drive + self._config.drive_slope_per_s * n_taken * self._timestep_s
        longer_m = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        drive = manual + self._config.stretch_gain_per_m * float(longer_m.mean())
        leak, reach = self._parameters.leak_conductance_uS, self._parameters.range_mV
        inputs_nA[...] = min(max(drive, 0.0), 1.0) * leak * reach

    def _values(self) -> Values:
        return {**super()._values(), "drive": self._activity(DRIVE_NEURON)}

    def _attrs(self) -> dict[str, float | int | str]:
        return {"conductance_drive_uS": drive_conductance_uS(self._parameters)}

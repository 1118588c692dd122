"""The peristalsis network under a descending drive, as a controller."""

from __future__ import annotations

from annelid import config as settings
from annelid.control.neural import PeristalsisController, require_step_within
from annelid.control.stretch_sensor import lengthening_m
from annelid.nervous import Network, adaptive_peristalsis_network, drive_conductance_uS
from annelid.protocols import Sensation, Values


class AdaptiveController(PeristalsisController[settings.AdaptiveSns]):
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

    def _feel(self, sensation: Sensation, time_s: float) -> None:
        manual = self._config.drive + self._config.drive_slope_per_s * self._n_steps * self._timestep_s
        longer_m = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        drive = manual + self._config.stretch_gain_per_m * float(longer_m.mean())
        leak, reach = self._parameters.leak_conductance_uS, self._parameters.range_mV
        self._inputs_nA[-1] = min(max(drive, 0.0), 1.0) * leak * reach

    def _values(self) -> Values:
        return {**super()._values(), "drive": self._activity(-1)}

    def _attrs(self) -> dict[str, float]:
        return {"conductance_drive_uS": drive_conductance_uS(self._parameters)}

"""The peristalsis network with pressure feedback, as a controller that avoids slip."""

from __future__ import annotations

import numpy as np

from annelid import config as settings
from annelid.control.neural import PeristalsisController, require_step_within
from annelid.control.stretch_sensor import lengthening_m
from annelid.nervous import Network
from annelid.nervous.pressure import PressureParameters, pressure_network
from annelid.protocols import Array, Sensation


class PressureController(PeristalsisController[settings.PressureSns]):
    """Drives a worm by `annelid.nervous.pressure`.

    A segment's load is the sum of the normal forces on its four sides, its length the mean of its stretch sensors, both
    rising linearly from nothing to R. As long as segment 1's stretch sensor is held off at the start, so is its load.
    The rest, errors too, is as for `annelid.control.SnsController`.
    """

    name = "synthetic nervous system with pressure feedback"

    def _network(self, n_segments: int, control_timestep_s: float) -> Network:
        config = self._config
        require_step_within(control_timestep_s, pressure_time_constant_s=config.pressure_time_constant_s)
        strengths = config.hold, config.release, config.landing, config.exchange
        design = PressureParameters(self._parameters, *strengths, 1e3 * config.pressure_time_constant_s)
        return pressure_network(n_segments, design)

    def _feel(self, sensation: Sensation, time_s: float) -> None:
        config, further = self._config, self._inputs_nA[self._n_segments + 1 :]
        load_N = sensation.touch_N.sum(axis=1)
        longer_m = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        further[::2] = self._full_nA * _rise(load_N, config.light_N, config.full_N)
        further[1::2] = self._full_nA * _rise(longer_m, config.extending_m, config.extended_m)
        if self._sensor.held_at(time_s):
            further[0] = 0.0


def _rise(values: Array, low: float, high: float) -> Array:
    """Values on a scale from ``low`` (0) to ``high`` (1), kept within."""
    return np.clip((values - low) / (high - low), 0.0, 1.0)

"""The peristalsis network under a descending drive, as a controller."""

from __future__ import annotations

import numpy as np

from annelid import config as settings
from annelid.control.neural import PeristalsisController, design_of
from annelid.control.stretch_sensor import lengthening_m
from annelid.errors import ConfigError
from annelid.nervous import PeristalsisParameters, adaptive_peristalsis_network, drive_conductance_uS
from annelid.protocols import Array, Recordable, Sensation, Signal, Values


class AdaptiveController(PeristalsisController):
    """Drives a worm by the peristalsis network with a descending neuron that sets the rate of its half-centres.

    Order of a step, sensors, kick and activation are those of `annelid.control.SnsController`.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two a segment, or network parameters
            for which a design rule has no solution.
    """

    def __init__(
        self,
        config: settings.AdaptiveSns,
        sensor: settings.StretchSensor,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Builds the controller in its initial state, its descending neuron silent.

        Args:
            config: Its section of the configuration.
            sensor: Section of the stretch sensors; their noise is the simulation's business, not used here.
            n_segments: Segments, at least 3.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        self._config = config
        self._parameters = design_of(PeristalsisParameters, config.network)
        network = adaptive_peristalsis_network(n_segments, self._parameters, 1e3 * config.drive_time_constant_s)
        if not control_timestep_s <= config.drive_time_constant_s:
            raise ConfigError(
                f"controller.drive_time_constant_s = {config.drive_time_constant_s:g}: must be at least "
                f"{control_timestep_s:g}, the control timestep"
            )
        super().__init__(network, config.network, sensor, n_segments, n_muscles, control_timestep_s)

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step.

        Args:
            sensation: What the body feels at the beginning of the step; lengths and time are used.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``; both halves of a ring alike.
        """
        n = self._n_segments
        inputs = np.zeros(n + 2)
        on = self._sensor.read(sensation.stretch_m, sensation.rest_stretch_m, sensation.time_s)
        inputs[:n] = self._sns.sensor_current_nA * on
        inputs[n] = self._sns.kick_nA if self._n_steps == 0 else 0.0
        inputs[n + 1] = self._wanted_drive(sensation) * self._parameters.leak_conductance_uS * self._parameters.range_mV
        self._stepper.advance(self._state, inputs)
        self._n_steps += 1
        return self._activation(self._state.potential[0])

    def _wanted_drive(self, sensation: Sensation) -> float:
        manual = self._config.drive + self._config.drive_slope_per_s * self._n_steps * self._timestep_s
        longer_m = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        sensory = self._config.stretch_gain_per_m * float(longer_m.mean())
        return min(max(manual + sensory, 0.0), 1.0)

    def recordable(self) -> Recordable:
        """Names potentials, sodium gates, sensors and the drive."""
        return self._named(
            *self._signals(),
            Signal("drive", (), (), "1", "activity of the descending neuron"),
            controller="synthetic nervous system with a descending drive",
            conductance_drive_uS=drive_conductance_uS(self._parameters),
        )

    def read(self, frame: bool) -> Values:
        """Reads the signals that `recordable` names; there are none at frame rate."""
        if frame:
            return {}
        drive = min(max(float(self._state.potential[0, -1]) / self._parameters.range_mV, 0.0), 1.0)
        return {**super().read(frame), "drive": drive}

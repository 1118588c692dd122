"""The peristalsis network with pressure feedback, as a controller that avoids slip."""

from __future__ import annotations

import numpy as np

from annelid import config as settings
from annelid.control.neural import PeristalsisController, design_of
from annelid.control.stretch_sensor import lengthening_m
from annelid.errors import ConfigError
from annelid.nervous import PeristalsisParameters
from annelid.nervous.pressure import PressureParameters, pressure_network
from annelid.protocols import Array, Recordable, Sensation


class PressureController(PeristalsisController):
    """Drives a worm by `annelid.nervous.pressure`.

    Order of a step, stretch sensors, kick and activation are those of `annelid.control.SnsController`. A segment's load
    is the sum of the normal forces on its four sides, its length the mean of its stretch sensors, both rising linearly
    from nothing to R. As long as segment 1's stretch sensor is held off at the start, so is its load.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two a segment, network parameters for
            which a design rule has no solution, or a control step beyond the pressure neurons' time constant.
    """

    def __init__(
        self,
        config: settings.PressureSns,
        sensor: settings.StretchSensor,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Builds the controller in its initial state.

        Args:
            config: Its section of the configuration.
            sensor: Section of the stretch sensors; their noise is the simulation's business, not used here.
            n_segments: Segments, at least 3.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        if not control_timestep_s <= config.pressure_time_constant_s:
            raise ConfigError(
                f"controller.pressure_time_constant_s = {config.pressure_time_constant_s:g}: must be at least "
                f"{control_timestep_s:g}, the control timestep"
            )
        self._config = config
        parameters = design_of(PeristalsisParameters, config.network)
        strengths = (config.hold, config.release, config.landing, config.exchange)
        design = PressureParameters(parameters, *strengths, 1e3 * config.pressure_time_constant_s)
        network = pressure_network(n_segments, design)
        self._full_nA = parameters.leak_conductance_uS * parameters.range_mV
        super().__init__(network, config.network, sensor, n_segments, n_muscles, control_timestep_s)

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step.

        Args:
            sensation: What the body feels at the beginning of the step; lengths, touch and time are used.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``; both halves of a ring alike.
        """
        return self.stride(sensation, 1)

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps that feel the same; bit for bit the same as so many calls of `step`.

        Args:
            sensation: What the body feels at the beginning of the first step; its time is a multiple of the
                control step, and goes on.
            n_steps: Control steps, at least 1.

        Returns:
            Activation after the last step, as `step` returns it.
        """
        n, feels = self._n_segments, self._config
        load_N = sensation.touch_N.sum(axis=1)
        longer_m = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        inputs = np.zeros(3 * n + 1)
        inputs[n + 1 :: 2] = self._full_nA * _rise(load_N, feels.light_N, feels.full_N)
        inputs[n + 2 :: 2] = self._full_nA * _rise(longer_m, feels.extending_m, feels.extended_m)
        first_load = inputs[n + 1]
        for n_piece, time_s in self._pieces(self._n_steps, sensation.time_s, n_steps):
            on = self._sensor.read(sensation.stretch_m, sensation.rest_stretch_m, time_s)
            inputs[:n] = self._sns.sensor_current_nA * on
            inputs[n] = self._sns.kick_nA if self._n_steps == 0 else 0.0
            inputs[n + 1] = 0.0 if self._sensor.held_at(time_s) else first_load
            self._stepper.advance(self._state, inputs, n_piece)
            self._n_steps += n_piece
        return self._activation(self._state.potential[0])

    def recordable(self) -> Recordable:
        """Names potentials, sodium gates and sensors."""
        return self._named(*self._signals(), controller="synthetic nervous system with pressure feedback")


def _rise(values: Array, low: float, high: float) -> Array:
    """Values on a scale from ``low`` (0) to ``high`` (1), kept within."""
    return np.clip((values - low) / (high - low), 0.0, 1.0)

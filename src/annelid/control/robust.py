"""The controller made to keep its rhythm under wrong sensor signals: the robust peristalsis network on a body."""

from __future__ import annotations

import numpy as np

from annelid import config as settings
from annelid.control.neural import NeuralController, design_of
from annelid.control.stretch_sensor import lengthening_m
from annelid.errors import ConfigError
from annelid.nervous.adaptive import DRIVE_NEURON
from annelid.nervous.driven import MOTOR, MOTOR_SHARE, DriveParameters, add_motor_neurons, driven_robust_network
from annelid.nervous.robust import ROLES, RobustParameters, robust_network
from annelid.protocols import SIDES, Array, Sensation, Values

BACK = SIDES.index("back")


class RobustController(NeuralController):
    """Drives a worm by `annelid.nervous.robust`, or with a drive by `annelid.nervous.driven`.

    One step, from t to t + dt: the segments' mean lengthening at t, graded and clipped, drives the stretch neurons
    during the whole step; activation is ``1 / (1 + exp(-slope (U1 - U2)))`` of the contraction and expansion neurons at
    t + dt, or that of the motor neurons, if there are any. The forces of the ground on the segments' backs drive the
    pressure neurons likewise, if there are any. Nothing but potentials and gates is remembered.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two a segment, network parameters for
            which a design rule has no solution, or a control step at which the network would not be stable.
    """

    name = "robust synthetic nervous system"
    recorded = (
        *NeuralController.recorded,
        ("stretch_activity", ("segment",), "1", "activity of the stretch neuron"),
        ("drive", (), "1", "activity of the descending neuron"),
    )
    _parameters: RobustParameters

    def __init__(self, config: settings.RobustSns, n_segments: int, n_muscles: int, control_timestep_s: float) -> None:
        """Builds the controller in its initial state.

        Args:
            config: Its section of the configuration.
            n_segments: Segments, at least 3.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        self._config, drive = config, config.descending
        self._parameters = parameters = design_of(RobustParameters, config)
        if drive.lift:
            times_ms = 1e3 * drive.time_constant_s, 1e3 * drive.pressure_time_constant_s
            pathway = DriveParameters(drive.lift, drive.per_segment, *times_ms)
            network = driven_robust_network(n_segments, parameters, pathway)
        else:
            network = robust_network(n_segments, parameters)
        if config.let_go_s:
            add_motor_neurons(network, n_segments, parameters, 1e3 * config.let_go_s)
        longest_s = network.stable_timestep_ms() / 1e3
        if control_timestep_s > longest_s:
            raise ConfigError(
                f"clock.control_timestep_s = {control_timestep_s:g} must be at most {longest_s:.3g}, beyond which the "
                f"network of {n_segments} segments may be unstable"
            )
        super().__init__(
            network,
            ROLES,
            n_segments,
            n_muscles,
            control_timestep_s,
            scheme=config.scheme,
            slope_per_mV=config.activation_slope_per_mV,
        )
        neurons = self._stepper.arrays.neurons
        first = neurons.index(f"{MOTOR}_1") if config.let_go_s else len(neurons)
        self._motor = slice(first, first + n_segments)
        self._range_mV, self._full_nA = config.range_mV, config.leak_conductance_uS * config.range_mV
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the state that ``start`` names.

        It is segment 1 contracted and the others held (``"design"``); all potentials at rest, gates steady there
        (``"silent"``); or potentials drawn evenly from the inhibitory reversal to three ranges and gates from 0 to 1
        (``"random"``).

        Args:
            seed: Of what is drawn.
        """
        self._state = self._stepper.initial_state()
        config, potential, gate = self._config, self._state.potential, self._state.gate
        if config.start == "silent":
            potential[...] = 0.0
            [inactivation] = self._parameters.sodium_channel.slow_gates
            gate[...] = inactivation.steady(0.0)
        elif config.start == "random":
            rng = np.random.default_rng(seed)
            potential[...] = rng.uniform(config.inhibitory_reversal_mV, 3.0 * config.range_mV, potential.shape)
            gate[...] = rng.random(gate.shape)

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `NeuralController.stride`."""
        longer_m = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        inputs = np.clip(longer_m / self._config.full_stretch_m, 0.0, 1.0)
        if self._config.descending.lift:
            inputs = np.concatenate([inputs, [self._config.descending.drive], self._pressure(sensation)])
        self._stepper.advance(self._state, self._full_nA * inputs, n_steps)
        return self._activation(self._state.potential[0])

    def _pressure(self, sensation: Sensation) -> Array:
        """Force on every segment's back over its full scale, in [0, 1], ``(n_segments,)``; 0 for one without skin."""
        if not len(sensation.touch_N):
            return np.zeros(self._n_segments)
        return np.clip(sensation.touch_N[:, BACK] / self._config.descending.full_pressure_N, 0.0, 1.0)

    def _activation(self, potential: Array) -> Array:
        """Activation of every muscle, ``(.., n_muscles)``: the motor neurons' activity, if there are any."""
        if not self._config.let_go_s:
            return super()._activation(potential)
        full = MOTOR_SHARE * self._parameters.range_mV
        return np.clip(potential[..., self._motor] / full, 0.0, 1.0).repeat(self._muscles_per_segment, axis=-1)

    def _values(self) -> Values:
        stretch = self._state.potential[0, self._of_role["stretch"]]
        values = {
            **super()._values(),
            "stretch_activity": np.clip(stretch / self._parameters.range_mV, 0.0, 1.0),
        }
        if self._config.descending.lift:
            values["drive"] = self._activity(self._stepper.arrays.neurons.index(DRIVE_NEURON))
        return values

    def _attrs(self) -> dict[str, float]:
        return {"turn_ms": self._parameters.turn_ms}

"""The controller made to keep its rhythm under wrong sensor signals: the robust peristalsis network on a body."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from annelid.config.kinds import Knob
from annelid.config.run import RunConfig
from annelid.config.sections import Positive, Section, Share
from annelid.control.base import ControllerCode, HalfCentreKind, NeuralController, TimeConstant, design_of
from annelid.control.sns import DRIVE_HINT
from annelid.errors import ConfigError
from annelid.nervous import robust
from annelid.nervous.peristalsis import DRIVE_NEURON
from annelid.protocols import SIDES, Array, Plant, Sensation, Values

BACK = SIDES.index("back")


class DescendingDrive(Section):
    """A descending neuron that makes the robust network's wave faster where backs are pressed, as in a narrow pipe.

    With a ``lift`` of 0.45 full drive makes six segments' wave 3.9 times as fast.
    """

    lift: float = Field(
        default=0.0, ge=0, lt=0.5, description="share of R to which full drive lifts resting relays; 0: no drive"
    )
    drive: Share = Field(default=0.0, description="manual drive, to which pressure adds")
    per_segment: Share = Field(default=0.5, description="drive that one segment gives whose back is pressed fully")
    full_pressure_N: Positive = Field(
        default=3.0, description="force that presses a back fully; about a segment's weight"
    )
    pressure_time_constant_s: TimeConstant = Field(default=0.2, description="of the pressure neurons")
    time_constant_s: TimeConstant = Field(default=0.2, description="of the descending neuron")


class RobustSns(HalfCentreKind):
    """A peristalsis network made to keep its rhythm under wrong sensor signals: `annelid.nervous.robust`.

    All contraction neurons suppress each other, a slow relay counts each turn, and the stretch sensors entrain it
    within bounds. The `sensor` section's noise acts; its other fields are not used. With ``descending.lift`` the wave
    adapts to narrow pipes. Motor neurons (``let_go_s``) relax slowly, so that several segments share the wave; without
    them contraction and expansion neurons drive the muscles.
    """

    sensor_fields = frozenset({"noise_m"})
    cites = (("riddle2022", "the neurons"), ("szczecinski2017", "the rules by which synapses are designed"))
    tuned = ("controller.turn_ms=150:1500:log", "controller.activation_slope_per_mV=0.1:2:log")
    kind: Literal["sns-robust"] = "sns-robust"
    bifurcation_mV: float = Field(
        default=-1.0, lt=0, description="delta: below 0, so that the half-centre stays in either state"
    )
    turn_ms: Positive = Field(default=875.0, description="time from one segment's contraction to the next one's")
    push_nA: Positive = Field(default=6.0, description="current of a full relay into the next contraction neuron")
    entrainment: float = Field(
        default=0.02, ge=0, le=0.03, description="share of the relay's drive that the sensor may add"
    )
    habit_ms: Positive = Field(default=10000.0, description="time constant with which the sensor adapts")
    full_stretch_m: Positive = Field(default=0.08, description="mean lengthening that drives a stretch neuron to R")
    activation_slope_per_mV: Positive = Field(default=0.35, description="slope of the sigmoid, as in the paper")
    scheme: Literal["euler", "heun"] = Field(default="euler", description="forward Euler, or second order")
    start: Literal["design", "silent", "random"] = Field(
        default="design",
        description="state of the network at the start: segment 1 contracted, all neurons at rest, or drawn by seed",
    )
    let_go_s: float = Field(
        default=0.0, ge=0, le=100, description="time constant of the motor neurons; 0: there are none"
    )
    descending: DescendingDrive = DescendingDrive()

    def build(self, config: RunConfig, plant: Plant) -> RobustController:
        """Builds the controller, as `ControllerKind.build`."""
        return RobustController(self, plant.n_segments, plant.n_muscles, config.clock.control_timestep_s)

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the manual drive, if there is a descending neuron."""
        if not self.descending.lift:
            return ()
        return (Knob("controller.descending.drive", "drive", 1.0, 0.0, 1.0, 0.01, DRIVE_HINT),)


class RobustController(NeuralController):
    """Drives a worm by `annelid.nervous.robust`.

    One step, from t to t + dt: the segments' mean lengthening at t, and the forces of the ground on their backs, drive
    stretch and pressure neurons during the whole step; activation at t + dt is that of `NeuralController`, or that of
    the motor neurons, if there are any. The state is potentials and gates alone.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two per segment, network parameters for
            which a design rule has no solution, or a control step at which the network would not be stable.
    """

    name = "robust synthetic nervous system"
    recorded = (
        *NeuralController.recorded,
        ("stretch_activity", ("segment",), "1", "activity of the stretch neuron"),
        ("drive", (), "1", "activity of the descending neuron"),
    )

    def __init__(self, config: RobustSns, n_segments: int, n_muscles: int, control_timestep_s: float) -> None:
        self._config, drive = config, config.descending
        self._parameters = parameters = design_of(robust.RobustParameters, config)
        self._range_mV, self._full_nA = config.range_mV, config.leak_conductance_uS * config.range_mV
        if drive.lift:
            network = robust.driven_robust_network(
                n_segments,
                parameters,
                lift=drive.lift,
                per_segment=drive.per_segment,
                drive_ms=1e3 * drive.time_constant_s,
                pressure_ms=1e3 * drive.pressure_time_constant_s,
            )
        else:
            network = robust.robust_network(n_segments, parameters)
        # The motor neurons come last.
        self._motor = slice(len(network.neurons), None)
        if config.let_go_s:
            robust.add_motor_neurons(network, n_segments, parameters, 1e3 * config.let_go_s)
        longest_s = network.stable_timestep_ms() / 1e3
        if control_timestep_s > longest_s:
            raise ConfigError(
                f"clock.control_timestep_s = {control_timestep_s:g} must be at most {longest_s:.3g}, beyond which the "
                f"network of {n_segments} segments may be unstable"
            )
        super().__init__(
            network,
            robust.ROLES,
            n_segments,
            n_muscles,
            control_timestep_s,
            scheme=config.scheme,
            slope_per_mV=config.activation_slope_per_mV,
        )

    def reset(self, seed: int) -> None:
        """Returns to the state that ``start`` names.

        ``"silent"`` is all potentials at rest with steady gates, ``"random"`` potentials drawn evenly from the
        inhibitory reversal to three ranges and gates from 0 to 1.
        """
        state, config = self._stepper.initial_state(), self._config
        if config.start == "silent":
            state.potential[...] = 0.0
            [inactivation] = self._parameters.sodium_channel.slow_gates
            state.gate[...] = inactivation.steady(0.0)
        elif config.start == "random":
            rng = np.random.default_rng(seed)
            low, high = config.inhibitory_reversal_mV, 3.0 * config.range_mV
            state.potential[...] = rng.uniform(low, high, state.potential.shape)
            state.gate[...] = rng.random(state.gate.shape)
        self._start_at(state)

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `annelid.protocols.StridingController.stride`."""
        drive, further = self._config.descending, np.zeros(0)
        if drive.lift:
            # A body without a skin has no row of touch.
            back_N = sensation.touch_N[:, BACK] if len(sensation.touch_N) else np.zeros(self._n_segments)
            further = np.concatenate([[drive.drive], np.clip(back_N / drive.full_pressure_N, 0.0, 1.0)])
        stretch = (self._lengthening(sensation, n_steps) / self._config.full_stretch_m).clip(0.0, 1.0)
        inputs = self._full_nA * np.concatenate([stretch, np.tile(further, (n_steps, 1))], axis=1)
        return self._activation(np.concatenate([self._advance(own, 1) for own in inputs]))

    def _shares(self, potential: Array) -> Array:
        """Activation of every segment, ``(.., n_segments)``: the motor neurons' activity, if there are any."""
        if not self._config.let_go_s:
            return super()._shares(potential)
        return np.clip(potential[..., self._motor] / (robust.MOTOR_SHARE * self._range_mV), 0.0, 1.0)

    def code(self) -> ControllerCode:
        """Returns what it does as C, as `annelid.control.base.Coded.code`."""
        drive = self._config.descending
        constants = {"full_nA": self._full_nA, "full_stretch_m": self._config.full_stretch_m}
        inputs = """
    for (i = 0; i < N_SEGMENTS; i++)
        input_nA[i] = full_nA * clipped(sensors->lengthening_m[i] / full_stretch_m, 0, 1);"""
        if not drive.lift:
            return self._code(senses=("lengthening_m",), inputs=inputs, constants=constants)
        inputs += f"""
    input_nA[N_SEGMENTS] = full_nA * drive_share;
    for (i = 0; i < N_SEGMENTS; i++)
        input_nA[N_SEGMENTS + 1 + i] = full_nA * clipped(sensors->touch_N[i][{BACK}] / full_pressure_N, 0, 1);"""
        constants |= {"drive_share": drive.drive, "full_pressure_N": drive.full_pressure_N}
        return self._code(senses=("lengthening_m", "touch_N"), inputs=inputs, constants=constants)

    def _share_code(self) -> tuple[str, dict[str, float | Array]]:
        if not self._config.let_go_s:
            return super()._share_code()
        share = f"clipped(now.potential_mV[{self._motor.start} + i] / motor_full_mV, 0, 1)"
        return share, {"motor_full_mV": robust.MOTOR_SHARE * self._range_mV}

    def _values(self) -> Values:
        stretch = self._state.potential[0, self._of_role["stretch"]]
        values = {**super()._values(), "stretch_activity": np.clip(stretch / self._range_mV, 0.0, 1.0)}
        return values | ({"drive": self._activity(DRIVE_NEURON)} if self._config.descending.lift else {})

    def _attrs(self) -> dict[str, float | int | str]:
        return {"turn_ms": self._parameters.turn_ms}

"""The paper's controller with feedback from pressure, against slip."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.config.run import ControllerKind, RunConfig
from annelid.config.sections import NonNegative, Positive
from annelid.control.sns import PeristalsisController, Sns
from annelid.nervous import Network, peristalsis
from annelid.protocols import Array, Plant, Sensation

Strength = Annotated[float, Field(ge=0, le=5)]


class PressureSns(ControllerKind):
    """The synthetic nervous system with pressure feedback against slip: `annelid.nervous.peristalsis`.

    A segment that bears load stays expanded until the one before it is extended, and one that begins to contract ends
    the contraction two segments before; any of the three strengths may be 0. Lengths and loads are those of the
    six-segment robot (0.16 m radius, 19 N).
    """

    sensor_fields = Sns.sensor_fields
    tuned = (
        "controller.network.gate_time_constant_ms=80:900:log",
        "controller.hold=0:2",
        "controller.release=0:6",
        "controller.exchange=0:2",
        "sensor.tolerance_m=0.001:0.03:log",
    )
    kind: Literal["sns-pressure"] = "sns-pressure"
    network: Sns = Sns()
    light_N: NonNegative = Field(default=2.5, description="load of a segment up to which its pressure neuron rests")
    full_N: Positive = Field(default=9.0, description="load that drives it to R")
    extending_m: NonNegative = Field(default=0.045, description="lengthening from which a segment lets the next one go")
    extended_m: Positive = Field(default=0.055, description="lengthening at which it does so in full")
    hold: Strength = Field(default=1.0, description="potential over R that full pressure gives its sensory neuron")
    release: float = Field(
        default=1.8, ge=0, le=20, description="sensors' currents that a full extension neuron cancels"
    )
    exchange: Strength = Field(default=0.8, description="potential over R that a contraction gives the one two before")
    pressure_time_constant_s: float = Field(
        default=0.03, ge=1e-3, le=10, description="time constant of the pressure neurons"
    )

    @model_validator(mode="after")
    def _scales_rise(self) -> Self:
        for low, high in (("light_N", "full_N"), ("extending_m", "extended_m")):
            if not getattr(self, low) < getattr(self, high):
                raise ValueError(
                    f"controller.{low} = {getattr(self, low):g} must be less than controller.{high} = "
                    f"{getattr(self, high):g}"
                )
        return self

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has a skin that senses pressure."""
        if not config.body.has_skin:
            raise ValueError(
                f"controller.kind = 'sns-pressure' needs the touch of a skin, which body.kind = {config.body.kind!r} "
                "has not; only the 3D worm ('worm') has"
            )

    def build(self, config: RunConfig, plant: Plant) -> PressureController:
        """Builds the controller, as `ControllerKind.build`."""
        size = plant.n_segments, plant.n_muscles
        return PressureController(self, config.sensor, *size, config.clock.control_timestep_s)

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns what the network rests on, and the feedback."""
        return (*self.network.cited(), ("daltorio2013", "the aim of feedback from contact"))


class PressureController(PeristalsisController[PressureSns]):
    """Drives a worm by `annelid.nervous.peristalsis.pressure_network`.

    A segment's load is the sum of the normal forces on its four sides, its length the mean of its stretch sensors, both
    rising linearly from nothing to R. As long as segment 1's stretch sensor is kept off at the start, so is its load.
    The rest, errors too, is as for `annelid.control.SnsController`.
    """

    name = "synthetic nervous system with pressure feedback"
    _every_step_differs = True

    def _network(self, n_segments: int) -> Network:
        strengths = self._config.model_dump(include={"hold", "release", "exchange"})
        tau_ms = 1e3 * self._time_constant_s("pressure_time_constant_s")
        return peristalsis.pressure_network(n_segments, self._parameters, **strengths, pressure_ms=tau_ms)

    def _set_further(
        self, inputs_nA: Array, sensation: Sensation, longer_m: Array, time_s: float, n_taken: int
    ) -> None:
        config = self._config
        loads = (sensation.touch_N.sum(axis=1) - config.light_N) / (config.full_N - config.light_N)
        extensions = (longer_m - config.extending_m) / (config.extended_m - config.extending_m)
        inputs_nA[::2] = self._full_nA * np.clip(loads, 0.0, 1.0)
        inputs_nA[1::2] = self._full_nA * np.clip(extensions, 0.0, 1.0)
        if self._sensor.held_at(time_s):
            inputs_nA[0] = 0.0

    def _further_code(self) -> dict[str, Any]:
        inputs = """
    for (i = 0; i < N_SEGMENTS; i++) {
        real load_N = 0, longer_m = sensors->lengthening_m[i];
        for (j = 0; j < 4; j++) load_N += sensors->touch_N[i][j];
        input_nA[N_SEGMENTS + 1 + 2 * i] = full_nA * clipped((load_N - light_N) / load_range_N, 0, 1);
        input_nA[N_SEGMENTS + 2 + 2 * i] = full_nA * clipped((longer_m - extending_m) / extension_range_m, 0, 1);
    }
    if (now.n_steps < hold_steps) input_nA[N_SEGMENTS + 1] = 0;"""
        config = self._config
        constants = {
            "full_nA": self._full_nA,
            "light_N": config.light_N,
            "load_range_N": config.full_N - config.light_N,
            "extending_m": config.extending_m,
            "extension_range_m": config.extended_m - config.extending_m,
        }
        return {"senses": ("touch_N",), "inputs": inputs, "constants": constants}

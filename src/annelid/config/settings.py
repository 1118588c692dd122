"""The sections of a run of which there is one kind only: clock, stretch sensor, record and guard; and a contraction."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from annelid.config.sections import Level, NonNegative, Positive, Section

Timestep = Annotated[float, Field(ge=1e-6, le=1.0)]


def is_multiple(large: float, small: float) -> bool:
    """Whether one number is an integer multiple of another, at least once."""
    ratio = large / small
    return round(ratio) >= 1 and abs(ratio - round(ratio)) < 1e-6 * ratio


class Clock(Section):
    """Time steps: one is an integer multiple of the other."""

    control_timestep_s: Timestep = Field(default=0.001, description="step of the nervous system")
    physics_timestep_s: Timestep = Field(default=0.005, description="step of the body")

    @model_validator(mode="after")
    def _multiples(self) -> Self:
        small, large = sorted((self.control_timestep_s, self.physics_timestep_s))
        if not is_multiple(large, small):
            raise ValueError(
                f"clock.control_timestep_s = {self.control_timestep_s:g} and clock.physics_timestep_s = "
                f"{self.physics_timestep_s:g}: one must be an integer multiple of the other"
            )
        return self


class StretchSensor(Section):
    """How the nervous system reads its segments' lengths."""

    tolerance_m: NonNegative = Field(default=0.010, description="on while a segment is within this of its rest length")
    hysteresis_m: NonNegative = Field(default=0.0, description="once on, stays on until this much beyond the tolerance")
    startup_hold_s: NonNegative = Field(
        default=0.2, description="sensor of segment 1 held off for this long at the start"
    )
    noise_m: NonNegative = Field(default=0.0, description="standard deviation of the noise on every reading")


class Record(Section):
    """What goes into the run file how often."""

    signals_interval_s: Positive = Field(default=0.005, description="interval of potentials, lengths and forces")
    frames_interval_s: Positive = Field(default=0.04, description="interval of whole postures, for pictures and video")


class Guard(Section):
    """Limits at which a run stops because its numbers have run away."""

    kinetic_energy_J: Positive = Field(default=20.0, description="of the whole body and of what moves in a scene")
    height_m: Positive = Field(
        default=1.0, description="of any crossing above the ground (in a scene: its z = 0), or off a pipe's wall"
    )
    edge_strain: Positive = Field(default=0.05, description="of any edge of a rod")
    depth_m: Positive = Field(default=0.05, description="of any vertex below the ground, or outside a pipe's wall")


class Contraction(Section):
    """One contraction of one segment's ring."""

    segment: int = Field(ge=1, le=200, description="counted from 1 at the front")
    start_s: NonNegative = Field(description="when the activation begins to rise")
    stop_s: Positive = Field(description="when it begins to fall")
    activation: Level = Field(default=1.0, description="level that it rises to")

    @model_validator(mode="after")
    def _starts_before_it_stops(self) -> Self:
        if self.start_s >= self.stop_s:
            raise ValueError(
                f"controller.contractions: stop_s = {self.stop_s:g} of a contraction of segment {self.segment} must be "
                f"greater than its start_s = {self.start_s:g}"
            )
        return self

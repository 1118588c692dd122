"""A body: masses in a row on the ground, each joined to the next by a spring, a damper and a muscle.

Mass i at x_i with the velocity v_i feels the tensions of its two neighbours and the friction of the ground, which is
greater towards the rear, as of setae:

    m dv_i/dt = T_i - T_(i-1) - mu(v_i) m g v_i / sqrt(v_i^2 + v_0^2)
    T_i = k (x_(i+1) - x_i - l (1 - s a_i)) + c (v_(i+1) - v_i)

with the activation a_i of segment i, which shortens its spring by the share s. The front is towards -x.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from annelid import Finding, Sensation
from annelid.clock import StepRatio
from annelid.config import BodyKind, Knob, Positive, add_presets
from annelid.protocols import SavedAndRecorded

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.protocols import Array, Values

GRAVITY_M_PER_S2 = 9.81
SLOW_M_PER_S = 0.01
"""Velocity v_0 below which friction falls, so that a mass may creep to rest."""
add_presets("annelid_standing_wave")


class MassChain(BodyKind):
    """Masses in a row on the ground, which muscles between them draw together."""

    is_planar = True
    frame_size = (1280, 320)
    video_size = (960, 256)
    kind: Literal["mass-chain"] = "mass-chain"
    n_segments: Annotated[int, Field(ge=2, le=100)] = Field(default=4, description="segments")  # type: ignore[assignment]
    segment_m: Positive = Field(default=0.1, description="length of a segment at rest")
    height_m: Positive = Field(default=0.05, description="height of a segment at rest, which keeps its area")
    mass_kg: Positive = Field(default=0.05, description="each mass")
    stiffness_N_per_m: Positive = Field(default=60.0, description="of each spring")
    damping_Ns_per_m: Positive = Field(default=1.0, description="of each damper")
    shortening: Annotated[float, Field(gt=0, lt=1)] = Field(default=0.4, description="share lost at full activation")
    forward_friction: Positive = Field(default=0.2, description="coefficient of friction towards the front")
    backward_friction: Positive = Field(default=1.0, description="the same towards the rear")

    def build(self, config: RunConfig) -> MassChainPlant:
        """Builds the body at rest."""
        return MassChainPlant(self, StepRatio(config.clock.control_timestep_s, config.clock.physics_timestep_s))

    def outlines(self, values: Values) -> Array:
        """Returns the corners of every segment: a box between two masses, of the same area at any length."""
        x = np.asarray(values["mass_position"], dtype=float)
        left, right = x[..., :-1], x[..., 1:]
        top, ground = self.segment_m * self.height_m / (right - left), np.zeros_like(left)
        corners = ((left, ground), (left, top), (right, top), (right, ground))
        return np.stack([np.stack(corner, axis=-1) for corner in corners], axis=-2)

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks the physics step against the springs, the dampers and the friction."""
        friction = max(self.forward_friction, self.backward_friction)
        slowing = 4.0 * self.damping_Ns_per_m / self.mass_kg + friction * GRAVITY_M_PER_S2 / SLOW_M_PER_S
        rate = slowing + 2.0 * (self.stiffness_N_per_m / self.mass_kg) ** 0.5
        step_s = config.clock.physics_timestep_s
        if step_s * rate > 2.0:
            problem = "the masses are stepped explicitly, which is unstable in steps as long as this"
            yield Finding("clock.physics_timestep_s", step_s, problem, f"set at most {1.0 / rate:.1g}", "error")

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the slider of the friction in `annelid view`."""
        hint = "Friction of a mass that slides towards the rear."
        return (Knob("body.backward_friction", "friction to the rear", 1.0, 0.1, 2.0, 0.1, hint),)


class MassChainPlant(SavedAndRecorded):
    """The masses as they move."""

    recorded = (
        ("mass_position", ("mass",), "m", "position of a mass along x"),
        ("stretch_length", ("segment", "sensor"), "m", "length of a segment"),
        ("ring_length", ("muscle",), "m", "length of a muscle"),
        ("muscle_force", ("muscle",), "N", "tension of spring, damper and muscle"),
        ("center_of_mass", ("axis",), "m", "centre of mass; the front points to -x"),
    )

    def __init__(self, body: MassChain, ratio: StepRatio) -> None:
        """Takes the section of the body, and how its steps interleave with the controller's."""
        self._body, self._ratio = body, ratio
        self.n_segments = self.n_muscles = body.n_segments
        self.reset(0)

    def reset(self, seed: int) -> Sensation:
        """Returns to rest at time zero; nothing here is random."""
        n = self.n_segments
        place = self._body.segment_m * np.arange(n + 1.0)
        self._now = {"x": place, "v": np.zeros(n + 1), "tension": np.zeros(n), "steps": np.array(0)}
        return self._sense()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step, as `annelid.Plant.step`."""
        body, now, step_s = self._body, self._now, self._ratio.physics_timestep_s
        now["steps"] += 1
        wanted = body.segment_m * (1.0 - body.shortening * np.asarray(activation))
        for _ in range(self._ratio.physics_steps_due(int(now["steps"]))):
            x, v = now["x"], now["v"]
            tension = body.stiffness_N_per_m * (np.diff(x) - wanted) + body.damping_Ns_per_m * np.diff(v)
            coefficient = np.where(v < 0.0, body.forward_friction, body.backward_friction)
            friction = coefficient * body.mass_kg * GRAVITY_M_PER_S2 * v / np.hypot(v, SLOW_M_PER_S)
            force = np.append(tension, 0.0) - np.insert(tension, 0, 0.0) - friction
            now["v"] = v + step_s / body.mass_kg * force
            now["x"], now["tension"] = x + step_s * now["v"], tension
        return self._sense()

    def _sense(self) -> Sensation:
        length = np.diff(self._now["x"])
        weight = np.zeros((self.n_segments, 3))
        weight[:, 2] = self._body.mass_kg * GRAVITY_M_PER_S2
        return Sensation(
            time_s=int(self._now["steps"]) * self._ratio.control_timestep_s,
            stretch_m=length[:, np.newaxis],
            rest_stretch_m=np.full((self.n_segments, 1), self._body.segment_m),
            ring_length_m=length,
            muscle_force_N=self._now["tension"].copy(),
            contact_force_N=weight,
            center_of_mass_m=np.array([self._now["x"].mean(), 0.0, 0.0]),
        )

    def _values(self) -> Values:
        sensed = self._sense()
        return {
            "mass_position": self._now["x"].copy(),
            "stretch_length": sensed.stretch_m,
            "ring_length": sensed.ring_length_m,
            "muscle_force": sensed.muscle_force_N,
            "center_of_mass": sensed.center_of_mass_m,
        }

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"segment": list(range(1, self.n_segments + 1)), "axis": ["x", "y", "z"]}

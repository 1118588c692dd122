"""The kinematic planar worm of Riddle et al. 2022: rhombi with rigid sides and speed-limited actuators."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from annelid.clock import StepRatio
from annelid.config import Positive
from annelid.errors import ConfigError
from annelid.protocols import Array, SavedAndRecorded, Sensation, Values
from annelid_studies.planar.sections import PlanarWorm, rhombi

if TYPE_CHECKING:
    from annelid.config import Clock, RunConfig


class PlanarBody(PlanarWorm):
    """The kinematic planar worm of Riddle 2022: rhombi with rigid sides and speed-limited actuators."""

    cites = (("riddle2022", "the planar worm"),)
    frame_size = (1280, 560)
    video_size = (960, 432)
    kind: Literal["riddle2022"] = "riddle2022"
    heights = ("height_min_m", "height_max_m")
    height_min_m: Positive = Field(default=0.065, description="height when contracted")
    height_max_m: Positive = Field(default=0.11, description="height when relaxed")
    gain: Positive = Field(
        default=1.3, description="proportional gain k of the actuator; 1.3, 1.9, 3.6 for 300, 200, 100 ms"
    )

    def outlines(self, values: Values) -> Array:
        """Returns rhombi about the middle, as `BodyKind.outlines`: the worm has nothing to push against."""
        return rhombi(np.asarray(values["stretch_length"])[..., 0], np.asarray(values["ring_length"]))

    def build(self, config: RunConfig) -> Riddle2022Plant:
        """Builds the worm, as `BodyKind.build`."""
        return Riddle2022Plant(self, config.clock)


# A spool at 20 turns a minute takes up 2 pi 20 / 60 cm/s per cm of radius; the authors' loop moves 1/300 of that
# number a millisecond for each unit of gain and of height error, so per second it is 1000 / 300 of it.
_RATE_PER_S = 2.0 * np.pi * 20.0 / 60.0 / 300.0 * 1000.0


class Riddle2022Plant(SavedAndRecorded):
    """A chain of rhombi: each height follows its activation, each length follows from the rigid sides.

    Heights are commanded to ``h_max - activation (h_max - h_min)`` and approach it in proportion to the gap,
    ``dh/dt = gain (2 pi 20 / 60 / 300 per ms) (target - h)``, stepped by forward Euler at the physics step.
    A segment's length is ``sqrt((2 side)^2 - h^2)``; it is its one stretch sensor, at rest when relaxed. There are no
    forces and no ground: muscle forces and the centre of mass are NaN, contact forces 0.

    The worm starts as the network does, segment 1 contracted and all others relaxed.

    Raises:
        ConfigError: ``gain`` times the physics step is so long that heights would overshoot their targets.
    """

    recorded = (
        ("stretch_length", ("segment", "sensor"), "m", "length of a segment"),
        ("ring_length", ("muscle",), "m", "height of a rhombus"),
        ("center_of_mass", ("axis",), "m", "NaN: a kinematic worm does not travel"),
    )

    def __init__(self, body: PlanarBody, clock: Clock) -> None:
        """Builds the worm in its initial posture.

        Args:
            body: Section of the planar body.
            clock: Section of the time steps.
        """
        self._body = body
        self.n_segments = self.n_muscles = body.n_segments
        self._ratio = StepRatio(clock.control_timestep_s, clock.physics_timestep_s)
        self._approach = body.gain * _RATE_PER_S * clock.physics_timestep_s
        if self._approach > 1.0:
            longest = 1.0 / (body.gain * _RATE_PER_S)
            raise ConfigError(
                f"clock.physics_timestep_s = {clock.physics_timestep_s:g} lets heights overshoot at body.gain = "
                f"{body.gain:g}; it must be at most {longest:.4g}"
            )
        self._rest_length_m = np.full((body.n_segments, 1), self._length(np.array(body.height_max_m)))
        self.reset(0)

    def reset(self, seed: int) -> Sensation:
        """Returns to the initial posture at time zero; nothing here is random."""
        height_m = np.full(self.n_segments, self._body.height_max_m)
        height_m[0] = self._body.height_min_m
        self._now = {"height": height_m, "n_control_steps": np.array(0)}
        return self.sense()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step, as `annelid.Plant.step`; activation 1 commands the smallest height."""
        n_control_steps = int(self._now["n_control_steps"]) + 1
        height_m, target_m = self._now["height"].astype(np.float64), self._target_m(activation)
        for _ in range(self._ratio.physics_steps_due(n_control_steps)):
            height_m += self._approach * (target_m - height_m)
        self._now = {"height": height_m, "n_control_steps": np.array(n_control_steps)}
        return self.sense()

    def sense(self) -> Sensation:
        """Returns what the body senses at this instant."""
        height_m = self._now["height"].astype(np.float64)
        return Sensation(
            time_s=int(self._now["n_control_steps"]) * self._ratio.control_timestep_s,
            stretch_m=self._length(height_m)[:, np.newaxis],
            rest_stretch_m=self._rest_length_m.copy(),
            ring_length_m=height_m,
            muscle_force_N=np.full(self.n_segments, np.nan),
            contact_force_N=np.zeros((self.n_segments, 3)),
            center_of_mass_m=np.full(3, np.nan),
        )

    def height_rate_m_per_s(self, height_m: Array, activation: Array) -> Array:
        """Returns how fast heights change, m/s, for any number of worms, ``(.., n_segments)``."""
        return self._body.gain * _RATE_PER_S * (self._target_m(activation) - height_m)

    def lengthening_m(self, height_m: Array) -> Array:
        """Returns how much longer than at rest segments of these heights are, m, ``(.., n_segments)``."""
        return self._length(height_m) - self._rest_length_m[:, 0]

    def _values(self) -> Values:
        sensed = self.sense()
        return {
            "stretch_length": sensed.stretch_m,
            "ring_length": sensed.ring_length_m,
            "center_of_mass": sensed.center_of_mass_m,
        }

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"segment": list(range(1, self.n_segments + 1)), "axis": ["x", "y", "z"]}

    def _attrs(self) -> dict[str, float | int | str]:
        return {"plant": "planar kinematic worm of Riddle et al. 2022"}

    def _target_m(self, activation: Array) -> Array:
        return self._body.height_max_m - np.asarray(activation) * (self._body.height_max_m - self._body.height_min_m)

    def _length(self, height_m: Array) -> Array:
        return np.sqrt((2.0 * self._body.side_m) ** 2 - height_m * height_m)

"""The kinematic planar worm of Riddle et al. 2022: rhombi with rigid sides and speed-limited actuators."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from annelid.clock import StepRatio
from annelid.config.sections import Positive
from annelid.errors import ConfigError
from annelid.planar.sections import PlanarWorm
from annelid.protocols import Array, Recordable, Sensation, Signal, State

if TYPE_CHECKING:
    from annelid.config.run import Clock, RunConfig


class PlanarBody(PlanarWorm):
    """The kinematic planar worm of Riddle 2022: rhombi with rigid sides and speed-limited actuators."""

    cites: ClassVar[tuple[tuple[str, str], ...]] = (("riddle2022", "the planar worm"),)
    touches_ground: ClassVar[bool] = False
    kind: Literal["riddle2022"] = "riddle2022"
    side_m: Positive = Field(default=0.073, description="side of a rhombus")
    height_min_m: Positive = Field(default=0.065, description="height when contracted")
    height_max_m: Positive = Field(default=0.11, description="height when relaxed")
    gain: Positive = Field(
        default=1.3, description="proportional gain k of the actuator; 1.3, 1.9, 3.6 for 300, 200, 100 ms"
    )

    @model_validator(mode="after")
    def _heights_fit_the_rhombus(self) -> Self:
        if not self.height_min_m < self.height_max_m < 2 * self.side_m:
            raise ValueError(
                f"body.height_min_m = {self.height_min_m:g} and body.height_max_m = {self.height_max_m:g} must satisfy "
                f"height_min_m < height_max_m < 2 side_m = {2 * self.side_m:g}"
            )
        return self

    def build(self, config: RunConfig) -> Riddle2022Plant:
        """Builds the worm, as `BodyKind.build`."""
        return Riddle2022Plant(self, config.clock)


# A spool at 20 turns a minute takes up 2 pi 20 / 60 cm/s per cm of radius; the authors' loop moves 1/300 of that
# number a millisecond for each unit of gain and of height error, so per second it is 1000 / 300 of it.
_RATE_PER_S = 2.0 * np.pi * 20.0 / 60.0 / 300.0 * 1000.0


class Riddle2022Plant:
    """A chain of rhombi: each height follows its activation, each length follows from the rigid sides.

    Heights are commanded to ``h_max - activation (h_max - h_min)`` and approach it in proportion to the gap,
    ``dh/dt = gain (2 pi 20 / 60 / 300 per ms) (target - h)``, stepped by forward Euler at the physics step.
    A segment's length is ``sqrt((2 side)^2 - h^2)``; it is its one stretch sensor, at rest when relaxed. There are no
    forces and no ground: muscle forces and the centre of mass are NaN, contact forces 0.

    The worm starts as the network does, segment 1 contracted and all others relaxed.

    Raises:
        ConfigError: ``gain`` times the physics step is so long that heights would overshoot their targets.
    """

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
        self._height_m = np.full(self.n_segments, self._body.height_max_m)
        self._height_m[0] = self._body.height_min_m
        self._n_control_steps = 0
        return self.sense()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step.

        Args:
            activation: Shape ``(n_segments,)``, in [0, 1]; 1 commands the smallest height.

        Returns:
            The sensation at its end.
        """
        self._n_control_steps += 1
        self._move(self._height_m, activation, self._n_control_steps)
        return self.sense()

    def sense(self) -> Sensation:
        """Returns what the body feels at this instant."""
        return self._sensation(self._height_m, self._n_control_steps)

    def step_copies(self, states: State, activation: Array) -> State:
        """Advances many copies by one control step at once, as `step` does one; changes nothing here.

        Args:
            states: As `get_state` returns them, the heights with one more axis in front, ``n_copies`` long.
            activation: Shape ``(n_copies, n_segments)``.

        Returns:
            The states one step on.
        """
        height, n_control_steps = states["height"].astype(np.float64), int(states["n_control_steps"]) + 1
        self._move(height, activation, n_control_steps)
        return {"height": height, "n_control_steps": np.array(n_control_steps)}

    def sense_copies(self, states: State) -> Sensation:
        """Returns what many copies feel: every array with their axis in front, and one time for all."""
        return self._sensation(states["height"].astype(np.float64), int(states["n_control_steps"]))

    def recordable(self) -> Recordable:
        """Names lengths, heights and the (absent) centre of mass."""
        n = self.n_segments
        return Recordable(
            signals=(
                Signal("stretch_length", ("segment", "sensor"), (n, 1), "m", "length of a segment"),
                Signal("ring_length", ("muscle",), (n,), "m", "height of a rhombus"),
                Signal("center_of_mass", ("axis",), (3,), "m", "NaN: a kinematic worm does not travel"),
            ),
            coords={"segment": list(range(1, n + 1)), "axis": ["x", "y", "z"]},
            attrs={"plant": "planar kinematic worm of Riddle et al. 2022"},
        )

    def read(self, frame: bool) -> Mapping[str, NDArray[np.generic] | float]:
        """Reads the signals that `recordable` names; there are none at frame rate."""
        if frame:
            return {}
        return {
            "stretch_length": self._length(self._height_m)[:, np.newaxis],
            "ring_length": self._height_m.copy(),
            "center_of_mass": np.full(3, np.nan),
        }

    def get_state(self) -> State:
        """Returns copies of the heights (m) and the number of control steps taken."""
        return {"height": self._height_m.copy(), "n_control_steps": np.array(self._n_control_steps)}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._height_m[...] = state["height"]
        self._n_control_steps = int(state["n_control_steps"])

    def _move(self, height_m: Array, activation: Array, n_control_steps: int) -> None:
        """Moves heights, ``(.., n_segments)``, in place by the physics steps that this control step completes."""
        body = self._body
        target = body.height_max_m - np.asarray(activation) * (body.height_max_m - body.height_min_m)
        for _ in range(self._ratio.physics_steps_due(n_control_steps)):
            height_m += self._approach * (target - height_m)

    def _length(self, height_m: Array) -> Array:
        return np.sqrt((2.0 * self._body.side_m) ** 2 - height_m * height_m)

    def _sensation(self, height_m: Array, n_control_steps: int) -> Sensation:
        copies = height_m.shape[:-1]
        return Sensation(
            time_s=n_control_steps * self._ratio.control_timestep_s,
            stretch_m=self._length(height_m)[..., np.newaxis],
            rest_stretch_m=self._rest_length_m + np.zeros((*copies, 1, 1)),
            ring_length_m=height_m.copy(),
            muscle_force_N=np.full(height_m.shape, np.nan),
            contact_force_N=np.zeros((*height_m.shape, 3)),
            center_of_mass_m=np.full((*copies, 3), np.nan),
        )

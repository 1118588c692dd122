"""Controllers for comparison: the discrete gaits of metameric worms, by the clock, and a reflex of stretch and load."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from annelid.clock import SLACK_S
from annelid.config import ControllerKind, NonNegative, Positive
from annelid.control import OpenLoopKind, SegmentController, lengthening_m
from annelid.errors import ConfigError
from annelid.protocols import SIDES, Array, Plant, Sensation, Values

if TYPE_CHECKING:
    from annelid.config import RunConfig

BELLY = SIDES.index("belly")


class DiscreteGait(OpenLoopKind):
    """Open loop: a pattern of contracted and relaxed segments that moves back by whole segments.

    In each unit of time the same number of segments in a row is contracted, thin and long, while the others anchor the
    worm; in the next unit the pattern stands ``shift`` segments further back, and what leaves the rear enters at the
    front. All ``(N - 1)^2`` patterns of N segments are gaits of the family that Fang et al. describe for metameric
    worms, with the transitions left to the muscles.
    """

    title = "discrete gait"
    cites = (("fang2015", "the family of discrete gaits"),)
    kind: Literal["discrete"] = "discrete"
    contracted: int = Field(default=1, ge=1, le=199, description="segments in a row that are contracted at a time")
    shift: int = Field(default=1, ge=1, le=199, description="segments by which the pattern moves back in each unit")
    unit_s: Positive = Field(default=0.875, description="time for which the pattern stays")

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has more segments than are contracted, and than the pattern moves by."""
        for name, value in (("contracted", self.contracted), ("shift", self.shift)):
            if value >= config.body.n_segments:
                raise ValueError(
                    f"controller.{name} = {value}: must be less than the number of segments, {config.body.n_segments}"
                )

    def activation(self, time_s: ArrayLike, n_segments: int) -> Array:
        """Returns 1 for the segments i = 0 .. N-1 with ``(i - shift unit) mod N < contracted``, else 0."""
        unit = np.floor((np.asarray(time_s, dtype=float)[..., np.newaxis] + SLACK_S) / self.unit_s)
        place = (np.arange(n_segments) - self.shift * unit) % n_segments
        return (place < self.contracted).astype(float)


class ReflexWave(ControllerKind):
    """Closed loop without neurons: a wave that moves on when the body has done what was asked.

    The front of the wave moves to the next segment once its own segment has lengthened by ``enough_m``, and once the
    segment that was relaxed last stands on the ground with ``landed_N``; or after ``patience_s``, whatever is sensed.
    """

    kind: Literal["reflex"] = "reflex"
    contracted: int = Field(default=1, ge=1, le=199, description="segments in a row that are contracted at a time")
    enough_m: NonNegative = Field(default=0.03, description="lengthening at which a segment hands over; 0: not waited")
    landed_N: NonNegative = Field(
        default=0.0, description="force on the belly of the segment relaxed last; 0: not waited for"
    )
    least_s: NonNegative = Field(default=0.05, description="the wave stays at a segment for at least this long")
    patience_s: Positive = Field(default=2.0, description="and for at most this long")

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has more segments than are contracted, and a skin where load is sensed."""
        if self.contracted >= config.body.n_segments:
            raise ValueError(
                f"controller.contracted = {self.contracted}: must be less than the number of segments, "
                f"{config.body.n_segments}"
            )
        if self.landed_N and not config.body.has_skin:
            raise ValueError(f"controller.landed_N = {self.landed_N:g}: this body senses no touch; leave it at 0")

    def build(self, config: RunConfig, plant: Plant) -> ReflexController:
        """Builds the controller, as `ControllerKind.build`."""
        return ReflexController(self, plant.n_segments, plant.n_muscles)


class ReflexController(SegmentController):
    """A wave that waits for the body, on the muscles.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment.
    """

    name = "reflex of stretch and load"
    recorded = (("front", (), "1", "segment at the front of the wave, from 1"),)

    def __init__(self, reflex: ReflexWave, n_segments: int, n_muscles: int) -> None:
        """Begins with segment 1."""
        super().__init__(n_segments, n_muscles)
        if reflex.least_s > reflex.patience_s:
            raise ConfigError(
                f"controller.least_s = {reflex.least_s:g}: must be at most controller.patience_s = "
                f"{reflex.patience_s:g}"
            )
        self._reflex = reflex
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to segment 1; nothing here is random."""
        self._now = {"front": np.array(0), "since_s": np.array(0.0)}

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `SegmentController.step`; lengths and touch are sensed."""
        reflex, front = self._reflex, int(self._now["front"])
        waited_s = sensation.time_s - float(self._now["since_s"]) + SLACK_S
        long_enough = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)[front] >= reflex.enough_m
        last = (front - reflex.contracted) % self.n_segments
        landed = not reflex.landed_N or sensation.touch_N[last, BELLY] >= reflex.landed_N
        if waited_s >= reflex.patience_s or (waited_s >= reflex.least_s and long_enough and landed):
            front = (front + 1) % self.n_segments
            self._now = {"front": np.array(front), "since_s": np.array(sensation.time_s)}
        behind_front = (front - np.arange(self.n_segments)) % self.n_segments
        return (behind_front < reflex.contracted).astype(float).repeat(self.muscles_per_segment)

    def _values(self) -> Values:
        return {"front": float(self._now["front"]) + 1.0}

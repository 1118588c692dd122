"""Open loop: contractions at times that are given beforehand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from annelid.clock import SLACK_S
from annelid.config.kinds import ControllerKind
from annelid.config.sections import NonNegative, Positive, Section
from annelid.control.base import OpenLoopController
from annelid.errors import ConfigError
from annelid.protocols import Array, Plant

if TYPE_CHECKING:
    from annelid.config.run import RunConfig


class Contraction(Section):
    """One contraction of one segment's ring."""

    segment: int = Field(ge=1, le=200, description="counted from 1 at the front")
    start_s: NonNegative = Field(description="when the activation begins to rise")
    stop_s: Positive = Field(description="when it begins to fall")
    activation: float = Field(default=1.0, gt=0, le=1, description="level that it rises to")

    @model_validator(mode="after")
    def _starts_before_it_stops(self) -> Self:
        if self.start_s >= self.stop_s:
            raise ValueError(
                f"controller.contractions: stop_s = {self.stop_s:g} of a contraction of segment {self.segment} must be "
                f"greater than its start_s = {self.start_s:g}"
            )
        return self


class Program(ControllerKind):
    """Open loop: contractions at times that are given beforehand, whatever the sensors read.

    Where contractions of one segment overlap, the larger activation wins.
    """

    kind: Literal["program"] = "program"
    contractions: tuple[Contraction, ...] = Field(description="segment, start_s, stop_s and activation of each")
    ramp_s: NonNegative = Field(default=0.0, description="time that a rise or fall between 0 and the full level takes")

    @property
    def scheduled(self) -> tuple[Contraction, ...]:
        """As `contractions`."""
        return self.contractions

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has the segments that contract."""
        n_segments = config.body.n_segments
        for i, contraction in enumerate(self.contractions):
            if contraction.segment > n_segments:
                raise ValueError(
                    f"controller.contractions.{i}.segment = {contraction.segment}: must be in 1 .. {n_segments}, the "
                    "segments of the body"
                )

    def build(self, config: RunConfig, plant: Plant) -> ProgramController:
        """Builds the controller, as `ControllerKind.build`."""
        return ProgramController(self, plant.n_segments, plant.n_muscles)


class ProgramController(OpenLoopController[Program]):
    """Contracts segments at times that are given beforehand.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment, or a contraction of a segment that the
            worm does not have.
    """

    name = "program of contractions"

    def __init__(self, pattern: Program, n_segments: int, n_muscles: int) -> None:
        """Builds the controller from the same as `OpenLoopController`."""
        last = max((contraction.segment for contraction in pattern.contractions), default=0)
        if last > n_segments:
            raise ConfigError(f"a contraction is of segment {last}, but the worm has segments 1 .. {n_segments}")
        super().__init__(pattern, n_segments, n_muscles)

    def activation(self, time_s: ArrayLike) -> Array:
        """Returns the activation at times.

        A contraction's activation rises from its start on and falls from its stop on, both at its level per ``ramp_s``;
        one that is shorter than the ramp falls from what it has reached. Without a ramp it is at its level from start
        to stop, start included, stop not. Where contractions overlap, the larger wins.

        Args:
            time_s: Simulated times, s, any shape.

        Returns:
            Activation of each segment in [0, 1], shape ``(*time_s.shape, n_segments)``.
        """
        times, ramp = np.asarray(time_s, dtype=float), self._pattern.ramp_s
        activation = np.zeros((*times.shape, self._n_segments))
        for contraction in self._pattern.contractions:
            of_segment = activation[..., contraction.segment - 1]
            since_start, since_stop = times - contraction.start_s, times - contraction.stop_s
            if ramp > 0:
                reached = min(1.0, (contraction.stop_s - contraction.start_s) / ramp)
                share = np.clip(np.minimum(since_start, reached * ramp - since_stop) / ramp, 0.0, 1.0)
            else:
                share = (since_start >= -SLACK_S) & (since_stop < -SLACK_S)
            np.maximum(of_segment, contraction.activation * share, out=of_segment)
        return activation

"""A controller: every other segment contracts, then the ones between; its fields are those of any other's."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from annelid.config import ControllerKind, Knob, Positive
from annelid.control import OpenLoopController

if TYPE_CHECKING:
    from annelid.config import RunConfig
    from annelid.protocols import Plant


class StandingWave(ControllerKind):
    """Open loop: a standing wave of two segments."""

    cites: ClassVar[tuple[tuple[str, str], ...]] = (("standing2026", "the standing wave"),)
    bibtex: ClassVar[str] = "@misc{standing2026,\n  title = {A standing wave},\n  year = {2026},\n}"
    kind: Literal["standing-wave"] = "standing-wave"
    period_s: Positive = Field(default=2.0, description="time of one cycle")

    def build(self, config: RunConfig, plant: Plant) -> StandingWaveController:
        """Builds the controller for a body."""
        return StandingWaveController(self, plant.n_segments, plant.n_muscles)

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the slider of the period in `annelid view`."""
        return (Knob("controller.period_s", "period (s)", 1.0, 0.5, 10.0, 0.1, "Time of one cycle."),)


class StandingWaveController(OpenLoopController[StandingWave]):
    """Contracts odd and even segments in turn."""

    name = "standing wave"

    def activation(self, time_s: float) -> NDArray[np.float64]:
        """Returns the activation of every segment at a time."""
        sides = np.where(np.arange(self.n_segments) % 2 == 0, 1.0, -1.0)
        return 0.5 * (1.0 + sides * np.cos(2.0 * np.pi * time_s / self.pattern.period_s))

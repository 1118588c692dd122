"""A controller: every other segment contracts, then the ones between; its fields are those of any other's."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from annelid.config import Knob, Positive
from annelid.control import OpenLoopKind


class StandingWave(OpenLoopKind):
    """Open loop: a standing wave of two segments."""

    title: ClassVar[str] = "standing wave"
    cites: ClassVar[tuple[tuple[str, str], ...]] = (("standing2026", "the standing wave"),)
    bibtex: ClassVar[str] = "@misc{standing2026,\n  title = {A standing wave},\n  year = {2026},\n}"
    kind: Literal["standing-wave"] = "standing-wave"
    period_s: Positive = Field(default=2.0, description="time of one cycle")

    def activation(self, time_s: ArrayLike, n_segments: int) -> NDArray[np.float64]:
        """Returns the activation of every segment at times."""
        sides = np.where(np.arange(n_segments) % 2 == 0, 1.0, -1.0)
        turns = np.asarray(time_s, dtype=float)[..., np.newaxis] / self.period_s
        return 0.5 * (1.0 + sides * np.cos(2.0 * np.pi * turns))

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the slider of the period in `annelid view`."""
        return (Knob("controller.period_s", "period (s)", 1.0, 0.5, 10.0, 0.1, "Time of one cycle."),)

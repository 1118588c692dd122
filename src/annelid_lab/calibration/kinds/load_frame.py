"""A segment in a load frame: force over the displacement of its ring's cable, wound in and let out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from annelid.config import Line, NonNegative, Positive, RunConfig
from annelid.protocols import Array
from annelid.textfiles import read_text
from annelid_lab.calibration.base import Data, Experiment, Found, file_beside, read_columns
from annelid_lab.calibration.frame import Loop, cable_force, load_frame, loop_of_table, read_loop


@dataclass(frozen=True)
class FrameTest:
    """Winds the cable in and out."""

    displacement_m: float
    speed_m_per_s: float
    haste: float

    def run(self, config: RunConfig) -> Found:
        """Gives the mean tension of the cable over its displacement."""
        loop = load_frame(
            config, displacement_m=self.displacement_m, speed_m_per_s=self.speed_m_per_s, haste=self.haste
        )
        return {"displacement_m": loop.displacement_m, "tension_N": loop.force_N}


class LoadFrame(Experiment):
    """A loop of a ring's cable."""

    kind: Literal["load-frame"] = "load-frame"
    time: Line | None = Field(default="time_s", description="column of the time; none: there is none")
    displacement: Line = Field(default="displacement_mm", description="column of the cable's displacement")
    force: Line = Field(default="force_N", description="column of the cable's force")
    points: Annotated[int, Field(ge=4, le=200)] = Field(default=20, description="points on each branch, means between")
    cable_friction: NonNegative = Field(
        default=0.0, description="friction coefficient of the cable round the ring times its angle of wrap"
    )
    speed_m_per_s: Positive = Field(default=0.01, description="speed of the cable")
    haste: Annotated[float, Field(ge=1, le=100)] = Field(
        default=8.0, description="simulated so many times as fast, with viscous coefficients divided by as much"
    )

    def read(self, folder: Path) -> Data:
        """Reads forces, N, at even displacements, loading first; a table without a header is mm, N."""
        path = file_beside(folder, self.data, f"experiments.{self.name}.data")
        notes: tuple[str, ...] = ()
        first = read_text(path).lstrip()[:1] if path.suffix.lower() in (".csv", ".txt") else ""
        if first in tuple("-+.0123456789") and first:
            loop = read_loop(path)
        else:
            columns, notes = read_columns(path, self.time, {self.displacement: "m", self.force: "N"})
            loop = loop_of_table(columns[self.displacement], columns[self.force], str(path))
        at = loop.places(self.points)
        values, side = loop.branches(at), np.repeat([0, 1], self.points)
        labels = ("displacement of the cable (m)", "force of the cable (N)")
        # Where rows are missing, the mean lies beside the middle.
        centre = loop.branches(at, loop.displacement_m).ravel()
        return Data(centre, values.ravel(), side, labels, "N", notes, at)

    def test(self, config: RunConfig, data: Data) -> FrameTest:
        """Returns the loop to wind, as far as the measured one: see `Loop.places`."""
        return FrameTest(float(f"{data.source[0] * (self.points + 2):.6g}"), self.speed_m_per_s, self.haste)

    def predicted(self, config: RunConfig, data: Data, found: Found) -> Array:
        """Returns the force at the cable's pulled end at each point, N."""
        loop, at = self._loop(found), data.source
        force, centre = loop.branches(at), loop.branches(at, loop.displacement_m)
        slope = np.stack([np.gradient(*pair) for pair in zip(force, centre, strict=True)])
        return (force + slope * (data.at.reshape(2, -1) - centre)).ravel()

    def numbers(self, data: Data, found: Found) -> dict[str, float]:
        """Returns the share of the work that is lost, between the points: fitted and measured."""
        at = data.source
        fitted = self._loop(found).branches(at)
        work = np.asarray(np.trapezoid(np.stack([fitted, data.values.reshape(2, -1)]), at, axis=-1))
        lost = 1.0 - work[:, 1] / work[:, 0]
        return {"lost_share_fitted": float(lost[0]), "lost_share_measured": float(lost[1])}

    def _loop(self, found: Found) -> Loop:
        return cable_force(Loop(found["displacement_m"], found["tension_N"]), self.cable_friction)

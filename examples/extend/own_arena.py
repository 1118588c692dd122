"""An arena of your own: ground that is corrugated along the worm.

    python examples/extend/own_arena.py [folder]

The class is all there is: its fields, and where its surface lies. Takes a few seconds.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from annelid import load_config, simulate
from annelid.arena import Ground, Implicit, Level, Surface
from annelid.config.sections import Positive


class Corrugated(Ground):
    """Ground with waves across the worm's way."""

    kind: Literal["corrugated"] = "corrugated"
    wave_height_m: Positive = Field(default=0.01, description="height of a crest above a trough")
    wave_length_m: Positive = Field(default=0.3, description="distance of two crests")

    def ground(self) -> Surface:
        """Returns the waves, whose crests are as high as a level floor."""
        return Waves(self.wave_height_m, 2.0 * np.pi / self.wave_length_m, -self.floor_gap_m)


@dataclass(frozen=True)
class Waves(Implicit):
    """The surface: heights above it, and their slopes."""

    height_m: float
    rate_per_m: float
    top_m: float

    def level(self, points_m: NDArray[np.float64]) -> Level:
        """Returns how far points lie above the ground straight below them, m, and how that changes with the place."""
        phase = self.rate_per_m * points_m[:, 0]
        above = points_m[:, 2] - self.top_m + 0.5 * self.height_m * (1.0 - np.cos(phase))
        rise = 0.5 * self.height_m * self.rate_per_m * np.sin(phase)
        gradient = np.stack([rise, np.zeros_like(rise), np.ones_like(rise)], axis=-1)
        return Level(above, gradient, np.zeros(len(above), dtype=bool))


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary)
        for height_m in (0.002, 0.02):
            arena = {"kind": "corrugated", "wave_height_m": height_m}
            run = simulate(load_config("riddle2023-fast", {"arena": arena, "duration_s": 0.3}), folder / f"{height_m}")
            print(f"waves of {1e3 * height_m:g} mm: centre of mass at {1e3 * run.data['center_of_mass'][-1, 2]:.1f} mm")

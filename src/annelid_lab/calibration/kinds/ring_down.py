"""A strand that is clamped at one end, bent, released, and rings down: its material's damping time.

Closed form: the first mode of a straight cantilever of Kelvin-Voigt material, with a mass at its tip, at small
amplitude. Its displacement obeys ``x'' + w^2 tau x' + w^2 x = 0``; amplitude, phase and the place of rest are found by
linear least squares, so neither the instant of the release nor its height has to be known.
"""

from __future__ import annotations

from math import cos, cosh, sin, sinh, sqrt
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from annelid.body import worm_of
from annelid.config import Length, Line, NonNegative, RunConfig
from annelid.errors import ConfigError
from annelid.protocols import Array
from annelid_lab.calibration.base import Data, Experiment, Found, binned, file_beside, read_columns


class RingDown(Experiment):
    """Displacement of the tip of a strand over time; closed form."""

    kind: Literal["ring-down"] = "ring-down"
    time: Line = Field(default="time_s", description="column of the time")
    displacement: Line = Field(default="displacement_mm", description="column of the tip's displacement")
    length_m: Length = Field(description="free length of the strand")
    tip_mass_kg: NonNegative = Field(default=0.0, description="mass at the tip")
    points: Annotated[int, Field(ge=8, le=400)] = Field(default=120, description="means over as many ranges of time")

    def read(self, folder: Path) -> Data:
        """Reads the displacement, m, over time, s."""
        path = file_beside(folder, self.data, f"experiments.{self.name}.data")
        columns, notes = read_columns(path, self.time, {self.displacement: "m"})
        at, values = binned(columns["time"] - columns["time"][0], columns[self.displacement], self.points)
        labels = ("time (s)", "displacement of the tip (m)")
        return Data(at, values, np.zeros(len(at), dtype=int), labels, "m", notes)

    def predicted(self, config: RunConfig, data: Data, found: Found) -> Array:
        """Returns the displacement that fits the points best with the strand's frequency and damping, m."""
        frequency, rate = self.mode(config)
        turn = np.sqrt(complex(frequency**2 - rate**2))
        # Real and imaginary part of one wave, or two decays where it is damped too much to ring.
        waves = [np.exp((sign * 1j * turn - rate) * data.at) for sign in (1, -1)]
        parts = [one.real for one in waves] if turn.imag else [waves[0].real, waves[0].imag]
        basis = np.stack([np.ones(len(data.at)), *parts], axis=1)
        return basis @ np.linalg.lstsq(basis, data.values, rcond=None)[0]

    def mode(self, config: RunConfig) -> tuple[float, float]:
        """Undamped angular frequency of a worm's strand, rad/s, and the rate at which its amplitude decays, 1/s."""
        strands = worm_of(config).strands
        if not strands.damping_time_s:
            raise ConfigError(
                f"experiments.{self.name}: a ring-down needs strands with a damping of the material: set "
                "body.strands.damping_time_s"
            )
        density = strands.one_number("linear_density_kg_per_m")
        root = first_root(self.tip_mass_kg / (density * self.length_m))
        frequency = root**2 * sqrt(strands.bending_rigidity_Nm2 / density) / self.length_m**2
        return frequency, frequency**2 * strands.damping_time_s / 2.0


def first_root(tip: float) -> float:
    """Wave number times length of a cantilever's first mode, 1.8751 without a mass at its tip.

    ``tip`` is the tip's mass over the strand's.
    """
    from scipy.optimize import root_scalar

    def zero(root: float) -> float:
        c, s, ch, sh = cos(root), sin(root), cosh(root), sinh(root)
        return 1.0 + c * ch + tip * root * (c * sh - s * ch)

    return float(root_scalar(zero, bracket=(1e-3, 1.9)).root)

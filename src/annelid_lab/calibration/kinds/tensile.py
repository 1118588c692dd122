"""A tensile test of the tube that the strands are made of, and the law by which its modulus falls.

The stress at a strain e is ``E0 e_s ln(1 + e / e_s)``: the tangent modulus is ``E0 / (1 + e / e_s)``. A rod of the
engine is linear, so that its modulus is the secant of this law in bending, at the strain that the strands reach. In
this way the strands' modulus and the tensile test share E0.
"""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.body import worm_of
from annelid.config import Length, Line, Positive, RunConfig
from annelid.errors import ConfigError
from annelid.protocols import Array
from annelid_lab.calibration.base import Data, Experiment, Found, binned, file_beside, read_columns


class Tensile(Experiment):
    """Force over the elongation of a piece of tube; closed form."""

    kind: Literal["tensile"] = "tensile"
    time: Line | None = Field(default="time_s", description="column of the time; none: there is none")
    elongation: Line = Field(default="elongation_mm", description="column of the elongation")
    force: Line = Field(default="force_N", description="column of the force")
    length_m: Length = Field(description="free length of the tube")
    outer_diameter_m: Length = Field(description="outer diameter of the tube")
    inner_diameter_m: Annotated[float, Field(ge=0, le=1e3)] = Field(default=0.0, description="inner diameter; 0: solid")
    largest_strain: Annotated[float, Field(gt=0, le=1)] = Field(default=0.03, description="points beyond are left out")
    points: Annotated[int, Field(ge=8, le=400)] = Field(default=40, description="means over as many ranges of strain")
    softening_strain: Positive | None = Field(
        default=None, description="strain e_s at which the tangent modulus has halved; none: linear"
    )
    working_strain: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.01, description="outer strain in bending at which the strands' linear modulus is the law's secant"
    )

    @model_validator(mode="after")
    def _is_a_tube(self) -> Self:
        if self.inner_diameter_m >= self.outer_diameter_m:
            raise ValueError(
                f"inner_diameter_m = {self.inner_diameter_m:g} must be less than outer_diameter_m = "
                f"{self.outer_diameter_m:g}"
            )
        return self

    def read(self, folder: Path) -> Data:
        """Reads force, N, over strain."""
        path = file_beside(folder, self.data, f"experiments.{self.name}.data")
        columns, notes = read_columns(path, self.time, {self.elongation: "m", self.force: "N"})
        strain = columns[self.elongation] / self.length_m
        kept = (strain > 0) & (strain <= self.largest_strain)
        if kept.sum() < 8:
            raise ConfigError(
                f"{path} has {kept.sum()} points at strains from 0 to largest_strain = {self.largest_strain:g}: "
                "at least 8 are needed"
            )
        at, force = binned(strain[kept], columns[self.force][kept], self.points)
        return Data(at, force, np.zeros(len(at), dtype=int), ("strain", "force (N)"), "N", notes)

    def predicted(self, config: RunConfig, data: Data, found: Found) -> Array:
        """Returns the force at each strain, N."""
        return self.tension(config, data.at)

    def tension(self, config: RunConfig, strain: Array) -> Array:
        """Returns the force of a worm's tube at strains, ``(n,)``, N."""
        body = worm_of(config)
        outer, inner = self.outer_diameter_m / 2, self.inner_diameter_m / 2
        # The tube bends like the strand, whatever section the strand's radius stands for.
        linear = body.strands.bending_rigidity_Nm2 / (pi / 4 * (outer**4 - inner**4))
        area = pi * (outer**2 - inner**2)
        if self.softening_strain is None:
            return linear * strain * area
        initial = linear / float(bending_secant(self.working_strain, self.softening_strain, inner / outer))
        return initial * stress(strain, self.softening_strain) * area


def stress(strain: Array, softening_strain: float) -> Array:
    """Stress of the law over its modulus at small strain; odd in the strain."""
    return np.sign(strain) * softening_strain * np.log1p(np.abs(strain) / softening_strain)


def bending_secant(outer_strain: Array | float, softening_strain: float, bore: float) -> Array:
    """Moment of a round tube over that of a linear one of the law's modulus at small strain.

    Args:
        outer_strain: Curvature times outer radius, any shape.
        softening_strain: Of the law.
        bore: Inner over outer radius.

    Returns:
        The share, of the same shape: the moment is ``E0 I`` times the curvature times this.
    """
    nodes, weights = np.polynomial.legendre.leggauss(24)
    radius = bore + (1.0 - bore) * (nodes + 1.0) / 2.0
    angle = pi / 4 * (nodes + 1.0)
    height = radius[:, None] * np.sin(angle)
    area = 4.0 * (1.0 - bore) / 2.0 * weights[:, None] * (pi / 4) * weights * radius[:, None]
    strain = np.maximum(np.asarray(outer_strain, dtype=float), 1e-12)[..., None, None]
    moment = (area * height * stress(strain * height, softening_strain)).sum(axis=(-2, -1))
    return moment / (pi / 4 * (1.0 - bore**4) * strain[..., 0, 0])

"""The planar worm of Daltorio et al. 2013: rigid-sided rhombi with torsional springs between them, in a pipe.

Each segment is a rhombus of sides ``s``: with the height ``h`` its length is ``l = sqrt(4 s^2 - h^2)`` (the paper's
``l^2 + w^2 = 4 l_s^2``). A muscle pulls the upper and the lower vertex together, a return spring along the segment
pushes them apart again, and torsional springs resist that the sides of neighbouring segments differ in their angle phi,
``sin phi = h / 2s``. There is no gravity. The vertices press against the walls of a straight pipe, so the worm stays
symmetric about the pipe's axis and each segment has one coordinate; the front tip's place ``x_0`` completes them:

    q = (x_0, h_1 .. h_N),   r_i = h_i / 2,   c_i = sqrt(s^2 - r_i^2),   l_i = 2 c_i
    d/dt dT/d(dq/dt) - dT/dq = -dU/dq - C dq/dt - F + J^T f
    T = sum over joints m_j/2 (dX/dt)^2 + sum over segments m_v [(dX/dt)^2 + (dh/dt)^2 / 4]
    U = sum k_s/2 (l_i - l_0)^2 + sum k_t/2 (phi_(i+1) - phi_i)^2 + sum k_w (h_i/2 - D/2)_+^2
    N_i = k_w (h_i/2 - D/2)_+,   |f_i| <= 2 mu N_i,   f_i = -2 mu N_i sign(dX_i/dt) where the vertices slide

Slip loss is the work that friction takes from vertices that slide.

Source: Daltorio, Boxerbaum, Horchler, Shaw, Chiel and Quinn 2013, Efficient worm-like locomotion: slip and control of
soft-bodied peristaltic robots, Bioinspir. Biomim. 8, 035003, as described by Riddle et al. 2023, section 2.1. The
constants are this package's own, as are the force-height law of the muscles, the linear walls, and the dampers beside
the muscles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from annelid.config import NonNegative, Positive
from annelid_studies.planar.dynamic import DynamicPlanarPlant
from annelid_studies.planar.linkage import Linkage
from annelid_studies.planar.sections import DynamicPlanarWorm

if TYPE_CHECKING:
    from annelid.config import RunConfig


class Daltorio2013Body(DynamicPlanarWorm):
    """The planar worm of Daltorio 2013: rigid-sided rhombi, torsional springs between them, and the walls of a pipe."""

    cites = (("daltorio2013", "the planar worm"),)
    kind: Literal["daltorio2013"] = "daltorio2013"
    torsion_stiffness_Nm_per_rad: NonNegative = Field(
        default=0.2, description="torsional springs between neighbouring segments"
    )
    torsion_damping_Nms_per_rad: NonNegative = Field(default=0.0, description="viscous resistance beside them")
    pipe_diameter_m: Positive = Field(default=0.1, description="distance of the walls from one another")
    wall_stiffness_N_per_m: Positive = Field(default=2000.0, description="force per indentation at one vertex")
    wall_friction: NonNegative = Field(default=0.5, description="coefficient of Coulomb friction with the walls")

    @model_validator(mode="after")
    def _the_worm_can_leave_the_wall(self) -> Self:
        if self.pipe_diameter_m <= self.height_shortest_m:
            raise ValueError(
                f"body.pipe_diameter_m = {self.pipe_diameter_m:g} must be greater than body.height_shortest_m = "
                f"{self.height_shortest_m:g}"
            )
        return self

    @property
    def wall_distance_m(self) -> float:
        """As `pipe_diameter_m`."""
        return self.pipe_diameter_m

    def build(self, config: RunConfig) -> Daltorio2013Plant:
        """Builds the worm, as `BodyKind.build`."""
        return Daltorio2013Plant(self, config.clock)


def daltorio_linkage(body: Daltorio2013Body) -> Linkage:
    """Returns the mechanics of the worm: one link a segment, which stands for its four equal sides."""
    n = body.n_segments
    # Lumps: joints 0 .. N on the axis, then the vertices. A joint lies behind two sides of each segment before it.
    before = np.tril(np.ones((n + 1, n)), -1)
    lump_runs = np.concatenate([2.0 * before, 2.0 * before[:-1] + np.eye(n)])
    lump_heights = np.concatenate([np.zeros((n + 1, n)), 0.5 * np.eye(n)])
    vertices = np.arange(n + 1, 2 * n + 1)
    return Linkage(
        body=body,
        rises=0.5 * np.eye(n),
        link_length_m=np.full(n, body.side_m),
        lump_runs=lump_runs,
        lump_heights=lump_heights,
        lump_mass_kg=np.repeat([body.joint_mass_kg, 2.0 * body.vertex_mass_kg], [n + 1, n]),
        vertices=vertices,
        outline=np.append(np.stack([np.arange(n), vertices], axis=1).ravel(), n),
        segment_runs=2.0 * np.eye(n),
        straight=np.append(0.0, np.ones(n)),
        hinges=np.diff(np.eye(n), axis=0),
        torsion_stiffness_Nm_per_rad=body.torsion_stiffness_Nm_per_rad,
        torsion_damping_Nms_per_rad=body.torsion_damping_Nms_per_rad,
        wall_radius_m=body.pipe_diameter_m / 2.0,
        wall_stiffness_N_per_m=body.wall_stiffness_N_per_m,
        friction=body.wall_friction,
    )


class Daltorio2013Plant(DynamicPlanarPlant):
    """The worm of Daltorio et al. 2013 as a plant; the module states its equations."""

    description = "planar worm of Daltorio et al. 2013 in a pipe"
    linkage = staticmethod(daltorio_linkage)

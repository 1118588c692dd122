"""The planar worm of Boxerbaum et al. 2012: rhombi whose sides bend in their middle, touching no ground.

Each side of a segment is two rigid halves of ``s / 2`` with a torsional spring between them. The sides of neighbouring
segments are one strand that crosses the axis straight, as in a braided mesh, since on hinges a side would stay straight
and its spring never act. Hence the inner halves on both sides of joint ``j`` have one slope, and with the joints' rises
``a_j`` as coordinates

    q = (x_0, h_1 .. h_N, a_0 .. a_N)
    r = (a_(i-1), h_i/2 - a_(i-1), h_i/2 - a_i, a_i)   of the four halves of segment i, front to rear
    c = sqrt(s^2/4 - r^2),   sin phi = 2 r / s,   l_i = c_1 + c_2 + c_3 + c_4
    d/dt dT/d(dq/dt) - dT/dq = -dU/dq - C dq/dt - F
    T = sum over joints m_j/2 (dX/dt)^2 + sum over vertices and middles of sides m/2 [(dX/dt)^2 + (dy/dt)^2]
    U = sum k_s/2 (l_i - l_0)^2 + sum over all sides k_t/2 (phi_outer - phi_inner)^2

Muscles pull the upper and the lower vertex of a segment together, return springs along the segments push them apart;
there is neither gravity nor ground, so the centre of mass stays where it is.

Source: Boxerbaum, Shaw, Chiel and Quinn 2012, Continuous wave peristaltic motion in a robot, Int. J. Robot. Res. 31,
302-318, as described by Riddle et al. 2023, section 2.1. The constants are this package's own, as are the force-height
law of the muscles and the dampers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from annelid.config import NonNegative, Positive
from annelid_studies.planar.dynamic import DynamicPlanarPlant
from annelid_studies.planar.linkage import Linkage
from annelid_studies.planar.sections import DynamicPlanarWorm

if TYPE_CHECKING:
    from annelid.config import RunConfig


class Boxerbaum2012Body(DynamicPlanarWorm):
    """The planar worm of Boxerbaum 2012: rhombi whose sides bend in their middle, without ground."""

    cites = (("boxerbaum2012", "the planar worm"),)
    kind: Literal["boxerbaum2012"] = "boxerbaum2012"
    middle_mass_kg: Positive = Field(default=0.02, description="mass of the middle of a side")
    torsion_stiffness_Nm_per_rad: Positive = Field(default=0.2, description="torsional spring in the middle of a side")
    torsion_damping_Nms_per_rad: NonNegative = Field(default=0.01, description="viscous resistance beside it")

    def build(self, config: RunConfig) -> Boxerbaum2012Plant:
        """Builds the worm, as `BodyKind.build`."""
        return Boxerbaum2012Plant(self, config.clock)


def boxerbaum_linkage(body: Boxerbaum2012Body) -> Linkage:
    """Returns the mechanics of the worm: four links a segment, the halves of its upper sides from front to rear."""
    n = body.n_segments
    n_links, n_coordinates = 4 * n, 2 * n + 1
    rises = np.zeros((n, 4, n_coordinates))
    segment = np.arange(n)
    front, rear = n + segment, n + 1 + segment
    rises[segment, 0, front] = rises[segment, 3, rear] = 1.0
    rises[segment, 1, segment] = rises[segment, 2, segment] = 0.5
    rises[segment, 1, front] = rises[segment, 2, rear] = -1.0
    rises = rises.reshape(n_links, n_coordinates)
    # Lumps in order along the upper half: a joint, a side's middle, a vertex, a middle; and the last joint.
    lump_runs = np.tril(np.ones((n_links + 1, n_links)), -1)
    places = np.arange(n_links + 1) % 4
    lump_heights = np.zeros((n_links + 1, n_coordinates))
    lump_heights[2::4] = rises[0::4] + rises[1::4]
    lump_heights[1::4], lump_heights[3::4] = rises[0::4], rises[3::4]
    middle, vertex = 2.0 * body.middle_mass_kg, 2.0 * body.vertex_mass_kg
    mass = np.array([body.joint_mass_kg, middle, vertex, middle])
    bend = np.kron(np.eye(n), np.array([[-1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]]))
    return Linkage(
        body=body,
        rises=rises,
        link_length_m=np.full(n_links, body.side_m / 2.0),
        lump_runs=lump_runs,
        lump_heights=lump_heights,
        lump_mass_kg=mass[places],
        vertices=np.arange(2, n_links, 4),
        outline=np.arange(n_links + 1),
        segment_runs=np.repeat(np.eye(n), 4, axis=1),
        straight=np.repeat([0.0, 1.0, 0.25], [1, n, n + 1]),
        # Each row stands for the upper and the lower side, hence the root of two.
        hinges=np.sqrt(2.0) * bend,
        torsion_stiffness_Nm_per_rad=body.torsion_stiffness_Nm_per_rad,
        torsion_damping_Nms_per_rad=body.torsion_damping_Nms_per_rad,
    )


class Boxerbaum2012Plant(DynamicPlanarPlant):
    """The worm of Boxerbaum et al. 2012 as a plant; the module states its equations."""

    description = "planar worm of Boxerbaum et al. 2012"
    linkage = staticmethod(boxerbaum_linkage)

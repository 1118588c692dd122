"""The planar worm of Daltorio et al. 2013: rigid-sided rhombi with torsional springs between them, in a pipe.

Each segment is a rhombus of sides ``s``: with the height ``h`` its length is ``l = sqrt(4 s^2 - h^2)`` (the paper's
``l^2 + w^2 = 4 l_s^2``). A muscle pulls the upper and the lower vertex together, a return spring along the segment
pushes them apart again, and torsional springs resist that the sides of neighbouring segments differ in their angle,
``k_t/2 sum (phi_(i+1) - phi_i)^2`` with ``sin phi = h / 2s``. There is no gravity. The vertices press against the
walls of a straight pipe, the same all round, so the worm stays symmetric about the pipe's axis and each segment has
one coordinate; the front tip's place ``x_0`` completes them:

    q = (x_0, h_1 .. h_N),   r_i = h_i / 2,   c_i = sqrt(s^2 - r_i^2),   l_i = 2 c_i
    d/dt dT/d(dq/dt) - dT/dq = -dU/dq - C dq/dt - F + J^T f
    T = sum over joints m_j/2 (dX/dt)^2 + sum over segments m_v [(dX/dt)^2 + (dh/dt)^2 / 4]
    U = sum k_s/2 (l_i - l_0)^2 + sum k_t/2 (phi_(i+1) - phi_i)^2 + sum k_w (h_i/2 - D/2)_+^2
    N_i = k_w (h_i/2 - D/2)_+,   |f_i| <= 2 mu N_i,   f_i = -2 mu N_i sign(dX_i/dt) where the vertices slide

in m, kg, s, N, rad and J. `annelid.planar.linkage` states forces and mass matrix in general, and
`annelid.planar.midpoint` the stepper. Slip loss is the work that friction takes from vertices that slide.

Source: Daltorio, Boxerbaum, Horchler, Shaw, Chiel and Quinn 2013, Efficient worm-like locomotion: slip and control of
soft-bodied peristaltic robots, Bioinspir. Biomim. 8, 035003, as described by Riddle et al. 2023, section 2.1. The
constants are this package's own (`annelid.config.Daltorio2013Body`), as are the force-height law of the muscles, the
linear walls, and the dampers beside the muscles.
"""

from __future__ import annotations

import numpy as np

from annelid.config import Clock, Daltorio2013Body
from annelid.planar.dynamic import DynamicPlanarPlant
from annelid.planar.linkage import Linkage


class Daltorio2013Plant(DynamicPlanarPlant):
    """The worm of Daltorio et al. 2013 as a plant; the module states its equations."""

    def __init__(self, body: Daltorio2013Body, clock: Clock) -> None:
        """Lays the worm down at rest in its pipe.

        Args:
            body: Section of the body and its pipe.
            clock: Section of the time steps.
        """
        super().__init__(daltorio_linkage(body), clock, "planar worm of Daltorio et al. 2013 in a pipe")


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

"""Rods and chains clamped at one end."""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.body.constraint_rows import tendons_to_rows
from annelid.body.formulations.rods import Rods
from annelid.body.formulations.rods.net import add_rod, add_vertex, lumped_masses
from annelid.body.formulations.rods.strains import RodStrains, vertex_stiffness
from annelid.body.formulations.rods.two_step import TwoStep
from annelid.body.mesh import Strands
from annelid.morphology import Array

CLAMP_KG = 1e6
"""Also the inertia of the clamped edge's hinge, kg m^2: rows know no fixed vertices."""


class RodCantilever:
    """A rod as of a moving worm, weightless, whose first edge is held by mass.

    Attributes:
        model: The compiled rod, with bodies ``v0``, ``v1`` .. at its vertices.
        data: The engine's data of it.
        strains: Bending and twist.
        two_step: What steps it.
    """

    def __init__(self, vertices_m: Array, strands: Strands, timestep_s: float, shares: Array | None = None) -> None:
        """Builds a rod through vertices, ``(n, 3)``, with shares of the stiffness at the inner ones, ``(2, n - 2)``."""
        spec = mujoco.MjSpec()
        spec.option.gravity = [0, 0, 0]
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
        spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
        spec.option.timestep, spec.option.tolerance = timestep_s, 1e-20
        masses = lumped_masses(vertices_m, strands.one_number("linear_density_kg_per_m"))
        masses[:2] = CLAMP_KG
        bodies = [f"v{index}" for index in range(len(vertices_m))]
        for body, place, mass in zip(bodies, vertices_m, masses, strict=True):
            add_vertex(spec, body, place, mass)
        lengths = np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
        stiffness = vertex_stiffness(lengths, strands, np.ones((2, len(lengths) - 1)) if shares is None else shares)
        add_rod(spec, "strand_0", vertices_m, bodies, strands, Rods().edge_time_constant_s, stiffness_Nm=stiffness)
        spec.joint("strand_0_twist_0").armature = CLAMP_KG
        tendons_to_rows(spec)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.strains = RodStrains(self.model, stiffness[:, np.newaxis], strands.damping_time_s)
        self.two_step = TwoStep(self.model, self.data, self.strains, first_order=False)

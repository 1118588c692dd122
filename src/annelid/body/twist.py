"""What the engine's implicit step lacks of rods: how bending and twist act on one another.

In a rod that is bent, moving its vertices twists it, and turning its edges about themselves bends it sideways. The
engine has these forces as they are at the start of its step: its matrix has bending and twist side by side. Where steps
start from an extrapolated state, that takes their second order and, with much damping, their stability.

So twist follows the vertices after the step. Edges have next to no inertia about themselves: what their hinges lack is
solved for at once, rod by rod. The vertices keep the twist of the start. Either alone gives steps of second order
(`tests/body/test_ring_down.py`), both together do not.

Notation as in `annelid.body.damping`: b across the bend of a vertex, times 1 / cos(h)^2; ``p0 = b . e0' / l0`` and ``p1
= b . e1' / l1``; the two edges turn by the rates w0 and w1. With the rest lengths l, l', a rod stores, of twist and of
lateral curvature in the material frames of both edges (`annelid.simulation.energies`),

    G J / (l + l') twist^2  +  E I / (2 (l + l')) (lateral0^2 + lateral1^2)

    twist' = w1 - w0 + sin(2h) (p0 + p1) / 2
    lateral0' = p1 - cos(2h) p0 - k w0        lateral1' = cos(2h) p1 - p0 - k w1

where k is the curvature at rest. The engine damps twist; rows damp lateral curvature, and they lack nothing.
"""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.body.damping import Bends, RodVertices, bends, damped_edge, rod_stiffness, twist_joints
from annelid.body.worm import Strands
from annelid.morphology import Array


class TwistCoupling:
    """The force of vertices on twist at the end of a step, for the rods of one worm."""

    def __init__(self, model: mujoco.MjModel, strands: Strands) -> None:
        """Takes a compiled net of rods with as many edges each, whose material is damped."""
        joints, self._step_s = twist_joints(model), float(model.opt.timestep)
        n_strands, n_edges = joints.shape
        self._hinge_qpos, self._hinge = model.jnt_qposadr[joints].ravel(), model.jnt_dofadr[joints].ravel()
        lateral, torsion = rod_stiffness(model, strands)
        vertices = RodVertices(model)
        _, sine, cosine, _ = bends(vertices.at(model.qpos0))
        curvature, damping_s = 2.0 * sine / (1.0 + cosine), strands.material_damping_s
        assert damping_s
        self._dof = vertices.dof
        self._viscous, self._all_torsion = damping_s * (2.0 * torsion), (damping_s + self._step_s) * (2.0 * torsion)
        self._lateral = self._step_s * lateral * curvature
        # What holds the hinges during a step, at rest: inertia, torsion, lateral bending and the lateral dampers.
        held = model.dof_M0[self._hinge].reshape(n_strands, n_edges) / self._step_s
        across = lateral * curvature**2
        held[:, :-1] += self._all_torsion + self._step_s * across
        held[:, 1:] += self._all_torsion + self._step_s * across
        for vertex in range(1, n_edges):
            held[:, damped_edge(vertex)] += 2.0 * damping_s * across[:, vertex - 1]
        edge = np.arange(n_edges)
        matrix = np.zeros((n_strands, n_edges, n_edges))
        matrix[:, edge, edge] = held
        matrix[:, edge[:-1], edge[1:]] = matrix[:, edge[1:], edge[:-1]] = -self._all_torsion
        self._inverse = np.linalg.inv(matrix)

    def follow(self, qpos: Array, qvel: Array, before: Array, bent: Bends) -> None:
        """Lets twist follow the vertices after the engine's step.

        Args:
            qpos: Generalised positions at its end, ``(nq,)``; those of the hinges change.
            qvel: Velocities at its end, ``(nv,)``, likewise.
            before: Velocities at its start, ``(nv,)``.
            bent: How the rods are bent at its start.
        """
        b, sine, cosine, per_length = bent
        along = b * per_length[:, :-1], b * per_length[:, 1:]
        (p0, p1), (q0, q1) = (self._sideways(velocity, along) for velocity in (qvel, before))
        torque = 0.5 * sine * (self._all_torsion * (p0 + p1) - self._viscous * (q0 + q1))
        on_edges = np.zeros(per_length.shape)
        on_edges[:, :-1] += torque + self._lateral * (p1 - cosine * p0)
        on_edges[:, 1:] += self._lateral * (cosine * p1 - p0) - torque
        change = (self._inverse @ on_edges[..., None]).ravel()
        qvel[self._hinge] += change
        qpos[self._hinge_qpos] += self._step_s * change

    def _sideways(self, qvel: Array, along: tuple[Array, Array]) -> tuple[Array, Array]:
        """Rates p0 and p1 at velocities."""
        edge = np.diff(qvel[self._dof], axis=-1)
        return (along[0] * edge[..., :-1]).sum(axis=0), (along[1] * edge[..., 1:]).sum(axis=0)

"""The dampers of `annelid.body.damping` in a moving worm: their coefficients follow the posture, step by step.

As dampers of tendons they would cost twice the time of a step. Here they are constraint rows, which the engine solves
at the end of the step too. The engine scales a row's damping by A, the ratio of the row's inverse inertia without the
forces of the step to that with them: a row's force is ``-A (I a + c v)``, with the wanted damping c and a small
inertance I. A depends on step, posture and the world's axes, and would be 1 to 80. So every row also takes hold of one
dof that is held fast and so light that it alone decides about A, which then is 1.
"""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.body.damping import HELD, damper_coefficients, damper_name, damper_rows, is_damper
from annelid.body.worm import Strands
from annelid.morphology import Array

INERTANCE = 1e-3
"""Of a row, as a share of its damping times the step: nothing that could be seen."""
IMPEDANCE = 0.01
HELD_LEVER = 1e3
"""Coefficient of the held dof in every row: its share of a row's inverse inertia is 1e15, of the others 1e9 at most."""
HELD_INVERSE_KG = 1e-16
"""The engine holds a dof by a force in proportion to the inertia that it believes it to have."""
_PER_ROW = 10


def add_damper_rows(spec: mujoco.MjSpec) -> None:
    """Replaces the dampers of the rods' tendons by constraint rows, whose damping `MaterialDamping` completes."""
    tendons = [tendon for tendon in spec.tendons if is_damper(tendon)]
    if not tendons:
        return
    spec.add_equality(
        name=HELD, type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1=HELD, data=[0.0] * 12
    )
    for tendon in tendons:
        tendon.damping = [0.0, 0.0, 0.0]
        tendon.wrap_joint(HELD, HELD_LEVER)
        spec.add_equality(
            name=tendon.name,
            type=mujoco.mjtEq.mjEQ_TENDON,
            objtype=mujoco.mjtObj.mjOBJ_TENDON,
            name1=tendon.name,
            data=[0.0] * 12,
            # The engine wants a stiffness. Damping over inertance, times the impedance as the engine has it.
            solref=[-1e-12, -IMPEDANCE / (INERTANCE * spec.option.timestep)],
            solimp=[IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
        )


class MaterialDamping:
    """Renews the rows of one worm for its posture before every step.

    They live in the compiled model, which no other worm may use. The posture alone decides, so a run continues and a
    batch computes to the same bits.
    """

    def __init__(self, model: mujoco.MjModel, strands: Strands) -> None:
        """Finds the rows and gives them their damping.

        Args:
            model: A worm compiled with `add_damper_rows`.
            strands: Its material, with a damping time.
        """
        assert strands.material_damping_s is not None
        n_strands, n_edges = model.nflex, int(model.flex_edgenum[0])
        inner = range(1, n_edges)
        names = [f"strand_{strand}" for strand in range(n_strands)]
        lengths = model.flexedge_length0.reshape(n_strands, n_edges)
        self._damping = damper_coefficients(lengths, strands, strands.material_damping_s)
        tendons = np.array([[model.tendon(damper_name(name, vertex)).id for vertex in inner] for name in names])
        model.tendon_invweight0[tendons] = (
            IMPEDANCE / (1.0 - IMPEDANCE) / (INERTANCE * self._damping * model.opt.timestep)
        )
        model.dof_invweight0[model.joint(HELD).dofadr] = HELD_INVERSE_KG
        # The dampers' coefficients lie one after another, each damper's with that of the held dof at its end.
        first, last = int(model.tendon_adr[tendons[0, 0]]), int(model.tendon_adr[tendons[-1, -1]]) + _PER_ROW + 1
        shape = (*tendons.shape, _PER_ROW + 1)
        assert np.array_equal(model.tendon_adr[tendons].ravel(), np.arange(first, last, _PER_ROW + 1))
        self._row = model.wrap_prm[first:last].reshape(shape)[..., :_PER_ROW]
        self._dof = model.jnt_dofadr[model.wrap_objid[first:last]].reshape(shape)[..., :_PER_ROW]
        bodies = model.flex_vertbodyid.reshape(n_strands, n_edges + 1)
        # A vertex sits on three slides along the world's axes.
        self._slide = model.jnt_qposadr[model.body_jntadr[bodies]] + np.arange(3)[:, None, None]
        self._place = model.body_pos[bodies].transpose(2, 0, 1).copy()

    def renew(self, qpos: Array) -> None:
        """Sets the rows for a posture, ``(nq,)``."""
        self._row[:] = damper_rows(self._place + qpos[self._slide]).transpose(1, 2, 0)

    def loss_W(self, qvel: Array) -> float:
        """Power that the rows take at velocities, ``(nv,)``, W."""
        rate = (self._row * qvel[self._dof]).sum(axis=-1)
        return float((self._damping * rate * rate).sum())

"""The step of rods: backward differentiation over two steps (BDF2), as one Newton step of the engine.

With a step h, positions q and velocities v, and what the forces make of them, a, the formula is

    (3 v' - 4 v + v_before) / 2 h = a(q', v')        (3 q' - 4 q + q_before) / 2 h = v'

The engine's step of length 2 h / 3 from the state ``(4 q - q_before) / 3``, ``(4 v - v_before) / 3`` is this formula
with forces and constraints that are linear in what is solved for. It takes them along the directions of its starting
state, which differ from those at the end in proportion to the step: edges turn, rings shorten, rods bend. So here all
geometry is that of the end as predicted from the velocity, which is right to second order, and each length is brought
back along it to the starting state.

Like the engine's own step, BDF2 damps without limit what is too fast for the step, but of a slow oscillation it takes
in proportion to the third power of the step, where the engine takes in proportion to the step (Hairer and Wanner 1996,
"Solving Ordinary Differential Equations II", chapter V.1).
"""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from annelid.body.formulations.rods.strains import RodStrains
from annelid.morphology import Array
from annelid.protocols import State


class TwoStep:
    """Steps one worm of rods, and remembers where it was one step ago.

    In a scene whose bodies move the engine's own step of first order is taken instead, with rows for the rods: what the
    engine steps explicitly, such as a pendulum's weight, would gain energy by BDF2, and contacts would rebound.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, strains: RodStrains, *, first_order: bool) -> None:
        """Takes a compiled worm at rest."""
        self._model, self._data, self._strains, self._first_order = model, data, strains, first_order
        spatial = np.flatnonzero(model.wrap_type[model.tendon_adr] == int(mujoco.mjtWrap.mjWRAP_SITE))
        tendon = np.repeat(np.arange(model.ntendon), model.ten_J_rownnz)
        self._entry = np.flatnonzero(np.isin(tendon, spatial))
        self._entry_tendon, self._entry_dof = tendon[self._entry], model.ten_J_colind[self._entry].astype(np.intp)
        self._pulls = model.actuator_trnid[:, 0].astype(np.intp)
        self._rows: np.ndarray | None = None
        self.rest()

    def rest(self) -> None:
        """Takes the present state for that of one step ago."""
        self._qpos_before, self._qvel_before = self._data.qpos.copy(), self._data.qvel.copy()

    def step(self, prepare: Callable[[], None]) -> None:
        """Takes one step of the engine; ``prepare`` is called with the data at the predicted end."""
        model, data, h = self._model, self._data, self._model.opt.timestep
        qpos, qvel = data.qpos.copy(), data.qvel.copy()
        start, velocity = qpos, qvel
        if not self._first_order:
            # Slides and hinges only: a worm of rods has no other joints.
            start = qpos + (qpos - self._qpos_before) / 3.0
            velocity = qvel + (qvel - self._qvel_before) / 3.0
            # The mean of two velocities: what alternates from step to step would grow if it were carried on.
            data.qpos[:] = start + 0.5 * h * (qvel + self._qvel_before)
        self._qpos_before, self._qvel_before = qpos, qvel
        prepare()
        strain = self._strains.renew(data.qpos)
        mujoco.mj_checkPos(model, data)
        mujoco.mj_checkVel(model, data)
        mujoco.mj_fwdPosition(model, data)
        if self._rows is None:
            self._rows = self._strains.rows_of(data)
        data.efc_pos[self._rows] = strain.ravel()
        if not self._first_order:
            self._bring_back(data.qpos - start)
            data.qpos[:], data.qvel[:] = start, velocity
        mujoco.mj_sensorPos(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_sensorVel(model, data)
        mujoco.mj_step2(model, data)
        self._strains.follow(data.qpos)

    def _bring_back(self, moved: Array) -> None:
        """Brings all lengths of constraints and tendons back by a movement of the coordinates, ``(nv,)``."""
        model, data = self._model, self._data
        change = np.zeros(data.nefc)
        mujoco.mj_mulJacVec(model, data, change, moved)
        data.efc_pos[:] -= change
        products = data.ten_J[self._entry] * moved[self._entry_dof]
        lengths = np.bincount(self._entry_tendon, products, minlength=model.ntendon)
        data.ten_length[:] -= lengths
        data.actuator_length[:] -= lengths[self._pulls]

    def rows(self) -> tuple[Array, Array]:
        """Returns forces of the rods' rows in the last step, and the rows' rates at the present velocity."""
        assert self._rows is not None
        rate = np.zeros(self._data.nefc)
        mujoco.mj_mulJacVec(self._model, self._data, rate, self._data.qvel)
        return self._data.efc_force[self._rows], rate[self._rows]

    def get_state(self) -> State:
        """Returns what the next step depends on beside the engine's own state."""
        return {
            "qpos_before": self._qpos_before.copy(),
            "qvel_before": self._qvel_before.copy(),
            "director": self._strains.director.copy(),
        }

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned, with the engine in its state already."""
        self._qpos_before = np.array(state["qpos_before"], dtype=float)
        self._qvel_before = np.array(state["qvel_before"], dtype=float)
        self._strains.restore(self._data.qpos, np.asarray(state["director"], dtype=float))

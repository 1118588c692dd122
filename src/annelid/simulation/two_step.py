"""The second-order step of rods: backward differentiation over two steps (BDF2), by the engine's step of first order.

With a step h, positions q and velocities v, and what the forces make of them, a, the formula is

    (3 v' - 4 v + v_before) / 2 h = a(q', v')        (3 q' - 4 q + q_before) / 2 h = v'

For what the engine takes at the end of its step, this is its step of length 2 h / 3 from the state ``(4 q - q_before) /
3``, ``(4 v - v_before) / 3``. Like the engine's own it damps without limit what is too fast for the step, but of a slow
oscillation it takes in proportion to the third power of the step, where the engine takes in proportion to the step
(Hairer and Wanner 1996, "Solving Ordinary Differential Equations II", chapter V.1).

What the engine steps explicitly gains energy instead, in proportion to the step: in a worm the damping of its material
outweighs that, and scenes whose bodies move are stepped otherwise. A command that switches acts half a step late.
"""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.body.damping import MaterialDamping
from annelid.body.formulations import BDF2_SHARE
from annelid.body.twist import TwistCoupling
from annelid.body.worm import Strands
from annelid.morphology import Array
from annelid.protocols import State


class TwoStep:
    """What one worm was one step ago, and how its next step starts.

    It reads and writes the worm's arrays: generalised positions, ``(nq,)``, velocities, ``(nv,)``, and the states of
    its actuators, ``(na,)``.
    """

    def __init__(
        self, model: mujoco.MjModel, qpos: Array, qvel: Array, act: Array, strands: Strands, damping: MaterialDamping
    ) -> None:
        """Takes a worm that has rested before now, and its dampers, which are renewed before the engine's step."""
        self._damping = damping
        self._twist = TwistCoupling(model, strands)
        self._qpos, self._qvel, self._act = qpos, qvel, act
        limited = model.actuator_actlimited.astype(bool)[model.actuator_actnum > 0]
        low, high = model.actuator_actrange[model.actuator_actnum > 0].T
        self._act_range = np.where(limited, low, -np.inf), np.where(limited, high, np.inf)
        self.rest()

    def rest(self) -> None:
        """Takes the present state for that of one step ago."""
        self._qpos_before, self._qvel_before = self._qpos.copy(), self._qvel.copy()

    def begin(self) -> None:
        """Moves the state to where the engine's step starts."""
        qpos, qvel = self._qpos.copy(), self._qvel.copy()
        self._act_before = self._act.copy()
        # Slides and hinges only: a worm of rods has no other joints.
        self._qpos += (1.0 / 3.0) * (qpos - self._qpos_before)
        self._qvel += (qvel - self._qvel_before) / 3.0
        self._start = self._qvel.copy()
        self._qpos_before, self._qvel_before = qpos, qvel

    def end(self) -> None:
        """Completes the engine's step: twist, and the actuators' states, which are to change for the whole step."""
        self._twist.follow(self._qpos, self._qvel, self._start, self._damping.bent)
        if self._act.size:
            whole = self._act_before + (self._act - self._act_before) / BDF2_SHARE
            self._act[:] = whole.clip(*self._act_range)

    def get_state(self) -> State:
        """Returns what the next step depends on beside the engine's own state."""
        return {"qpos_before": self._qpos_before.copy(), "qvel_before": self._qvel_before.copy()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._qpos_before = np.array(state["qpos_before"], dtype=float)
        self._qvel_before = np.array(state["qvel_before"], dtype=float)

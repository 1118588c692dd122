"""Where a worm starts: the model lies along x, and its state at the start is that of the turned worm.

So all that belongs to the body (which segment and side a part of the skin is on, the grain of setae, rest lengths) is
the same whichever way it leads, and worms that lead different ways may share one compiled model.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from annelid.morphology import Array
from annelid.simulation.elasticity import plastic_at_rest, turned_frames


class Placed(NamedTuple):
    """A posture in the engine's coordinates.

    Attributes:
        qpos: Generalised positions, ``(nq,)``.
        plastic: What the engine keeps of the rods' frames, ``(nplastic,)``.
    """

    qpos: Array
    plastic: Array


def at_rest(model: mujoco.MjModel) -> Placed:
    """Returns a worm at rest that leads towards -x."""
    return Placed(model.qpos0.copy(), plastic_at_rest(model))


def turned(model: mujoco.MjModel, placed: Placed, turn: Array) -> Placed:
    """Turns a worm as a whole about the model's origin, which lies below its front end at rest.

    Args:
        model: The compiled worm.
        placed: Its posture before.
        turn: Rotation matrix, ``(3, 3)``.
    """
    qpos = placed.qpos.copy()
    # Points on three slides along the world's axes.
    slides = model.jnt_type[model.body_jntadr] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    points = np.flatnonzero(slides & (model.body_jntnum == 3))
    address = model.jnt_qposadr[model.body_jntadr[points]][:, np.newaxis] + np.arange(3)
    origin = model.body_pos[points]
    qpos[address] = (origin + qpos[address]) @ turn.T - origin
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(turn).ravel())
    for free in model.jnt_qposadr[model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE)]:
        qpos[free : free + 3] = turn @ qpos[free : free + 3]
        mujoco.mju_mulQuat(qpos[free + 3 : free + 7], quaternion, qpos[free + 3 : free + 7].copy())
    return Placed(qpos, turned_frames(model, placed.plastic, turn))

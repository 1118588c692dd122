"""The ground under a moving worm: tangent planes laid under its skin, and friction that feels which way it slides."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.arena.surface import ground_of
from annelid.config import Arena
from annelid.morphology import Array, MeshGeometry

HELD_WITHIN_M = 1e-3
"""Skin that touched keeps its contact as far as this from the ground: it may leave, but not come back at once.
Otherwise a light vertex on which the body leans is free for a whole step once it has lifted by a micrometre, and is
thrown into the ground: by 5 mm in a step of 5 ms."""
BARELY_M = 1e-5
"""Depth in its plane of skin that is felt before it touches."""


class MovingGround:
    """Lays the planes of `annelid.arena.contact.add_moving_planes` before every step.

    The engine acts on where the skin is before a step, and would stop it a step too late. What approaches the ground
    therefore finds its plane nearer, by so much that it ends the step on the ground. Planes and friction follow from
    the engine's state alone, so a run continues and a batch computes to the same bits.
    """

    def __init__(self, model: mujoco.MjModel, geometry: MeshGeometry, arena: Arena) -> None:
        """Finds the planes.

        Args:
            model: The compiled worm; of one with setae nobody else may use it, since friction is set in it.
            geometry: The mesh at rest.
            arena: The ground.
        """
        self._model = model
        self._surface = ground_of(arena)
        self._skin, self._planes = _skin_and_planes(model)
        self._radius_m = model.geom_size[self._skin, 0]
        self._plane_geoms = np.where(model.pair_geom1 == self._skin, model.pair_geom2, model.pair_geom1)
        self._rows = rows_of(model)
        self._bodies = model.geom_bodyid[self._skin]
        self._roots = model.body_rootid[self._bodies]
        self._setae = _Setae(model, geometry, arena, self._skin) if arena.has_setae else None

    def lay(self, data: mujoco.MjData) -> None:
        """Lays every plane where the ground is nearest to its part of the skin, and sets friction.

        Args:
            data: Positions, velocities and the planes as laid before the last step; its kinematics are brought up to
                date.
        """
        model, step = self._model, self._model.opt.timestep
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
            stage(model, data)
        places = data.geom_xpos[self._skin]
        spin, drift = data.cvel[self._bodies, :3], data.cvel[self._bodies, 3:]
        with np.errstate(invalid="ignore", over="ignore"):
            velocity = drift + np.cross(spin, places - data.subtree_com[self._roots])
            distance, normal = self._surface.nearest(places, first_order=True)
            approach = np.maximum(-(velocity * normal).sum(axis=-1), 0.0) * step
            touched = self._depth_in_planes_m(data, places - step * velocity) > 0.0
            depth = depth_m(distance - self._radius_m, approach, touched, self._rows)
            data.mocap_pos[self._planes] = places - (self._radius_m - depth)[:, np.newaxis] * normal
            data.mocap_quat[self._planes] = facing(normal)
            if self._setae is not None:
                model.pair_friction[:, :2] = self._setae.friction(data, velocity)[:, np.newaxis]

    def _depth_in_planes_m(self, data: mujoco.MjData, places: Array) -> Array:
        """Tells how deep in its present plane each part of the skin lies that is at a place, m; ``(n_skin,)``."""
        normal = data.geom_xmat[self._plane_geoms, 2::3]
        return self._radius_m - ((places - data.geom_xpos[self._plane_geoms]) * normal).sum(axis=-1)


class Rows(NamedTuple):
    """How contacts act in a step of h: at a depth d they turn a velocity v, outwards, into (a v + k d / h) / q.

    Attributes:
        kept: a, ``(n,)``.
        stiffness: k, h squared times stiffness over mass, ``(n,)``.
        divisor: q, ``(n,)``.
    """

    kept: Array
    stiffness: Array
    divisor: Array


def rows_of(model: mujoco.MjModel) -> Rows:
    """Returns how the contacts of a model's pairs act, all critically damped.

    The integrator `discrete` takes spring and damper at the end of the step, and has one row for all that would be
    faster than the step. The others take them at its beginning, and none as faster than two steps.
    """
    step, stiffest = model.opt.timestep, model.pair_solimp[:, 1]
    implicit = model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_DISCRETE)
    share = step / (stiffest * np.maximum(model.pair_solref[:, 0], 0.0 if implicit else 2.0 * step))
    one = np.ones_like(share)
    if not implicit:
        return Rows(one - 2.0 * share, share * share, one)
    resolved = share >= 1.0
    return Rows(one, np.where(resolved, 1.0, share * share), np.where(resolved, 2.0, (1.0 + share) ** 2))


def depth_m(gap_m: Array, approach_m: Array, touched: NDArray[np.bool_], rows: Rows) -> Array:
    """Tells how deep skin has to lie in its plane before a step to end it on the ground, if nothing else acts on it.

    Args:
        gap_m: Distance of the skin from the ground, negative within it, m, ``(n,)``.
        approach_m: What the skin would come nearer in the step, m, at least 0, ``(n,)``.
        touched: Whether it lay in its plane before the last step, ``(n,)``.
        rows: How contacts act.

    Returns:
        Depths, m, ``(n,)``: negative for skin that is not felt, and never less than how far it is in the ground.
    """
    above = np.maximum(gap_m, 0.0)
    landing = (rows.kept * approach_m - rows.divisor * above) / rows.stiffness
    felt = np.where(above < np.maximum(approach_m, HELD_WITHIN_M * touched), BARELY_M, -np.inf)
    return np.maximum(-gap_m, np.maximum(landing, felt))


def _skin_and_planes(model: mujoco.MjModel) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Returns the geom of the skin and the mocap body of the plane of every pair, which the engine may have swapped."""
    geoms = np.stack([model.pair_geom1, model.pair_geom2])
    mocap = model.body_mocapid[model.geom_bodyid[geoms]]
    plane, pair = (mocap[1] >= 0).astype(int), np.arange(model.npair)
    return geoms[1 - plane, pair], mocap[plane, pair]


def facing(normal: Array) -> Array:
    """Returns quaternions that turn the z axis to unit normals by the shortest way.

    Args:
        normal: Unit vectors, ``(n, 3)``.

    Returns:
        Unit quaternions, scalar first, ``(n, 4)``.
    """
    x, y, z = normal.T
    turn = np.stack([1.0 + z, -y, x, np.zeros(len(z))], axis=-1)
    # Straight down any half turn about a level axis will do.
    turn[z < -1.0 + 1e-12] = [0.0, 1.0, 0.0, 0.0]
    return turn / np.sqrt((turn * turn).sum(axis=-1))[:, np.newaxis]


class _Setae:
    """Friction of each part of the skin by the sign of its velocity along the worm's axis there.

    A part that sticks creeps the way it is pushed, since contacts are soft, so the sign tells at rest too.
    """

    def __init__(self, model: mujoco.MjModel, geometry: MeshGeometry, arena: Arena, skin: NDArray[np.int32]) -> None:
        assert arena.backward_friction is not None
        self._forwards, self._backwards = arena.friction, arena.backward_friction
        n_planes = len(geometry.plane_x_m)
        self._crossing_site = np.array([model.site(f"crossing_{i}").id for i in range(geometry.n_crossings)])
        self._mean = np.equal.outer(np.arange(n_planes), geometry.crossing_plane) / geometry.n_per_plane
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        x = data.geom_xpos[skin, :1]
        self._plane = np.abs(x - geometry.plane_x_m).argmin(axis=1)

    def friction(self, data: mujoco.MjData, velocity: Array) -> Array:
        """Returns the coefficient of every part of the skin by its velocity, m/s, ``(n_skin, 3)``; ``(n_skin,)``."""
        centres = self._mean @ data.site_xpos[self._crossing_site]
        along = np.empty_like(centres)
        along[1:-1] = centres[:-2] - centres[2:]
        along[0], along[-1] = centres[0] - centres[1], centres[-2] - centres[-1]
        forwards = (velocity * along[self._plane]).sum(axis=-1)
        return np.where(forwards < 0.0, self._backwards, self._forwards)

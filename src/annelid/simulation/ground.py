"""The ground under a moving worm: tangent planes laid under its skin, and friction by the direction of sliding."""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.config import ArenaKind
from annelid.morphology import Array, MeshGeometry


class MovingGround:
    """Lays the planes of `annelid.arena.geoms.add_moving_planes` before every step.

    What approaches the ground finds its plane nearer by as much as it has yet to come in the step: the engine acts on
    where the skin is, and would stop it a step too late. Planes and friction follow from the engine's positions and
    velocities alone, so a run continues to the same bits.

    Attributes:
        depth_m: Depth of the deepest part of the skin in the ground where planes were laid last, m; negative above it.
    """

    def __init__(self, model: mujoco.MjModel, geometry: MeshGeometry, arena: ArenaKind) -> None:
        """Finds the planes; the compiled model of a worm with setae is its own, since friction is set in it."""
        self._model = model
        self.depth_m = -np.inf
        self._surface = arena.ground()
        # The engine may have swapped the two geoms of a pair, the skin's and that of the plane on a mocap body.
        geoms = np.stack([model.pair_geom1, model.pair_geom2])
        mocap = model.body_mocapid[model.geom_bodyid[geoms]]
        plane, pair = (mocap[1] >= 0).astype(int), np.arange(model.npair)
        self._skin, self._planes = geoms[1 - plane, pair], mocap[plane, pair]
        self._bodies = model.geom_bodyid[self._skin]
        self._roots = model.body_rootid[self._bodies]
        self._arena = arena
        n_planes, data = len(geometry.plane_x_m), mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        # What friction by the direction of sliding needs: means over crossing planes, and the one nearest at rest.
        self._crossing_site = np.array([model.site(f"crossing_{i}").id for i in range(geometry.n_crossings)])
        self._mean = np.equal.outer(np.arange(n_planes), geometry.crossing_plane) / geometry.n_per_plane
        self._plane = np.abs(data.geom_xpos[self._skin, :1] - geometry.plane_x_m).argmin(axis=1)

    def lay(self, data: mujoco.MjData, ahead_s: float) -> None:
        """Lays every plane where the ground is nearest to its part of the skin, and sets friction.

        The end of the step is a time ahead, s. Of the data, positions and velocities are read, and its kinematics are
        brought up to date.
        """
        model = self._model
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
            stage(model, data)
        places = data.geom_xpos[self._skin]
        spin, drift = data.cvel[self._bodies, :3], data.cvel[self._bodies, 3:]
        with np.errstate(invalid="ignore", over="ignore"):
            velocity = drift + np.cross(spin, places - data.subtree_com[self._roots])
            distance, normal = self._surface.nearest(places, first_order=True)
            self.depth_m = -float(np.minimum.reduce(distance))
            ahead = np.maximum(-(velocity * normal).sum(axis=-1), 0.0) * ahead_s
            data.mocap_pos[self._planes] = places - (distance - ahead)[:, np.newaxis] * normal
            data.mocap_quat[self._planes] = facing(normal)
            if self._arena.has_setae:
                model.pair_friction[:, :2] = self._friction(data, velocity)[:, np.newaxis]

    def _friction(self, data: mujoco.MjData, velocity: Array) -> Array:
        """The coefficient of every part of the skin by the sign of its velocity along the worm's axis there, as setae.

        A part that sticks creeps towards where it is pushed, since contacts are soft, so the sign holds at rest too.
        """
        centres = self._mean @ data.site_xpos[self._crossing_site]
        along = np.empty_like(centres)
        along[1:-1] = centres[:-2] - centres[2:]
        along[0], along[-1] = centres[0] - centres[1], centres[-2] - centres[-1]
        forwards = (velocity * along[self._plane]).sum(axis=-1)
        return np.where(forwards < 0.0, self._arena.backward_friction or 0.0, self._arena.friction)


def facing(normal: Array) -> Array:
    """Returns unit quaternions, ``(n, 4)``, that turn the z axis to unit normals, ``(n, 3)``, by the least angle."""
    x, y, z = normal.T
    turn = np.stack([1.0 + z, -y, x, np.zeros(len(z))], axis=-1)
    # Straight down any half turn about a level axis will do.
    turn[z < -1.0 + 1e-12] = [0.0, 1.0, 0.0, 0.0]
    return turn / np.sqrt((turn * turn).sum(axis=-1))[:, np.newaxis]

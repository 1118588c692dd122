"""A scene in the engine: what the skin touches of it, wherever that is, and the bodies that move.

Arenas with a surface know the ground's normal anywhere. In a scene the engine finds what touches, so sensors give
every part of the skin the net force on it, and depth and normal of its deepest contact.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.arena.geoms import SCENE, skin_geoms
from annelid.config import ArenaKind
from annelid.morphology import Array

_DEEPEST, _NET_FORCE = 1, 3
"""The engine's numbers for a contact sensor that gives the deepest contact, and one that adds up all."""
_FIELDS = mujoco.mjtConDataField
_FORCE, _PLACE = (
    1 << int(_FIELDS.mjCONDATA_FORCE),
    1 << int(_FIELDS.mjCONDATA_DIST) | 1 << int(_FIELDS.mjCONDATA_NORMAL),
)


class Encounter(NamedTuple):
    """What a worm touched in a scene during the last physics step."""

    force: Array  # of the worm on every body that moves, N, (n_objects, 3)
    depth: Array  # of the deepest vertex, m, (); negative above the ground
    normal: Array  # unit vectors out of what each geom of the skin touches, 0 where it touches nothing, (n_geoms, 3)


NO_ENCOUNTER = Encounter(np.zeros((0, 3)), np.array(-np.inf), np.zeros((0, 3)))


def in_scene(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Returns which bodies of a model belong to a scene and not to the worm, ``(nbody,)``."""
    return np.array([model.body(i).name.startswith(SCENE) for i in range(model.nbody)])


def add_scene_sensors(spec: mujoco.MjSpec, object_names: tuple[str, ...]) -> None:
    """Adds sensors of what touches every part of the skin, and of the force of each on every body that moves."""
    kinds = mujoco.mjtObj
    skin = [geom.name for geom in skin_geoms(spec)]
    for what, fields, reduce in (("net", _FORCE, _NET_FORCE), ("deepest", _PLACE, _DEEPEST)):
        for name in skin:
            spec.add_sensor(
                name=f"{what}_on_{name}",
                type=mujoco.mjtSensor.mjSENS_CONTACT,
                reftype=kinds.mjOBJ_GEOM,
                refname=name,
                intprm=[fields, reduce, 1],
            )
    for moved in object_names:
        for name in skin:
            spec.add_sensor(
                name=f"{name}_on_{moved}",
                type=mujoco.mjtSensor.mjSENS_CONTACT,
                objtype=kinds.mjOBJ_GEOM,
                objname=name,
                reftype=kinds.mjOBJ_BODY,
                refname=f"{SCENE}{moved}",
                intprm=[_FORCE, _NET_FORCE, 1],
            )


class Objects:
    """The bodies that move in a compiled scene, and its sensors, those of `add_scene_sensors`.

    Attributes:
        names: Their names.
        n_skin: How many geoms of the skin can touch.
    """

    def __init__(self, model: mujoco.MjModel, arena: ArenaKind) -> None:
        """Finds them; there are none, and no sensors of their kind, in an arena that is no scene."""
        self.names = arena.object_names
        self._is_scene = arena.is_scene
        self._bodies = np.array([model.body(f"{SCENE}{name}").id for name in self.names], dtype=int)
        self._weight_N = model.body_mass[self._bodies, np.newaxis] * model.opt.gravity
        sensors = np.flatnonzero(model.sensor_type == int(mujoco.mjtSensor.mjSENS_CONTACT))
        self.n_skin = len(sensors) // (2 + len(self.names)) if self._is_scene else 0
        self._first = int(model.sensor_adr[sensors[0]]) + 3 * self.n_skin
        geoms = model.sensor_refid[sensors[: self.n_skin]]
        self._radius_m = float(model.geom_size[geoms, 0].max()) if self._is_scene else 0.0

    def places(self, data: mujoco.MjData) -> Array:
        """Returns centres of mass, m, ``(n_objects, 3)``, of data whose kinematics are up to date."""
        return data.xipos.take(self._bodies, axis=0)

    def potential_energy_J(self, places_m: Array) -> float:
        """Energy of their weight, J, zero at the model's origin."""
        return -float((self._weight_N * places_m).sum())

    def read(self, data: mujoco.MjData) -> Encounter:
        """Reads the sensors; the force is zero, and there are no normals, where nothing can be met."""
        if not self._is_scene:
            return NO_ENCOUNTER
        values, first, last = data.sensordata, self._first, self._first + 4 * self.n_skin
        deepest = values[first:last].reshape(-1, 4)
        forces = values[last : last + 3 * self.n_skin * len(self.names)]
        force = forces.reshape(len(self.names), self.n_skin, 3).sum(axis=-2)
        # Without a contact all numbers are 0: then the skin's surface is at the ground at most.
        depth = -deepest[:, 0].min() - self._radius_m
        return Encounter(force, depth, deepest[:, 1:].copy())

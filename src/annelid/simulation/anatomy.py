"""Where the parts of a worm are in the engine's arrays, and what they say of its lengths and forces."""

from __future__ import annotations

from math import atan2, cos, sin
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.arena.geoms import skin_geoms
from annelid.arena.ground import surface_of
from annelid.arena.surface import Surface
from annelid.body.actuation import crossing_site, ring_names, stretch_sensors
from annelid.body.formulations import WRITTEN
from annelid.body.worm import WormBody
from annelid.config import ArenaKind
from annelid.morphology import Array, MeshGeometry, norm
from annelid.simulation.energies import Elasticity, EnergyMeter
from annelid.simulation.scene_objects import Objects, add_scene_sensors, in_scene
from annelid.simulation.skin import Skin

_NET_FORCE = 3
"""The engine's number for a contact sensor that adds up all contacts of a pair."""


def add_contact_sensors(spec: mujoco.MjSpec, arena: ArenaKind) -> None:
    """Adds, for every geom of the skin and every geom of the arena that it can touch, a sensor of the net force on it.

    They are in the world's axes and change nothing in the motion. In a scene there is one for every geom of the skin,
    whatever it touches.
    """
    if arena.is_scene:
        add_scene_sensors(spec, arena.object_names)
        return
    force = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE)
    grounds = [geom.name for geom in spec.geoms if geom.contype]
    pairs = [(ground, geom.name) for geom in skin_geoms(spec) for ground in grounds]
    pairs += [(pair.geomname1, pair.geomname2) for pair in spec.pairs]
    for ground, skin in pairs:
        spec.add_sensor(
            name=f"{ground}_on_{skin}",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=ground,
            reftype=mujoco.mjtObj.mjOBJ_GEOM,
            refname=skin,
            intprm=[force, _NET_FORCE, 1],
        )


class Posture(NamedTuple):
    """Positions and lengths at one instant, m."""

    crossing: Array  # positions of the crossings, (n_crossings, 3)
    center_of_mass: Array  # (3,)
    spring_length: Array  # (n_springs,)
    stretch: Array  # lengths of the springs that serve as sensors, (n_segments, n_sensors)
    ring_length: Array  # (n_muscles,)
    front: Array  # centre of the foremost ring, (3,)
    heading: Array  # unit vector from the centre of the last ring to that of the foremost, (3,)
    axis: Array  # unit vectors along the body towards its front at every ring, (n_segments, 3)
    skin: Array  # centres of the geoms that can touch the ground, (n_geoms, 3)
    objects: Array  # centres of mass of what moves in a scene, (n_objects, 3)


class Anatomy:
    """The parts of one compiled worm, found once.

    Attributes:
        ring_path: Crossings that each ring muscle runs through, in order, ``(n_muscles, n_corners)``.
        crossing_body: The engine's body at every crossing, ``(n_crossings,)``.
        rest_stretch_m: Lengths of the stretch sensors at rest, m, ``(n_segments, n_sensors)``.
        objects: What moves in a scene.
        total_mass_kg: Mass of the worm.
        body_order: The model's own number of each body of the worm, in the order of a written model, ``(n_bodies,)``;
            empty where it has that order.
        first_act: The engine's actuator states before the first step, ``(n_states,)``.
        elasticity: The energy that joints and springs store.
        energy_meter: What a physics step does, in work.
    """

    def __init__(self, model: mujoco.MjModel, body: WormBody, arena: ArenaKind) -> None:
        """Finds the parts of a body compiled with `add_contact_sensors`, in an arena."""
        self.model = model
        self.geometry: MeshGeometry = body.geometry()
        self.rings = body.rings
        self.muscle_names = ring_names(body.n_segments, body.rings)
        self.n_segments = self.geometry.n_segments
        self.n_muscles = len(self.muscle_names)
        segments = np.arange(self.n_segments)
        self._before, self._behind = np.maximum(segments - 1, 0), np.minimum(segments + 1, self.n_segments - 1)
        self._sensors = stretch_sensors(self.geometry, body.springs)
        self.rest_stretch_m = self.geometry.spring_length_m[self._sensors]
        self.first_act = body.rings.first_act(model)
        self._crossing_site = np.array([model.site(crossing_site(i)).id for i in range(self.geometry.n_crossings)])
        self.crossing_body: NDArray[np.int32] = model.site_bodyid[self._crossing_site]
        self._crossing_dof: NDArray[np.intp] | None = None
        if model.nflex:
            slide = model.body_dofadr[self.crossing_body][:, np.newaxis] + np.arange(3)
            self._crossing_dof = slide.astype(np.intp)
        self.body_order = _body_order(model)
        self._written = _coordinates_of(model, self.body_order)
        self.ring_path = np.stack([self._path_of(model.tendon(name).id) for name in self.muscle_names])
        mass = np.where(in_scene(model), 0.0, model.body_mass)
        self.total_mass_kg = float(mass.sum())
        self._mass_share = mass / mass.sum()
        self.objects = Objects(model, arena)
        self._find_skin(surface_of(arena))
        self.elasticity, self.energy_meter = Elasticity(model), EnergyMeter(model, body.rings)

    def _path_of(self, tendon: int) -> NDArray[np.int64]:
        """Crossings along a ring tendon."""
        start, count = self.model.tendon_adr[tendon], self.model.tendon_num[tendon]
        sites = self.model.wrap_objid[start : start + count]
        return np.array([np.flatnonzero(self._crossing_site == site)[0] for site in sites])

    def _find_skin(self, surface: Surface) -> None:
        """Finds the contact sensors, their geoms, and which segment's ring is nearest to each of these at rest."""
        model, geometry = self.model, self.geometry
        sensors = np.flatnonzero(model.sensor_type == int(mujoco.mjtSensor.mjSENS_CONTACT))
        sensors = sensors[: self.objects.n_skin or len(sensors)]
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._skin_geom = model.sensor_refid[sensors].astype(np.int64)
        rest = data.geom_xpos[self._skin_geom]
        nearest = np.abs(rest[:, :1] - geometry.plane_x_m[geometry.ring_planes]).argmin(axis=1)
        first = int(model.sensor_adr[sensors[0]])
        self._contact_slice = slice(first, first + 3 * len(sensors))
        self._segment_rows = np.eye(geometry.n_segments)[:, nearest]
        self.skin = Skin(rest, nearest, geometry.n_segments, geometry.radius_m, surface)

    def written(self, values: Array) -> Array:
        """Returns positions, ``(nq,)``, or velocities, ``(nv,)``, in the order that a written model has."""
        return np.concatenate([values[self._written], values[len(self._written) :]])

    def own(self, values: NDArray[np.floating]) -> Array:
        """Returns what is in the order of a written model in that of this one."""
        ordered = np.array(values, dtype=float)
        ordered[self._written] = values[: len(self._written)]
        return ordered

    def locate(self, data: mujoco.MjData) -> tuple[Array, Array, Array, Array]:
        """Brings the engine's positions up to its coordinates, which is not part of a step.

        Returns those of crossings, ``(n_crossings, 3)``, centre of mass, ``(3,)``, skin, ``(n_geoms, 3)``, and objects,
        ``(n_objects, 3)``, m.
        """
        mujoco.mj_kinematics(self.model, data)
        return (
            data.site_xpos.take(self._crossing_site, axis=0),
            self._mass_share @ data.xipos,
            data.geom_xpos.take(self._skin_geom, axis=0),
            self.objects.places(data),
        )

    def posture(self, crossing: Array, center_of_mass: Array, skin: Array, objects: Array) -> Posture:
        """Measures all lengths from the positions of the crossings and adds the others that `locate` gives."""
        ends = crossing.take(self.geometry.springs, axis=-2)
        spring = norm(ends[..., 1, :] - ends[..., 0, :])
        corners = crossing.take(self.ring_path, axis=-2)
        ring = norm(corners[..., 1:, :] - corners[..., :-1, :]).sum(axis=-1)
        center = crossing.take(self.geometry.rings, axis=-2).mean(axis=-2)
        front = center[..., 0, :]
        heading = _unit(front - center[..., -1, :])
        axis = _unit(center.take(self._before, axis=-2) - center.take(self._behind, axis=-2))
        stretch = spring.take(self._sensors, axis=-1)
        return Posture(crossing, center_of_mass, spring, stretch, ring, front, heading, axis, skin, objects)

    def stretch_rate(self, posture: Posture, qvel: Array) -> Array:
        """Returns how fast stretch sensors of a posture lengthen at velocities, ``(nv,)``, m/s; zero for a chain."""
        if self._crossing_dof is None:
            return np.zeros_like(posture.stretch)
        springs = self.geometry.springs[self._sensors]
        place, velocity = posture.crossing.take(springs, axis=0), qvel.take(self._crossing_dof[springs])
        along, apart = place[..., 1, :] - place[..., 0, :], velocity[..., 1, :] - velocity[..., 0, :]
        return (along * apart).sum(axis=-1) / posture.stretch

    def contacts(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Reads the ground's forces during the last physics step, N.

        Returns those on every segment, ``(n_segments, 3)``, and on every geom of the skin, ``(n_geoms, 3)``.
        """
        by_geom = data.sensordata[self._contact_slice].reshape(-1, 3).copy()
        return self._segment_rows @ by_geom, by_geom


def _body_order(model: mujoco.MjModel) -> NDArray[np.int64]:
    """The bodies of a plant in the order of a written model, if the plant has another."""
    is_own = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, WRITTEN) >= 0
    return 1 + model.numeric(WRITTEN).data.astype(np.int64) if is_own else np.empty(0, dtype=np.int64)


def _coordinates_of(model: mujoco.MjModel, bodies: NDArray[np.int64]) -> NDArray[np.int64]:
    """The coordinates of some bodies on slides and hinges, body by body."""
    starts, counts = model.jnt_qposadr[model.body_jntadr[bodies]], model.body_jntnum[bodies]
    each = [start + np.arange(count) for start, count in zip(starts, counts, strict=True)]
    return np.concatenate([np.empty(0, dtype=np.int64), *each])


def _unit(vectors: Array) -> Array:
    """Vectors of the same directions and of length one."""
    return vectors / norm(vectors)[..., np.newaxis]


class Placement(NamedTuple):
    """A posture in the engine's coordinates."""

    qpos: Array  # generalised positions, (nq,)
    turn: Array  # rotation matrix by which it is turned as a whole from the model at rest, (3, 3)


def start_placement(anatomy: Anatomy, body: WormBody) -> Placement:
    """Returns how a worm lies on its ground at the start; in the model it leads towards -x.

    If its radius differs along it, its axis is level in the model; then it leans until the
    lowest points of its first and its last ring are equally high, and its own lowest point has the height z = 0.
    """
    geometry, radii, rings = anatomy.geometry, body.mesh.radii_m, anatomy.geometry.ring_planes[[0, -1]]
    if len(set(radii)) == 1:
        return Placement(anatomy.model.qpos0.copy(), np.eye(3))
    lean = atan2(radii[0] - radii[-1], float(np.diff(geometry.plane_x_m[rings])[0]))
    turn = np.array([[cos(lean), 0.0, sin(lean)], [0.0, 1.0, 0.0], [-sin(lean), 0.0, cos(lean)]])
    lowest_m = float((geometry.vertices_m @ turn[2]).min())
    return turned_placement(anatomy.model, turn, -lowest_m)


def turned_placement(
    model: mujoco.MjModel, turn: Array, lifted_m: float = 0.0, posture: Array | None = None
) -> Placement:
    """Turns a worm, at rest unless a posture is given, by a rotation matrix, ``(3, 3)``, about the model's origin.

    That is below its front end.

    The model lies along x, and its state at the start is that of the turned worm. So all that belongs to the body
    (which segment and side a part of the skin is on, the grain of setae, rest lengths) is the same for all turns.
    """
    qpos: Array = (model.qpos0 if posture is None else posture).copy()
    # Points on three slides along the world's axes.
    slides = model.jnt_type[model.body_jntadr] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    scene = in_scene(model)
    points = np.flatnonzero(slides & (model.body_jntnum == 3) & ~scene)
    address = model.jnt_qposadr[model.body_jntadr[points]][:, np.newaxis] + np.arange(3)
    origin = model.body_pos[points]
    qpos[address] = (origin + qpos[address]) @ turn.T - origin
    if lifted_m:
        qpos[address[:, 2]] += lifted_m
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(turn).ravel())
    free_joints = (model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE)) & ~scene[model.jnt_bodyid]
    for free in model.jnt_qposadr[free_joints]:
        qpos[free : free + 3] = turn @ qpos[free : free + 3]
        qpos[free + 2] += lifted_m
        mujoco.mju_mulQuat(qpos[free + 3 : free + 7], quaternion, qpos[free + 3 : free + 7].copy())
    return Placement(qpos, turn)

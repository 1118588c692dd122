"""Where the parts of a worm are in the engine's arrays, and what they say of its lengths and forces.

Every function takes the arrays of one worm, or those of many with one more axis in front, and gives the same numbers
to the last bit in both cases: sums run in the same order whatever the number of worms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.arena.geoms import touching
from annelid.arena.surface import Surface
from annelid.body import mesh_of
from annelid.body.actuation import crossing_site, ring_names, stretch_sensors
from annelid.body.worm import WormBody
from annelid.morphology import Array, MeshGeometry, norm
from annelid.simulation.elasticity import Elasticity
from annelid.simulation.energies import EnergyMeter
from annelid.simulation.skin import Skin

_NET_FORCE = 3
"""The engine's number for a contact sensor that adds up all contacts of a pair."""


def add_contact_sensors(spec: mujoco.MjSpec) -> None:
    """Adds, for every geom of the skin and every geom of the arena that it can touch, a sensor of the net force on it.

    Forces are in the world's axes. The sensors change nothing in the motion, take no measurable time, and read the same
    in a batch as alone.
    """
    force = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE)
    grounds = [geom.name for geom in spec.geoms if geom.contype]
    pairs = [(ground, geom.name) for geom in touching(spec) for ground in grounds]
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


@dataclass(frozen=True, slots=True)
class _Rows:
    """Arrays that all have the same axes in front."""

    def each(self) -> list[Self]:
        """Returns those of every worm, out of those of many."""
        return [
            type(self)(*of_one) for of_one in zip(*(getattr(self, field.name) for field in fields(self)), strict=True)
        ]


@dataclass(frozen=True, slots=True)
class Posture(_Rows):
    """Positions and lengths at one instant, m; of many worms with one more axis in front.

    Attributes:
        crossing: Positions of the crossings, ``(n_crossings, 3)``.
        center_of_mass: Shape ``(3,)``.
        spring_length: Shape ``(n_springs,)``.
        stretch: Lengths of the springs that serve as sensors, ``(n_segments, n_sensors)``.
        ring_length: Shape ``(n_muscles,)``.
        front: Centre of the foremost ring, ``(3,)``.
        heading: Unit vector from the centre of the last ring to that of the foremost, ``(3,)``.
        axis: Unit vectors along the body towards its front at every ring, ``(n_segments, 3)``.
        skin: Centres of the geoms that can touch the ground, ``(n_geoms, 3)``.
    """

    crossing: Array
    center_of_mass: Array
    spring_length: Array
    stretch: Array
    ring_length: Array
    front: Array
    heading: Array
    axis: Array
    skin: Array


@dataclass(frozen=True, slots=True)
class Forces(_Rows):
    """What acted during the last physics step; of many worms with one more axis in front.

    Attributes:
        contact: Force of the arena on every segment, N, ``(n_segments, 3)``.
        edge_strain: Largest strain of a rod's edge, ``()``; 0 for a chain.
        pin_gap: Largest gap between two pinned strands, m, ``()``; 0 where pins cannot part.
    """

    contact: Array
    edge_strain: Array
    pin_gap: Array


class Movement(NamedTuple):
    """What one movement of a body has come to.

    Attributes:
        posture: Where the body is at its end.
        forces: What acted during its last physics step.
        ground: Force of the ground on every geom of the skin during that step, N, ``(n_geoms, 3)``.
    """

    posture: Posture
    forces: Forces
    ground: Array


class Anatomy:
    """The parts of one compiled worm, found once.

    Attributes:
        model: The compiled body.
        geometry: The mesh.
        muscle_names: Names of the ring muscles.
        ring_path: Crossings that each of them runs through, in order, ``(n_muscles, n_corners)``.
        crossing_body: The engine's body at every crossing, ``(n_crossings,)``.
        n_segments: Number of actuated segments.
        n_muscles: Number of ring muscles.
        rest_stretch_m: Lengths of the stretch sensors at rest, m, ``(n_segments, n_sensors)``.
        first_act: The engine's actuator states before the first step, ``(n_states,)``.
        has_edges: Whether strands are rods, whose edges may be strained.
        pins_can_part: Whether the two strands of a crossing may part.
        elasticity: The energy that strands, joints and springs hold.
        energy_meter: What a physics step does, in work.
        outputs: Names of the engine's arrays that `forces` and `ground` need.
        skin: The geoms that can touch the ground.
    """

    def __init__(self, model: mujoco.MjModel, body: WormBody, surface: Surface) -> None:
        """Finds the parts of a body compiled with `add_contact_sensors`, on a surface."""
        self.model = model
        self.geometry: MeshGeometry = mesh_of(body.mesh)
        self.muscle_names = ring_names(body.n_segments, body.rings)
        self.n_segments = self.geometry.n_segments
        self.n_muscles = len(self.muscle_names)
        segments = np.arange(self.n_segments)
        self._before, self._behind = np.maximum(segments - 1, 0), np.minimum(segments + 1, self.n_segments - 1)
        self._sensors = stretch_sensors(self.geometry, body.springs)
        self.rest_stretch_m = self.geometry.spring_length_m[self._sensors]
        self._rings = body.rings
        self.first_act = body.rings.first_act(model)
        self.has_edges = bool(model.nflexedge)
        self._crossing_site = np.array([model.site(crossing_site(i)).id for i in range(self.geometry.n_crossings)])
        self.crossing_body: NDArray[np.int32] = model.site_bodyid[self._crossing_site]
        self.ring_path = np.stack([self._path_of(model.tendon(name).id) for name in self.muscle_names])
        self._mass_share = model.body_mass / model.body_mass.sum()
        self._edges_per_m = 1.0 / model.flexedge_length0
        self._contact_slice, self._skin_geom, self._segment_rows, self.skin = self._contacts_of_segments(surface)
        self._pin_gap, pin_outputs = body.formulation.pin_reader(model, self.geometry)
        self.pins_can_part = self._pin_gap is not None
        edges = ("flexedge_length",) if self.has_edges else ()
        self.elasticity = Elasticity(model, body)
        self.energy_meter = EnergyMeter(model, body.rings)
        self.outputs: tuple[str, ...] = ("sensordata", *edges, *pin_outputs)

    def _path_of(self, tendon: int) -> NDArray[np.int64]:
        """Crossings along a ring tendon."""
        start, count = self.model.tendon_adr[tendon], self.model.tendon_num[tendon]
        sites = self.model.wrap_objid[start : start + count]
        crossing = {int(site): index for index, site in enumerate(self._crossing_site)}
        return np.array([crossing[int(site)] for site in sites])

    def _contacts_of_segments(self, surface: Surface) -> tuple[slice, NDArray[np.int64], Array, Skin]:
        """Where the contact sensors are, their geoms, and which segment's ring is nearest to each of these at rest."""
        model, geometry = self.model, self.geometry
        sensors = np.flatnonzero(model.sensor_type == int(mujoco.mjtSensor.mjSENS_CONTACT))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        ring_x = geometry.plane_x_m[geometry.ring_planes]
        geoms = model.sensor_refid[sensors].astype(np.int64)
        rest = data.geom_xpos[geoms]
        nearest = np.abs(rest[:, :1] - ring_x[None]).argmin(axis=1)
        first = int(model.sensor_adr[sensors[0]])
        skin = Skin(rest, nearest, geometry.n_segments, geometry.radius_m, surface)
        return slice(first, first + 3 * len(sensors)), geoms, np.eye(geometry.n_segments)[:, nearest], skin

    def locate(self, data: mujoco.MjData) -> tuple[Array, Array, Array]:
        """Brings the engine's positions up to its coordinates, which is not part of a step.

        Returns:
            Positions of the crossings, ``(n_crossings, 3)``, of the centre of mass, ``(3,)``, and of the geoms that can
            touch, ``(n_geoms, 3)``, m.
        """
        mujoco.mj_kinematics(self.model, data)
        return (
            data.site_xpos.take(self._crossing_site, axis=0),
            self._mass_share @ data.xipos,
            data.geom_xpos.take(self._skin_geom, axis=0),
        )

    def posture(self, crossing: Array, center_of_mass: Array, skin: Array) -> Posture:
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
        return Posture(crossing, center_of_mass, spring, stretch, ring, front, heading, axis, skin)

    def control(self, activation: Array, state: Array, ring_length_m: Array, time_s: float) -> Array:
        """Tells what the engine's actuators get under an activation, ``(n_muscles,)``: the same, or for servos a speed.

        Args:
            activation: In [0, 1], ``(n_muscles,)``.
            state: The engine's actuator states, ``(n_states,)``: slack lengths of the servos' cables, m.
            ring_length_m: Lengths of the ring actuators, m, ``(n_muscles,)``.
            time_s: Time for which it holds, s.
        """
        return self._rings.drive(self.model, activation, state, ring_length_m, time_s)

    def ground(self, engine: Mapping[str, Array]) -> Array:
        """Reads the force of the ground on every geom of the skin during the last physics step, N, ``(n_geoms, 3)``."""
        return self._by_geom(engine).copy()

    def _by_geom(self, engine: Mapping[str, Array]) -> Array:
        by_geom = engine["sensordata"][..., self._contact_slice]
        return by_geom.reshape(*by_geom.shape[:-1], -1, 3)

    def forces(self, engine: Mapping[str, Array]) -> Forces:
        """Reads what acted during the last physics step, but for the muscles' pull, which the energy totals tell.

        Args:
            engine: The engine's arrays named in `outputs`.
        """
        contact = self._segment_rows @ self._by_geom(engine)
        strain = gap = np.zeros(contact.shape[:-2])
        if self.has_edges:
            strain = np.abs(engine["flexedge_length"] * self._edges_per_m - 1.0).max(axis=-1)
        if self._pin_gap is not None:
            gap = self._pin_gap(engine)
        return Forces(contact, strain, gap)

    def no_forces(self, *n_worms: int) -> Forces:
        """Returns the forces before the first step."""
        return Forces(
            np.zeros((*n_worms, self.n_segments, 3)),
            np.zeros(n_worms),
            np.zeros(n_worms),
        )


def _unit(vectors: Array) -> Array:
    """Vectors of the same directions and of length one."""
    return vectors / norm(vectors)[..., np.newaxis]

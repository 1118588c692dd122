"""The 3D worm as a Plant: MuJoCo steps the body, annelid reads what it feels."""

from __future__ import annotations

import logging
from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body import build_spec, mesh_of
from annelid.body.actuation import crossing_site, ring_names
from annelid.body.rods import vertex_name
from annelid.clock import StepRatio
from annelid.config import Chain, Rods, RunConfig, WormBody
from annelid.errors import ConfigError, SimulationStopped
from annelid.morphology import Array, MeshGeometry
from annelid.protocols import Recordable, Sensation, Signal, State

STATE_PARTS = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""All that the next step depends on: positions, velocities, activations, warm start, and the rods' frames
(which the engine keeps as "plastic" state)."""

AXES = ("x", "y", "z")
PYRAMID_EDGES = np.arange(4)
PYRAMID_TO_FORCE = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]])
"""From the edges of the engine's friction pyramid to normal force and tangents over friction."""
_log = logging.getLogger(__name__)
# Otherwise the engine prints its warnings and writes them to a file in the user's folder; `alarm` reports them.
mujoco.set_mju_user_warning(lambda message: _log.info("%s", message))
ENGINE_WARNINGS = {
    mujoco.mjtWarning.mjWARN_INERTIA: "the engine's implicit solve did not converge",
    mujoco.mjtWarning.mjWARN_CONTACTFULL: "the engine ran out of room for contacts",
    mujoco.mjtWarning.mjWARN_CNSTRFULL: "the engine ran out of room for constraints",
    mujoco.mjtWarning.mjWARN_BADQPOS: "a position became unbounded or NaN",
    mujoco.mjtWarning.mjWARN_BADQVEL: "a velocity became unbounded or NaN",
    mujoco.mjtWarning.mjWARN_BADQACC: "an acceleration became unbounded or NaN",
}
ALARM_EVERY = 10
"""Movements of the body between two looks at the kinetic energy, which costs a pass over all joints."""


class WormPlant:
    """The 3D worm on its floor.

    Lengths and positions are those at the end of the step; forces and edge strains are those that acted during
    the last physics step, since the engine computes them on the way.
    """

    def __init__(self, config: RunConfig) -> None:
        """Builds and compiles the body.

        Args:
            config: The run's configuration.

        Raises:
            ConfigError: The body is planar, or the engine refuses the model.
        """
        spec = build_spec(config)
        assert isinstance(config.body, WormBody)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        try:
            self.model = spec.compile()
        except ValueError as error:
            raise ConfigError(f"the engine refuses this body: {str(error).splitlines()[0]}") from None
        self.data = mujoco.MjData(self.model)
        self.geometry: MeshGeometry = mesh_of(config.body.mesh)
        self._config = config
        self._body = config.body
        self._ratio = StepRatio(config.clock.control_timestep_s, config.clock.physics_timestep_s)
        self._muscle_names = ring_names(config.body.n_segments, config.body.rings)
        self._resolve_names()
        self._mass = self.model.body_mass / self.model.body_mass.sum()
        self._control_step = 0
        self._forget_forces()

    def _resolve_names(self) -> None:
        model, geometry = self.model, self.geometry
        self._crossing_site = np.array([model.site(crossing_site(i)).id for i in range(geometry.n_crossings)])
        self._sensor = geometry.sensor_springs
        self._floor = model.geom("floor").id
        self._rest_stretch = geometry.spring_length_m[self._sensor]
        self._ring_path = np.stack([self._path_of(model.tendon(name).id) for name in self._muscle_names])
        self._segment_of_geom = self._segments_of_geoms()
        self._inverse_edge_length = 1.0 / model.flexedge_length0
        self._segment_rows = np.eye(geometry.n_segments)
        self._pinned_vertices = self._vertices_at_pins()

    def _vertices_at_pins(self) -> NDArray[np.int64] | None:
        """Bodies of both strands at every crossing of rods with separate pins, ``(n_crossings, 2)``."""
        formulation, geometry = self._body.formulation, self.geometry
        if not isinstance(formulation, Rods) or formulation.pins == "shared":
            return None
        vertices = geometry.crossing_vertex[geometry.crossing_plane]
        return np.array(
            [
                [self.model.body(vertex_name(int(strand), int(vertex))).id for strand in strands]
                for strands, vertex in zip(geometry.crossing_strands, vertices, strict=True)
            ]
        )

    def _path_of(self, tendon: int) -> NDArray[np.int64]:
        """Crossings along a ring tendon."""
        start, count = self.model.tendon_adr[tendon], self.model.tendon_num[tendon]
        sites = self.model.wrap_objid[start : start + count]
        crossing = {int(site): index for index, site in enumerate(self._crossing_site)}
        return np.array([crossing[int(site)] for site in sites])

    def _segments_of_geoms(self) -> NDArray[np.int64]:
        """Segment whose ring is nearest to each geom at rest; the engine's rest pose is qpos0."""
        mujoco.mj_kinematics(self.model, self.data)
        ring_x = self.geometry.plane_x_m[self.geometry.ring_planes]
        return np.abs(self.data.geom_xpos[:, :1] - ring_x[None]).argmin(axis=1)

    def _forget_forces(self) -> None:
        self._muscle_force = np.zeros(self.n_muscles)
        self._contact_force = np.zeros((self.n_segments, 3))
        self._edge_strain = 0.0
        self._pin_gap = 0.0

    @property
    def n_segments(self) -> int:
        """Number of actuated segments."""
        return self.geometry.n_segments

    @property
    def n_muscles(self) -> int:
        """Number of ring muscles."""
        return len(self._muscle_names)

    @property
    def total_mass_kg(self) -> float:
        """Mass of strands and pins."""
        return float(self.model.body_mass.sum())

    def reset(self, seed: int) -> Sensation:
        """Returns to the rest posture at time zero; nothing in the body is random, so ``seed`` changes nothing."""
        mujoco.mj_resetData(self.model, self.data)
        self._control_step = 0
        self._forget_forces()
        self._locate()
        return self._feel()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step.

        Args:
            activation: Muscle activation in [0, 1], shape ``(n_muscles,)``.

        Returns:
            What the body feels at the end of the step.

        Raises:
            SimulationStopped: The engine gave up on the step.
        """
        self._control_step += 1
        due = self._ratio.physics_steps_due(self._control_step)
        if due:
            self.data.ctrl[:] = activation
            try:
                mujoco.mj_step(self.model, self.data, due)
            except mujoco.FatalError as error:
                raise SimulationStopped(f"the engine stopped at {self.data.time:.3f} s: {error}") from None
            self._collect_forces()
            self._locate()
        return self._feel()

    def _locate(self) -> None:
        """Brings positions up to the end of the step, and with them all lengths."""
        mujoco.mj_kinematics(self.model, self.data)
        self._crossing = self.data.site_xpos[self._crossing_site]
        ends = self._crossing[self.geometry.springs]
        self._spring_length = _norm(ends[:, 1] - ends[:, 0])
        corners = self._crossing[self._ring_path]
        self._ring_length = _norm(corners[:, 1:] - corners[:, :-1]).sum(axis=1)
        self._stretch = self._spring_length[self._sensor]
        self._center_of_mass = self._mass @ self.data.xipos

    def _collect_forces(self) -> None:
        data = self.data
        self._muscle_force = -data.actuator_force
        self._contact_force = self._contact_forces()
        if self.model.nflexedge:
            strain = data.flexedge_length * self._inverse_edge_length - 1.0
            self._edge_strain = max(float(strain.max()), -float(strain.min()))
        if self._pins_can_part:
            self._pin_gap = self._largest_pin_gap()

    @property
    def _pins_can_part(self) -> bool:
        return self._pinned_vertices is not None or not self.model.nflexedge

    def _largest_pin_gap(self) -> float:
        """Distance between the two strands of the crossing that parts most, m."""
        if self._pinned_vertices is not None:
            ends = self.data.xpos[self._pinned_vertices]
            return float(_norm(ends[:, 1] - ends[:, 0]).max())
        residual = self.data.efc_pos[: 3 * self.model.neq].reshape(self.model.neq, 3)
        formulation = self._body.formulation
        if isinstance(formulation, Chain) and formulation.pins == "separate":
            residual = residual[0::2] - residual[1::2]
        return float(np.linalg.norm(residual, axis=1).max())

    def _contact_forces(self) -> Array:
        """Sums the floor's force over the contacts of each segment, N, shape ``(n_segments, 3)``.

        The engine gives the force on the second partner as the four edges of a friction pyramid, and no
        address for a contact that bears none.
        """
        contact = self.data.contact
        address = contact.efc_address
        if not len(address):
            return np.zeros((self.n_segments, 3))
        local = self.data.efc_force[np.maximum(address, 0)[:, None] + PYRAMID_EDGES] @ PYRAMID_TO_FORCE
        local[:, 1:] *= contact.friction[:, :2]
        world = (local[:, None] @ contact.frame.reshape(-1, 3, 3))[:, 0]
        first, second = contact.geom.T
        floor_first = first == self._floor
        sign = np.where(floor_first, 1.0, -1.0) * (address >= 0)
        segment = self._segment_of_geom[np.where(floor_first, second, first)]
        return self._segment_rows[segment].T @ (sign[:, None] * world)

    def _feel(self) -> Sensation:
        """Tells the present lengths and forces; `_locate` and `_collect_forces` make new arrays each time."""
        return Sensation(
            time_s=self._control_step * self._config.clock.control_timestep_s,
            stretch_m=self._stretch,
            rest_stretch_m=self._rest_stretch,
            ring_length_m=self._ring_length,
            muscle_force_N=self._muscle_force,
            contact_force_N=self._contact_force,
            center_of_mass_m=self._center_of_mass,
        )

    def kinetic_energy_J(self) -> float:
        """Kinetic energy of the whole body, J (the chain's includes its numerical joint inertia)."""
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy[1])

    def alarm(self) -> str | None:
        """Tells whether the engine has warned, or energy, height, edge strain or pin gaps exceed the guard.

        Returns:
            One sentence naming the quantity, its value and its limit, or None.
        """
        warned = self.data.warning.number
        if warned.any():
            for warning, words in ENGINE_WARNINGS.items():
                if warned[warning]:
                    return f"{words}; a shorter clock.physics_timestep_s or softer settings may help"
        guard = self._config.guard
        height = float(self._crossing[:, 2].max())
        readings = [
            ("guard.height_m", "height of a crossing", height, guard.height_m, " m"),
            ("guard.edge_strain", "edge strain of a rod", self._edge_strain, guard.edge_strain, ""),
            ("guard.pin_gap_m", "gap at a pin", self._pin_gap, guard.pin_gap_m, " m"),
        ]
        if self._control_step % (ALARM_EVERY * self._ratio.control_steps_per_move) == 0:
            energy = self.kinetic_energy_J()
            readings.append(("guard.kinetic_energy_J", "kinetic energy", energy, guard.kinetic_energy_J, " J"))
        for field, words, value, limit, unit in readings:
            if not value <= limit:
                return f"{words} is {value:.3g}{unit}, above the limit {field} = {limit:g}"
        return None

    def recordable(self) -> Recordable:
        """Names the signals of the body."""
        n, m, geometry = self.n_segments, self.n_muscles, self.geometry
        sensors = geometry.sensor_springs.shape[1]
        stretch = ("segment", "sensor")
        shape = (n, sensors)
        extremes: list[Signal] = []
        if self.model.nflexedge:
            extremes.append(Signal("edge_strain", (), (), "1", "largest strain of a rod's edge"))
        if self._pins_can_part:
            extremes.append(Signal("pin_gap", (), (), "m", "largest gap between two pinned strands"))
        return Recordable(
            signals=(
                Signal("stretch_length", stretch, shape, "m", "length of the springs that span a ring"),
                Signal("spring_length", ("spring",), (len(geometry.springs),), "m", "length of an axial spring"),
                Signal("ring_length", ("muscle",), (m,), "m", "length of a ring muscle"),
                Signal("muscle_force", ("muscle",), (m,), "N", "contractile force of a ring muscle"),
                Signal("contact_force", ("segment", "axis"), (n, 3), "N", "force of the floor on a segment"),
                Signal("center_of_mass", ("axis",), (3,), "m", "centre of mass"),
                Signal("kinetic_energy", (), (), "J", "kinetic energy"),
                *extremes,
                Signal(
                    "crossing_position",
                    ("crossing", "axis"),
                    (geometry.n_crossings, 3),
                    "m",
                    "position of a crossing",
                    every_frame=True,
                ),
                Signal("qpos", ("coordinate",), (self.model.nq,), "1", "generalised position", every_frame=True),
            ),
            coords={"muscle": self._muscle_names, "axis": AXES},
            attrs={
                "total_mass_kg": self.total_mass_kg,
                "body_length_m": geometry.length_m,
            },
        )

    def read(self, frame: bool) -> Mapping[str, NDArray[np.generic] | float]:
        """Reads the present values of the frame signals, or of all others."""
        if frame:
            return {"crossing_position": self._crossing, "qpos": self.data.qpos}
        values: dict[str, NDArray[np.generic] | float] = {
            "stretch_length": self._stretch,
            "spring_length": self._spring_length,
            "ring_length": self._ring_length,
            "muscle_force": self._muscle_force,
            "contact_force": self._contact_force,
            "center_of_mass": self._center_of_mass,
            "kinetic_energy": self.kinetic_energy_J(),
        }
        if self.model.nflexedge:
            values["edge_strain"] = self._edge_strain
        if self._pins_can_part:
            values["pin_gap"] = self._pin_gap
        return values

    def get_state(self) -> State:
        """Returns the engine's whole state and what was felt last."""
        engine = np.empty(mujoco.mj_stateSize(self.model, STATE_PARTS))
        mujoco.mj_getState(self.model, self.data, engine, STATE_PARTS)
        return {
            "engine": engine,
            "control_step": np.array([self._control_step]),
            "muscle_force": self._muscle_force.copy(),
            "contact_force": self._contact_force.copy(),
            "extremes": np.array([self._edge_strain, self._pin_gap]),
        }

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned; the run then continues bit for bit on the same machine."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, np.asarray(state["engine"], dtype=float), STATE_PARTS)
        self._control_step = int(state["control_step"][0])
        self._muscle_force = np.asarray(state["muscle_force"], dtype=float).copy()
        self._contact_force = np.asarray(state["contact_force"], dtype=float).copy()
        self._edge_strain, self._pin_gap = (float(value) for value in state["extremes"])
        self._locate()


def _norm(vectors: Array) -> Array:
    """Lengths of vectors along the last axis; faster than numpy's own for many short ones."""
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))

"""The 3D worm as a Plant: MuJoCo steps the body, annelid reads what it feels."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from typing import Any, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.arena.surface import Plane, surface_of
from annelid.body import build_spec, compile_spec
from annelid.body.damping import MaterialDamping, add_damper_rows
from annelid.body.worm import WormBody
from annelid.clock import StepRatio
from annelid.config import RunConfig
from annelid.errors import SimulationStopped
from annelid.morphology import Array, MeshGeometry, heading_turn
from annelid.plausibility import check, refuse_nonsense
from annelid.protocols import SIDES, Recordable, Sensation, State
from annelid.simulation.anatomy import Anatomy, Forces, Movement, Posture, add_contact_sensors
from annelid.simulation.energies import EnergyTotals, Engine
from annelid.simulation.ground import MovingGround
from annelid.simulation.placing import at_rest, turned
from annelid.simulation.signals import worm_signals
from annelid.simulation.skin import Touch
from annelid.simulation.watch import Energies, Watch

STATE_PARTS = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""All that the next step depends on: positions, velocities, activations, warm start, and the rods' frames
(which the engine keeps as "plastic" state)."""

AXES = ("x", "y", "z")
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
"""Movements of the body between two looks at what is costly to tell: kinetic energy, and the height above a relief."""


def engine_stopped(time_s: float, error: object) -> str:
    """Returns the sentence for an engine that gave up at a simulated time, s."""
    return f"the engine stopped at {time_s:.3f} s: {error}"


def compile_worm(config: RunConfig) -> Anatomy:
    """Builds and compiles a worm in its arena.

    Raises:
        ConfigError: The body is planar, its numbers can mean nothing, or the engine refuses the model.
    """
    refuse_nonsense(config)
    spec = build_spec(config, for_plant=True)
    assert isinstance(config.body, WormBody)
    assert config.arena is not None
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    add_contact_sensors(spec)
    add_damper_rows(spec)
    model = compile_spec(spec)
    return Anatomy(model, config.body, surface_of(config.arena))


def owns_model(config: RunConfig) -> bool:
    """Tells whether a worm sets numbers in its compiled model as it moves, which no other worm may use then."""
    body, arena = config.body, config.arena
    assert isinstance(body, WormBody)
    assert arena is not None
    return arena.has_setae or _has_damper_rows(body)


def _has_damper_rows(body: WormBody) -> bool:
    return body.formulation.damps_material and bool(body.strands.material_damping_s)


class Worm(ABC):
    """What a 3D worm feels, records and is alarmed by, whoever steps it.

    Lengths and positions are those at the end of the step; forces and edge strains are those that acted during
    the last physics step, since the engine computes them on the way.

    Attributes:
        start: Where it starts; None for the model's own rest, which leads towards -x.
    """

    def __init__(self, config: RunConfig, anatomy: Anatomy) -> None:
        """Makes a worm that has sensed nothing yet.

        Args:
            config: The run's configuration.
            anatomy: The compiled body; the worm's own where `owns_model` says so.
        """
        self.anatomy = anatomy
        self._config = config
        assert config.arena is not None
        self._surface = surface_of(config.arena)
        in_pipe = config.arena.is_closed
        self._height_words = "distance of a crossing from the pipe's wall" if in_pipe else "height of a crossing"
        moving = config.arena.has_moving_planes
        self.ground = MovingGround(anatomy.model, anatomy.geometry, config.arena) if moving else None
        body = config.body
        assert isinstance(body, WormBody)
        self.damping = MaterialDamping(anatomy.model, body.strands) if _has_damper_rows(body) else None
        # What needs no moving planes is level.
        self._floor = cast(Plane, config.arena.ground())
        self._ratio = StepRatio(config.clock.control_timestep_s, config.clock.physics_timestep_s)
        self._control_step = 0
        self._posture: Posture
        self._forces: Forces = anatomy.no_forces()
        self._energies: EnergyTotals = anatomy.energy_meter.opened()
        self._tension_N = np.zeros(anatomy.n_muscles)
        self._touch = Touch.none(anatomy.n_segments)
        self._activation: Array = np.zeros(anatomy.n_muscles)
        self._watch = self._new_watch()
        self._elastic_at_start_J = self._potential_at_start_J = 0.0
        heading = body.heading_deg
        self.start = turned(anatomy.model, at_rest(anatomy.model), heading_turn(heading)) if heading else None

    def _new_watch(self) -> Watch:
        assert isinstance(self._config.body, WormBody)
        return Watch(self._config.body, self._config.guard)

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled body."""
        return self.anatomy.model

    @property
    def geometry(self) -> MeshGeometry:
        """The mesh."""
        return self.anatomy.geometry

    @property
    def n_segments(self) -> int:
        """Number of actuated segments."""
        return self.anatomy.n_segments

    @property
    def n_muscles(self) -> int:
        """Number of ring muscles."""
        return self.anatomy.n_muscles

    @property
    def posture(self) -> Posture:
        """Where the body is."""
        return self._posture

    @property
    def touch(self) -> Touch:
        """What the skin feels of the ground, and how far it has slid."""
        return self._touch

    @property
    def energies(self) -> EnergyTotals:
        """What the muscles have done so far, and where it went."""
        return self._energies

    @property
    def total_mass_kg(self) -> float:
        """Mass of strands and pins."""
        return float(self.model.body_mass.sum())

    @abstractmethod
    def reset_engine(self, state: Array | None = None) -> None:
        """Resets the engine, and gives it a state that `engine_state` returned if there is one."""

    @abstractmethod
    def move(self, activation: Array, n_steps: int) -> Movement:
        """Takes physics steps under an activation, ``(n_muscles,)``.

        Raises:
            SimulationStopped: The engine gave up.
        """

    @abstractmethod
    def actuator_state(self) -> Array:
        """Returns the engine's actuator states, ``(n_states,)``."""

    @abstractmethod
    def locate(self) -> Posture:
        """Reads the posture from the engine's coordinates."""

    @abstractmethod
    def qpos(self) -> Array:
        """Returns the generalised positions, ``(nq,)``."""

    @abstractmethod
    def plastic(self) -> Array:
        """Returns what the engine keeps of the rods' frames, ``(nplastic,)``."""

    @abstractmethod
    def engine_state(self) -> Array:
        """Returns a copy of all that the engine's next step depends on, as `STATE_PARTS` names it."""

    @abstractmethod
    def warnings(self) -> NDArray[np.int32]:
        """Returns how often the engine has given each of its warnings."""

    @abstractmethod
    def kinetic_energy_J(self) -> float:
        """Kinetic energy of the whole body, J (the chain's includes its numerical joint inertia)."""

    def elastic_energy_J(self) -> float:
        """Energy that strands, joints and springs hold, J."""
        return self.anatomy.elasticity.energy_J(self.qpos(), self.plastic(), self._posture.spring_length)

    def potential_energy_J(self) -> float:
        """Energy of the weight, J, zero with the centre of mass at the origin."""
        return -self.total_mass_kg * float(self.model.opt.gravity @ self._posture.center_of_mass)

    def drive(self, activation: Array, actuator_state: Array) -> Array:
        """Tells what the gain of the actuators is multiplied by during the next physics step, ``(n_muscles,)``."""
        return actuator_state.copy() if self.model.na else activation

    def book(self, engine: Engine, drive: Array) -> None:
        """Adds one physics step to the energy totals, and notes what the actuators pulled with.

        Args:
            engine: The engine's arrays named in the energy_meter's `outputs`, after the step.
            drive: What `drive` returned before it.
        """
        self._tension_N, entries = self.anatomy.energy_meter.step(engine, drive)
        if self.damping is not None:
            # The engine counts the rows among its constraints.
            loss = self._config.clock.physics_timestep_s * self.damping.loss_W(engine["qvel"])
            entries = replace(
                entries, damping_loss=entries.damping_loss + loss, constraint_loss=entries.constraint_loss - loss
            )
        self._energies += entries

    def reset(self, seed: int) -> Sensation:
        """Returns to the rest posture at time zero; nothing in the body is random, so ``seed`` changes nothing."""
        self.reset_engine()
        self._control_step = 0
        self._forces = self.anatomy.no_forces()
        self._energies = self.anatomy.energy_meter.opened()
        self._tension_N = np.zeros(self.n_muscles)
        self._touch = Touch.none(self.n_segments)
        self._posture = self.locate()
        self._watch = self._new_watch()
        self._elastic_at_start_J, self._potential_at_start_J = self.elastic_energy_J(), self.potential_energy_J()
        return self.observe()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step.

        Args:
            activation: Muscle activation in [0, 1], shape ``(n_muscles,)``.

        Returns:
            What the body feels at the end of the step.

        Raises:
            SimulationStopped: The engine gave up on the step.
        """
        return self.stride(activation, 1)

    def steps_to_move(self) -> int:
        """Number of control steps up to and with the next one in which the body moves, at least 1."""
        every = self._ratio.control_steps_per_move
        return every - self._control_step % every

    def stride(self, activation: Array, n_steps: int) -> Sensation:
        """Advances by several control steps, of which at most the last one moves the body.

        Args:
            activation: Muscle activation in the last of them, in [0, 1], shape ``(n_muscles,)``.
            n_steps: How many, from 1 to `steps_to_move`.

        Returns:
            What the body feels at their end.

        Raises:
            SimulationStopped: The engine gave up on the step.
        """
        due = self.moves_due(n_steps)
        return self.strode(n_steps, self.move(activation, due) if due else None)

    def moves_due(self, n_steps: int) -> int:
        """Number of physics steps at the end of the next ``n_steps`` control steps, at most `steps_to_move` of them."""
        return self._ratio.physics_steps_due(self._control_step + n_steps)

    def control(self, activation: Array, n_steps: int) -> Array:
        """Tells what the engine's actuators get during the next physics steps under an activation, ``(n_muscles,)``."""
        self._activation = activation
        time_s = n_steps * self._config.clock.physics_timestep_s
        return self.anatomy.control(activation, self.actuator_state(), self._posture.ring_length, time_s)

    def strode(self, n_steps: int, moved: Movement | None) -> Sensation:
        """Takes note of control steps, whoever has moved the body.

        Args:
            n_steps: How many.
            moved: What the body has come to, or None if it has not moved.

        Returns:
            What the body feels at their end.
        """
        due = self.moves_due(n_steps)
        self._control_step += n_steps
        if moved is not None:
            before, (self._posture, self._forces, ground) = self._posture, moved
            self._touch = self.anatomy.skin.touch(
                self._touch,
                ground,
                before.skin,
                self._posture.skin,
                self._posture.axis,
                due * self._config.clock.physics_timestep_s,
            )
        return self.observe()

    def observe(self) -> Sensation:
        """Tells the present lengths and forces, in arrays that nobody writes to again."""
        posture, forces = self._posture, self._forces
        return Sensation(
            time_s=self._control_step * self._config.clock.control_timestep_s,
            stretch_m=posture.stretch,
            rest_stretch_m=self.anatomy.rest_stretch_m,
            ring_length_m=posture.ring_length,
            muscle_force_N=self._tension_N,
            contact_force_N=forces.contact,
            center_of_mass_m=posture.center_of_mass,
            touch_N=self._touch.normal,
            front_m=posture.front,
            heading=posture.heading,
        )

    def alarm(self) -> str | None:
        """Tells whether the engine has warned, or a quantity exceeds its guard.

        Returns:
            One sentence naming the quantity, its value and its limit, or None.
        """
        warned = self.warnings()
        if warned.any():
            for warning, words in ENGINE_WARNINGS.items():
                if warned[warning]:
                    return f"{words}; a shorter clock.physics_timestep_s or softer settings may help"
        guard = self._config.guard
        strain, gap = float(self._forces.edge_strain), float(self._forces.pin_gap)
        height = energy = 0.0
        due = self._control_step % (ALARM_EVERY * self._ratio.control_steps_per_move) == 0
        if due:
            energy = self.kinetic_energy_J()
        if due or isinstance(self._surface, Plane):
            with np.errstate(invalid="ignore", over="ignore"):
                distance, _ = self._surface.nearest(self._posture.crossing, first_order=True)
                height = float(np.abs(distance).max())
        if (
            height <= guard.height_m
            and strain <= guard.edge_strain
            and gap <= guard.pin_gap_m
            and energy <= guard.kinetic_energy_J
        ):
            return self._watch.look(
                self._control_step * self._config.clock.control_timestep_s,
                self._posture.ring_length,
                self._posture.spring_length,
                self._depth_m(),
                gap,
                self._activation,
                self._tension_N,
            )
        readings = (
            ("guard.height_m", self._height_words, height, guard.height_m, " m"),
            ("guard.edge_strain", "edge strain of a rod", strain, guard.edge_strain, ""),
            ("guard.pin_gap_m", "gap at a pin", gap, guard.pin_gap_m, " m"),
            ("guard.kinetic_energy_J", "kinetic energy", energy, guard.kinetic_energy_J, " J"),
        )
        for field, words, value, limit, unit in readings:
            if not value <= limit:
                return f"{words} is {value:.3g}{unit}, above the limit {field} = {limit:g}"
        return None

    def _depth_m(self) -> float:
        """Depth of the deepest vertex in the ground, m; over moving planes that at the start of the last step."""
        if self.ground is not None:
            return self.ground.depth_m
        return self._floor.offset_m - float(np.minimum.reduce(self._posture.skin @ self._floor.facing))

    def doubts(self) -> tuple[str, ...]:
        """Tells what is doubtful about the configuration, and about what has happened since time zero."""
        time_s = self._control_step * self._config.clock.control_timestep_s
        return *map(str, check(self._config)), *self._watch.warnings(time_s, self._energies_by_cause())

    def _energies_by_cause(self) -> Energies:
        """Tells what has driven the worm and what the integrator took of it; nothing where they do not add up."""
        # The engine tells the forces of the last of RK4's four stages only.
        if self.model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_RK4):
            return Energies(0.0, 0.0)
        work = float(self._energies.muscle_work.sum())
        lost = float(self._energies.damping_loss + self._energies.constraint_loss)
        # A worm that slides down is driven by its weight as well.
        sunk = self._potential_at_start_J - self.potential_energy_J()
        held = self.elastic_energy_J() - self._elastic_at_start_J + self.kinetic_energy_J()
        return Energies(work + max(0.0, sunk), work + sunk - held - lost)

    def recordable(self) -> Recordable:
        """Names the signals of the body, and gives its mass and length as attributes."""
        anatomy = self.anatomy
        return Recordable(
            signals=worm_signals(anatomy),
            coords={"muscle": anatomy.muscle_names, "axis": AXES, "side": SIDES},
            attrs={"total_mass_kg": self.total_mass_kg, "body_length_m": self.geometry.length_m},
        )

    def read(self, frame: bool) -> Mapping[str, NDArray[np.generic] | float]:
        """Reads the present values of the frame signals, or of all others."""
        posture, forces, touch = self._posture, self._forces, self._touch
        if frame:
            return {"crossing_position": posture.crossing, "qpos": self.qpos()}
        values: dict[str, NDArray[np.generic] | float] = {
            "stretch_length": posture.stretch,
            "spring_length": posture.spring_length,
            "ring_length": posture.ring_length,
            "muscle_force": self._tension_N,
            "contact_force": forces.contact,
            "touch": touch.normal,
            "contact_count": touch.count,
            "slip_speed": touch.slip_speed,
            "slip_distance": touch.slip_distance,
            "slip_loss": touch.slip_loss,
            "center_of_mass": posture.center_of_mass,
            "kinetic_energy": self.kinetic_energy_J(),
            "elastic_energy": self.elastic_energy_J(),
            "potential_energy": self.potential_energy_J(),
            **asdict(self._energies),
        }
        if self.anatomy.has_edges:
            values["edge_strain"] = forces.edge_strain
        if self.anatomy.pins_can_part:
            values["pin_gap"] = forces.pin_gap
        return values

    def get_state(self) -> State:
        """Returns the engine's whole state and what was sensed last."""
        forces = self._forces
        return {
            "engine": self.engine_state(),
            "control_step": np.array([self._control_step]),
            "muscle_force": self._tension_N.copy(),
            "contact_force": forces.contact.copy(),
            "extremes": np.array([forces.edge_strain, forces.pin_gap]),
            **asdict(self._energies),
            **self._touch.state(),
            **self._watch.get_state(),
        }

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned; the run then continues bit for bit on the same machine."""
        self.reset_engine(np.asarray(state["engine"], dtype=float))
        self._control_step = int(state["control_step"][0])
        strain, gap = np.asarray(state["extremes"], dtype=float)
        self._tension_N = np.array(state["muscle_force"], dtype=float)
        self._forces = Forces(np.array(state["contact_force"], dtype=float), strain, gap)
        self._energies = EnergyTotals(*(np.array(state[field.name], dtype=float) for field in fields(EnergyTotals)))
        self._touch = Touch.of_state(state)
        self._watch.set_state(state)
        self._posture = self.locate()


class WormPlant(Worm):
    """The 3D worm in its arena, with an engine of its own."""

    def __init__(self, config: RunConfig) -> None:
        """Builds and compiles the body.

        Args:
            config: The run's configuration.

        Raises:
            ConfigError: The body is planar, or the engine refuses the model.
        """
        super().__init__(config, compile_worm(config))
        self.data = mujoco.MjData(self.model)
        data = self.data
        self._outputs: dict[str, Array] = {name: getattr(data, name) for name in self.anatomy.outputs}
        self._work: dict[str, NDArray[Any]] = {name: getattr(data, name) for name in self.anatomy.energy_meter.outputs}

    def reset_engine(self, state: Array | None = None) -> None:
        """Resets the engine, and gives it a state that `engine_state` returned if there is one."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.act[:] = self.anatomy.first_act
        if self.start is not None:
            self.data.qpos[:], self.data.plastic[:] = self.start
        if state is not None:
            mujoco.mj_setState(self.model, self.data, state, STATE_PARTS)

    def move(self, activation: Array, n_steps: int) -> Movement:
        """Takes physics steps under an activation, ``(n_muscles,)``.

        Raises:
            SimulationStopped: The engine gave up.
        """
        data = self.data
        data.ctrl[:] = self.control(activation, n_steps)
        try:
            for _ in range(n_steps):
                if self.ground is not None:
                    self.ground.lay(data)
                if self.damping is not None:
                    self.damping.renew(data.qpos)
                drive = self.drive(activation, data.act)
                mujoco.mj_step(self.model, data)
                self.book(self._work, drive)
        except mujoco.FatalError as error:
            raise SimulationStopped(engine_stopped(self.data.time, error)) from None
        # Pin gaps are read before `locate` brings positions up to the end of the step.
        forces, ground = self.anatomy.forces(self._outputs), self.anatomy.ground(self._outputs)
        return Movement(self.locate(), forces, ground)

    def push(self, force_N: Array) -> None:
        """Lets outside forces act on the crossings from the next step on; the energy totals know nothing of their work.

        Args:
            force_N: In the model's axes, N, ``(n_crossings, 3)``; zeros end it.
        """
        self.data.xfrc_applied[self.anatomy.crossing_body, :3] = force_N

    def actuator_state(self) -> Array:
        """Returns the engine's actuator states, ``(n_states,)``."""
        return self.data.act

    def locate(self) -> Posture:
        """Reads the posture from the engine's coordinates."""
        return self.anatomy.posture(*self.anatomy.locate(self.data))

    def qpos(self) -> Array:
        """Returns the generalised positions, ``(nq,)``."""
        return self.data.qpos

    def plastic(self) -> Array:
        """Returns what the engine keeps of the rods' frames, ``(nplastic,)``."""
        return self.data.plastic

    def engine_state(self) -> Array:
        """Returns a copy of all that the engine's next step depends on."""
        state = np.empty(mujoco.mj_stateSize(self.model, STATE_PARTS))
        mujoco.mj_getState(self.model, self.data, state, STATE_PARTS)
        return state

    def warnings(self) -> NDArray[np.int32]:
        """Returns how often the engine has given each of its warnings."""
        return self.data.warning.number

    def kinetic_energy_J(self) -> float:
        """Kinetic energy of the whole body, J (the chain's includes its numerical joint inertia)."""
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy[1])

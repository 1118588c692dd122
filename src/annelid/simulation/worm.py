"""The 3D worm as a Plant: MuJoCo steps the body, annelid reads what it senses."""

from __future__ import annotations

from operator import attrgetter
from typing import Any, cast

import mujoco
import numpy as np

from annelid.arena.ground import surface_of
from annelid.arena.surface import Plane
from annelid.body import build_spec, compile_spec
from annelid.body.constraint_rows import tendons_to_rows
from annelid.body.mechanics import NO_GAP
from annelid.body.worm import WormBody, worm_of
from annelid.clock import SLACK_S, StepRatio
from annelid.config import ArenaKind, RunConfig
from annelid.config.answers import Walls
from annelid.errors import RunFileError, SimulationStopped
from annelid.morphology import Array
from annelid.plausibility import check, refuse_nonsense
from annelid.protocols import SIDES, Recordable, Sensation, Signal, State, Values
from annelid.simulation.anatomy import Anatomy, Posture, add_contact_sensors, start_placement
from annelid.simulation.energies import EnergyTotals, Powers, work_in_step
from annelid.simulation.ground import MovingGround
from annelid.simulation.guards import Energies, Watch
from annelid.simulation.scene_objects import NO_ENCOUNTER
from annelid.simulation.skin import Touch

STATE_PARTS = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""All that the engine's next step depends on: positions, velocities, activations, warm start."""
MOST_GAP_M = 0.15
"""Gap at a pin at which a run is stopped; soft crossings part by up to 4 cm in a healthy one."""
ENGINE_WARNINGS = {
    mujoco.mjtWarning.mjWARN_INERTIA: "the engine's implicit solve did not converge",
    mujoco.mjtWarning.mjWARN_CONTACTFULL: "the engine ran out of room for contacts",
    mujoco.mjtWarning.mjWARN_CNSTRFULL: "the engine ran out of room for constraints",
    mujoco.mjtWarning.mjWARN_BADQPOS: "a position became unbounded or NaN",
    mujoco.mjtWarning.mjWARN_BADQVEL: "a velocity became unbounded or NaN",
    mujoco.mjtWarning.mjWARN_BADQACC: "an acceleration became unbounded or NaN",
}
ALARM_EVERY = 10
"""Movements of the body between two looks at what is costly to read: kinetic energy, and the height above a relief."""


_FORCE = "contractile force of a ring muscle over the last physics step; with RK4 that of its last stage"
_SIGNALS = {
    "stretch_length": ("posture.stretch", ("segment", "sensor"), "m", "length of the springs that span a ring"),
    "spring_length": ("posture.spring_length", ("spring",), "m", "length of an axial spring"),
    "ring_length": ("posture.ring_length", ("muscle",), "m", "length of a ring muscle"),
    "muscle_force": ("_tension_N", ("muscle",), "N", _FORCE),
    "contact_force": ("_contact_N", ("segment", "axis"), "N", "force of the arena on a segment"),
    "touch": ("touch.normal", ("segment", "side"), "N", "normal force of the ground on a side"),
    "contact_count": ("touch.count", ("segment",), "1", "number of vertices that touch the ground"),
    "slip_speed": ("touch.slip_speed", ("segment",), "m/s", "forward speed along the ground of what touches it"),
    "slip_distance": ("touch.slip_distance", ("segment",), "m", "path that what touches the ground has slid so far"),
    "slip_loss": ("touch.slip_loss", ("segment",), "J", "work of a segment lost to friction so far"),
    "center_of_mass": ("posture.center_of_mass", ("axis",), "m", "centre of mass in world axes"),
    "kinetic_energy": ("kinetic_energy_J", (), "J", "kinetic energy"),
    "elastic_energy": ("elastic_energy_J", (), "J", "energy of strands and springs"),
    "potential_energy": ("potential_energy_J", (), "J", "energy of the weight"),
    "muscle_work": ("energies.muscle_work", ("muscle",), "J", "net work done by a ring muscle so far"),
    "positive_work": (
        "energies.positive_work",
        ("muscle",),
        "J",
        "positive work of a ring muscle so far, none regained",
    ),
    "damping_loss": ("energies.damping_loss", (), "J", "energy lost to dampers so far"),
    "constraint_loss": (
        "energies.constraint_loss",
        (),
        "J",
        "energy taken by contacts, friction, inextensible edges and pushes from outside so far",
    ),
    "object_position": ("posture.objects", ("object", "axis"), "m", "centre of mass of a body that moves in the scene"),
    "object_force": ("_encounter.force", ("object", "axis"), "N", "force of the worm on a body that moves"),
    "edge_strain": ("_edge_strain", (), "1", "largest strain of a rod's edge"),
    "pin_gap": ("_pin_gap_m", (), "m", "largest gap between two pinned strands"),
}
"""What is recorded: where a worm has it, its dimensions, its unit and what it is."""
_FRAME_SIGNALS = {
    "crossing_position": ("posture.crossing", ("crossing", "axis"), "m", "position of a crossing"),
    "qpos": ("coordinates", ("coordinate",), "1", "generalised position"),
}


def body_and_arena(config: RunConfig) -> tuple[WormBody, ArenaKind]:
    """Returns body and arena of a configuration that is of a 3D worm."""
    body = worm_of(config)
    assert config.arena is not None
    return body, config.arena


def compile_worm(config: RunConfig) -> Anatomy:
    """Builds and compiles a worm in its arena.

    Raises:
        ConfigError: The body is planar, its numbers can mean nothing, or the engine refuses the model.
    """
    refuse_nonsense(config)
    spec = build_spec(config, for_plant=True)
    body, arena = body_and_arena(config)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    add_contact_sensors(spec, arena)
    tendons_to_rows(spec)
    return Anatomy(compile_spec(spec), body, arena)


class WormPlant:
    """The 3D worm in its arena: what it senses, records and is alarmed by, with an engine of its own.

    Lengths and positions are those at the end of the step; forces are those that acted during the last physics step,
    since the engine computes them before it moves the body. Edge strains and gaps of pins are those at the end of a
    step.

    Attributes:
        anatomy: The compiled body, of this worm alone: some worms set numbers in the model as they move.
        model: The compiled body in the engine.
        data: The engine's data.
        geometry: The mesh.
        n_segments: Number of actuated segments.
        n_muscles: Number of ring muscles.
        total_mass_kg: Mass of strands and pins.
        start: Where it starts.
        posture: Where the body is.
        mechanics: What steps it.
        touch: What the skin senses of the ground, and how far it has slid.
        energies: What the muscles have done so far, and where it went.
    """

    def __init__(self, config: RunConfig, anatomy: Anatomy | None = None) -> None:
        """Builds and compiles the body, unless it is compiled already; raises as `compile_worm`."""
        self.anatomy = anatomy = anatomy or compile_worm(config)
        self.model, self.geometry = anatomy.model, anatomy.geometry
        self.n_segments, self.n_muscles = anatomy.n_segments, anatomy.n_muscles
        self.total_mass_kg = anatomy.total_mass_kg
        self._config = config
        body, arena = body_and_arena(config)
        self._body = body
        self._surface = surface_of(arena)
        self._has_cheap_surface = arena.is_plane and arena.walls == Walls()
        self._is_scene = arena.is_scene
        self._height_words = (
            "distance of a crossing from the pipe's wall" if arena.is_closed else "height of a crossing"
        )
        # What needs no moving planes is level.
        self._floor = cast(Plane, arena.ground())
        self._ratio = StepRatio(config.clock.control_timestep_s, config.clock.physics_timestep_s)
        self._step_s = config.clock.physics_timestep_s
        # Otherwise a command lasts for several steps of the body.
        self._acts_by_command = self._step_s > config.clock.control_timestep_s - SLACK_S
        self._activation: Array = np.zeros(anatomy.n_muscles)
        data = self.data = mujoco.MjData(self.model)
        self.qpos, self.act, self.ctrl, self.warned = data.qpos, data.act, data.ctrl, data.warning.number
        self.start = start_placement(anatomy, body)
        self.mechanics = body.formulation.mechanics(self.model, data, body, arena, self._step_s)
        self.ground = MovingGround(self.model, self.geometry, arena) if arena.has_moving_planes else None
        self.reset(0)

    @property
    def coordinates(self) -> Array:
        """The engine's positions, ``(nq,)``, in the order that a written model has."""
        return self.anatomy.written(self.qpos)

    @property
    def _time_s(self) -> float:
        return self._control_step * self._config.clock.control_timestep_s

    def kinetic_energy_J(self) -> float:
        """Kinetic energy of the whole body and of what moves in a scene, J.

        A chain's includes its numerical joint inertia.
        """
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy[1])

    def elastic_energy_J(self) -> float:
        """Energy that strands, joints and springs store, J."""
        energy = self.anatomy.elasticity.energy_J(self.qpos, self.posture.spring_length)
        for part in self.mechanics.energies_J():
            energy += part
        return energy

    def potential_energy_J(self) -> float:
        """Energy of the weight, also of what moves in a scene, J; zero with the centres of mass at the origin."""
        own = -self.total_mass_kg * float(self.model.opt.gravity @ self.posture.center_of_mass)
        return own + self.anatomy.objects.potential_energy_J(self.posture.objects)

    def move(self, activation: Array, n_steps: int) -> None:
        """Takes physics steps under an activation, ``(n_muscles,)``; `SimulationStopped` where the engine gives up."""
        self._move(activation, n_steps, acts=True)

    def _act(self, commands: Array, time_s: float) -> None:
        """Lets the actuators follow commands, ``(n_commands, n_muscles)``, each for a time, s."""
        lengths = self.posture.ring_length
        self.act[:] = self.anatomy.rings.states_after(self.model, commands, self.act, lengths, time_s)

    def _move(self, activation: Array, n_steps: int, *, acts: bool) -> None:
        """As `move`, with actuators that have followed their commands unless they are to do it now."""
        rings = self.anatomy.rings
        skin_before = self.posture.skin
        self._activation = activation
        try:
            for _ in range(n_steps):
                # What the actuators have come to at the end of a step acts in it.
                if acts:
                    self._act(activation[np.newaxis], self._step_s)
                self.ctrl[:] = rings.control(activation, self.act)
                self._take_step(rings.drive(activation, self.act))
        except mujoco.FatalError as error:
            raise SimulationStopped(f"the engine stopped at {self.data.time:.3f} s: {error}") from None
        self._contact_N, ground_N = self.anatomy.contacts(self.data)
        self._encounter, self._rate = self.anatomy.objects.read(self.data), None
        self._edge_strain, self._pin_gap_m = self._gaps()
        normals = self._encounter.normal if self._is_scene else None
        skin, axis, time_s = self.posture.skin, self.posture.axis, n_steps * self._step_s
        self.touch = self.anatomy.skin.touch(self.touch, ground_N, skin_before, skin, axis, time_s, normals)

    def _take_step(self, drive: Array) -> None:
        """Takes one physics step, with what the actuators' gain is multiplied by, and adds it to the energy totals."""
        self.mechanics.step(self._prepare)
        powers = self.anatomy.energy_meter.read(self.data, drive, self.mechanics.losses_W())
        before, self.posture = self.posture, self._locate()
        shortening = before.ring_length - self.posture.ring_length
        self.energies = self.energies.plus(work_in_step(self._step_s, shortening, self._powers, powers))
        self._powers = powers
        pushed_N = self.data.xfrc_applied[self.anatomy.crossing_body, :3]
        if pushed_N.any():
            against = -float((pushed_N * (self.posture.crossing - before.crossing)).sum())
            self.energies = self.energies._replace(constraint_loss=self.energies.constraint_loss + against)

    def _prepare(self) -> None:
        """Lays the ground under the skin where the engine has it now."""
        if self.ground is not None:
            self.ground.lay(self.data, self.mechanics.ahead_s)

    def push(self, force_N: Array) -> None:
        """Lets outside forces, N, ``(n_crossings, 3)``, act on the crossings from the next step on; zeros end it.

        They are in the model's axes. What is done against them counts as taken by constraints.
        """
        self.data.xfrc_applied[self.anatomy.crossing_body, :3] = force_N

    def _gaps(self) -> tuple[Array, Array]:
        """Largest strain of an edge and largest gap at a pin, m, ``()``; 0 where there are none."""
        strain, gap = self.mechanics.edge_strain(), self.mechanics.pin_gap_m()
        return NO_GAP if strain is None else strain, NO_GAP if gap is None else gap

    @property
    def _tension_N(self) -> Array:
        return self._powers.tension

    def reset(self, seed: int) -> Sensation:
        """Returns to the rest posture at time zero; nothing in the body is random, so ``seed`` changes nothing."""
        n = self.n_segments
        mujoco.mj_resetData(self.model, self.data)
        self.act[:] = self.anatomy.first_act
        self.qpos[:] = self.start.qpos
        self.mechanics.place(self.start.turn)
        self._control_step = 0
        self._encounter = NO_ENCOUNTER._replace(force=np.zeros((len(self.anatomy.objects.names), 3)))
        self._contact_N, self._edge_strain, self._pin_gap_m = np.zeros((n, 3)), NO_GAP, NO_GAP
        self.energies = EnergyTotals.zero(self.n_muscles)
        self._powers = Powers.none(self.n_muscles)
        self.touch = Touch.none(n)
        self.posture, self._rate = self._locate(), None
        self._watch = Watch(self._body, self.geometry, self._config.guard)
        self._elastic_at_start_J, self._potential_at_start_J = self.elastic_energy_J(), self.potential_energy_J()
        return self.observe()

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step under an activation in [0, 1], ``(n_muscles,)``; returns what the body senses.

        Raises:
            SimulationStopped: The engine gave up on the step.
        """
        return self.stride(activation[np.newaxis])

    def steps_to_move(self) -> int:
        """Number of control steps up to and with the next one in which the body moves, at least 1."""
        every = self._ratio.control_steps_per_move
        return every - self._control_step % every

    def stride(self, activation: Array) -> Sensation:
        """Advances by 1 to `steps_to_move` control steps, of which at most the last one moves the body, as `step`.

        Given is the activation of every step, ``(n_steps, n_muscles)``.
        """
        after = self._control_step + len(activation)
        if self._acts_by_command:
            self._act(activation, self._config.clock.control_timestep_s)
        if due := self._ratio.physics_steps_due(after):
            self._move(activation[-1], due, acts=not self._acts_by_command)
        self._control_step = after
        return self.observe()

    def observe(self) -> Sensation:
        """Returns the present lengths and forces, in arrays that nobody writes to again."""
        posture, rate = self.posture, self._stretch_rate
        since = self._control_step % self._ratio.control_steps_per_move
        carried = since * self._config.clock.control_timestep_s
        return Sensation(
            time_s=self._time_s,
            stretch_m=posture.stretch + carried * rate if since else posture.stretch,
            rest_stretch_m=self.anatomy.rest_stretch_m,
            ring_length_m=posture.ring_length,
            muscle_force_N=self._tension_N,
            contact_force_N=self._contact_N,
            center_of_mass_m=posture.center_of_mass,
            touch_N=self.touch.normal,
            front_m=posture.front,
            heading=posture.heading,
            stretch_rate_m_per_s=rate,
        )

    @property
    def _stretch_rate(self) -> Array:
        """Rates of the stretch sensors since the last movement, m/s."""
        if self._rate is None:
            self._rate = self.anatomy.stretch_rate(self.posture, self.data.qvel)
        return self._rate

    def alarm(self) -> str | None:
        """Returns a sentence where the engine has warned or a quantity exceeds its guard, else None."""
        if self.warned.any():
            for warning, words in ENGINE_WARNINGS.items():
                if self.warned[warning]:
                    return f"{words}; a shorter clock.physics_timestep_s or softer settings may help"
        guard, posture = self._config.guard, self.posture
        strain, gap = float(self._edge_strain), float(self._pin_gap_m)
        height = energy = 0.0
        due = self._control_step % (ALARM_EVERY * self._ratio.control_steps_per_move) == 0
        if due:
            energy = self.kinetic_energy_J()
        if due or self._has_cheap_surface:
            with np.errstate(invalid="ignore", over="ignore"):
                distance, _ = self._surface.nearest(posture.crossing, first_order=True)
                height = float(np.abs(distance).max())
        for field, words, value, limit, unit in (
            ("guard.height_m", self._height_words, height, guard.height_m, " m"),
            ("guard.edge_strain", "edge strain of a rod", strain, guard.edge_strain, ""),
            ("of the gap", "gap between the pinned strands of a crossing", gap, MOST_GAP_M, " m"),
            ("guard.kinetic_energy_J", "kinetic energy", energy, guard.kinetic_energy_J, " J"),
        ):
            # Written so that NaN fails it.
            if not value <= limit:
                return f"{words} is {value:.3g}{unit}, above the limit {field} = {limit:g}"
        rings, springs = posture.ring_length, posture.spring_length
        return self._watch.look(self._time_s, rings, springs, self._depth_m(), gap, self._activation, self._tension_N)

    def _depth_m(self) -> float:
        """Depth of the deepest vertex in the ground, m; over moving planes, or in a scene, that in the last step."""
        if self._is_scene:
            return float(self._encounter.depth)
        if self.ground is not None:
            return self.ground.depth_m
        return self._floor.offset_m - float(np.minimum.reduce(self.posture.skin @ self._floor.facing))

    def doubts(self) -> tuple[str, ...]:
        """Returns what is doubtful about the configuration, and about what has happened since time zero."""
        return *map(str, check(self._config)), *self._watch.warnings(self._time_s, self._energies_by_cause())

    def _energies_by_cause(self) -> Energies:
        """What has driven the worm and what the integrator took of it; nothing where they do not add up."""
        # The engine gives the forces of the last of RK4's four stages only.
        if self.model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_RK4):
            return Energies(0.0, 0.0)
        work = float(self.energies.muscle_work.sum())
        lost = float(self.energies.damping_loss + self.energies.constraint_loss)
        # A worm that slides down is driven by its weight as well.
        sunk = self._potential_at_start_J - self.potential_energy_J()
        held = self.elastic_energy_J() - self._elastic_at_start_J + self.kinetic_energy_J()
        return Energies(work + max(0.0, sunk), work + sunk - held - lost)

    def recordable(self) -> Recordable:
        """Names the signals of the body, and gives its mass and length as attributes."""
        anatomy = self.anatomy
        objects = anatomy.objects.names
        present = {
            "edge_strain": self.mechanics.edge_strain() is not None,
            "pin_gap": self.mechanics.pin_gap_m() is not None,
        }
        signals = (
            Signal(name, dims, np.shape(self._value(path)), units, words, name in _FRAME_SIGNALS)
            for name, (path, dims, units, words) in (_SIGNALS | _FRAME_SIGNALS).items()
            if present.get(name, True) and ("object" not in dims or objects)
        )
        coords = {"muscle": anatomy.muscle_names, "axis": ("x", "y", "z"), "side": SIDES}
        coords |= {"object": objects} if objects else {}
        attrs = {"total_mass_kg": self.total_mass_kg, "body_length_m": self.geometry.length_m}
        return Recordable(tuple(signals), coords, attrs)

    def read(self, frame: bool) -> Values:
        """Reads the present values of the frame signals, or of all others."""
        return {name: self._value(path) for name, (path, *_) in (_FRAME_SIGNALS if frame else _SIGNALS).items()}

    def _value(self, path: str) -> Any:
        value = attrgetter(path)(self)
        return value() if callable(value) else value

    def get_state(self) -> State:
        """Returns the engine's whole state and what was sensed last."""
        engine = np.empty(mujoco.mj_stateSize(self.model, STATE_PARTS))
        mujoco.mj_getState(self.model, self.data, engine, STATE_PARTS)
        return {
            "engine": engine,
            "control_step": np.array([self._control_step]),
            "muscle_force": self._powers.tension.copy(),
            "powers": np.array([self._powers.damping, self._powers.constraint]),
            "contact_force": self._contact_N.copy(),
            "extremes": np.array([self._edge_strain, self._pin_gap_m]),
            **{name: np.array(total) for name, total in self.energies._asdict().items()},
            **({"object_force": self._encounter.force.copy()} if self._is_scene else {}),
            **({"body_order": self.anatomy.body_order} if self.anatomy.body_order.size else {}),
            **self.mechanics.get_state(),
            **self.touch.state(),
            **self._watch.get_state(),
        }

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned; the run then continues bit for bit on the same machine.

        Raises:
            RunFileError: The state is of a version of annelid that orders the bodies otherwise.
        """
        if not np.array_equal(state.get("body_order", ()), self.anatomy.body_order):
            raise RunFileError("another version of annelid wrote it, which orders the worm's bodies otherwise")
        mujoco.mj_setState(self.model, self.data, np.asarray(state["engine"], dtype=float), STATE_PARTS)
        self.mechanics.set_state(state)
        self._control_step = int(state["control_step"][0])
        self._edge_strain, self._pin_gap_m = np.asarray(state["extremes"], dtype=float)
        self._powers = Powers(np.array(state["muscle_force"], dtype=float), *np.asarray(state["powers"]).tolist())
        self._encounter = NO_ENCOUNTER
        if self._is_scene:
            self._encounter = NO_ENCOUNTER._replace(force=np.array(state["object_force"], dtype=float))
        self._contact_N = np.array(state["contact_force"], dtype=float)
        self.energies = EnergyTotals(*(np.array(state[name], dtype=float) for name in EnergyTotals._fields))
        self.touch = Touch.of_state(state)
        self._watch.set_state(state)
        self.posture, self._rate = self._locate(), None

    def _locate(self) -> Posture:
        return self.anatomy.posture(*self.anatomy.locate(self.data))

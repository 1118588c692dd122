"""A robot of one's own as a Plant: the engine steps the model of an MJCF file, driven and sensed by the names in it."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from annelid.body import compile_robot
from annelid.clock import StepRatio
from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.protocols import Array, Recordable, SavedAndRecorded, Sensation, Signal, State, Values
from annelid.simulation import ENGINE_WARNINGS, STATE_PARTS
from annelid_lab.robots.body import MjcfBody

_AFFINE, _MUSCLE = int(mujoco.mjtBias.mjBIAS_AFFINE), int(mujoco.mjtGain.mjGAIN_MUSCLE)
_INTEGRATOR = int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_TENDON, _SITE = int(mujoco.mjtTrn.mjTRN_TENDON), int(mujoco.mjtTrn.mjTRN_SITE)
_JOINTS = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_WRAPPED = (("xanchor", int(mujoco.mjtWrap.mjWRAP_JOINT)), ("site_xpos", int(mujoco.mjtWrap.mjWRAP_SITE)))
"""The engine's arrays of the places that tendons go through, and its numbers for them."""


class MjcfPlant(SavedAndRecorded):
    """A robot whose rings are the actuators of its segments, each between a command at rest and a contracted one.

    Activation goes linearly from one to the other: a position is long at rest and short when contracted, a force is 0
    at rest and pulls as hard as its range allows when contracted. All that moves is the robot. A ring is where its
    actuator's tendon, joint or sites are, and a part belongs to the segment whose ring is nearest at the start.

    Raises:
        ConfigError: The engine refuses the model, or an actuator cannot be a ring.
    """

    recorded = (
        ("stretch_length", ("segment", "sensor"), "m", "length of a stretch sensor"),
        ("ring_length", ("muscle",), "m", "length of a ring's actuator"),
        ("muscle_force", ("muscle",), "N", "contractile force of a ring's actuator over the last physics step"),
        ("contact_force", ("segment", "axis"), "N", "force of what is at rest on a segment over the last physics step"),
        ("center_of_mass", ("axis",), "m", "centre of mass of all that moves"),
        ("kinetic_energy", (), "J", "kinetic energy"),
    )

    def __init__(self, body: MjcfBody, config: RunConfig) -> None:
        """Builds the robot in the posture that its file describes."""
        model = compile_robot(config)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self.model, self.data = model, mujoco.MjData(model)
        self.n_segments, self.n_muscles = body.n_segments, body.n_segments * len(body.actuators)
        self._config = config
        self._ratio = StepRatio(config.clock.control_timestep_s, config.clock.physics_timestep_s)
        self._names = list(body.own_model.actuators)
        self._actuators = np.array([model.actuator(name).id for name in self._names])
        self._sensors = [[self._reading(name) for name in names] for names in body.sensor_names]
        commands = np.array([self._commands(actuator) for actuator in self._actuators.tolist()])
        self._rest, self._contracted = commands[:, 0], commands[:, 1]
        self._units = self._angles()
        self._places = [place for one in self._actuators.tolist() if (place := self._joints_or_sites(one)) is not None]
        self._gear = model.actuator_gear[self._actuators, 0]
        self._moves = model.body_weldid > 0
        self.total_mass_kg = float(model.body_mass[self._moves].sum())
        if not self.total_mass_kg > 0:
            raise ConfigError("nothing of the robot moves: its bodies need joints and masses")
        self.reset(0)
        rings = self._ring_centres()
        distance = np.linalg.norm(self.data.xipos[:, None] - rings[None], axis=2)
        self._segment_of_body = np.argmin(distance, axis=1)
        self._first_height_m = rings[:, 2].copy()
        self.length_m = float(np.ptp(self.data.xipos[self._moves] @ self._sensed.heading))

    def reset(self, seed: int) -> Sensation:
        """Returns to the posture of the file at time zero; nothing here is random."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.ctrl[self._actuators] = self._rest
        for actuator, rest in zip(self._actuators.tolist(), self._rest.tolist(), strict=True):
            # A filter begins where its command is, a muscle relaxed, what integrates a speed at the file's posture.
            if self.model.actuator_actnum[actuator] == 1 and self.model.actuator_dyntype[actuator] != _INTEGRATOR:
                self.data.act[self.model.actuator_actadr[actuator]] = rest
        self._now: dict[str, Any] = {
            "engine": np.zeros(mujoco.mj_stateSize(self.model, STATE_PARTS)),
            "n_control_steps": np.array(0),
            "muscle_force": np.zeros(self.n_muscles),
            "contact_force": np.zeros((self.n_segments, 3)),
        }
        mujoco.mj_forward(self.model, self.data)
        self._rest_stretch_m = self._stretch()
        self._sensed = self._sense()
        return self._sensed

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step, as `annelid.Plant.step`.

        Raises:
            SimulationStopped: The engine gave up on the step.
        """
        model, data, now = self.model, self.data, self._now
        now["n_control_steps"] += 1
        data.ctrl[self._actuators] = self._rest + activation * (self._contracted - self._rest)
        due = self._ratio.physics_steps_due(int(now["n_control_steps"]))
        try:
            for _ in range(due):
                mujoco.mj_step(model, data)
        except mujoco.FatalError as error:
            raise SimulationStopped(f"the engine stopped at {data.time:.3f} s: {error}") from None
        if due:
            # Forces are those of the last step, lengths and places those after it.
            now["muscle_force"][:] = -data.actuator_force[self._actuators] * self._gear
            now["contact_force"][:] = self._contact_forces()
            self._place()
        else:
            self._sensed = replace(self._sensed, time_s=self._time_s)
        return self._sensed

    @property
    def _time_s(self) -> float:
        return int(self._now["n_control_steps"]) * self._ratio.control_timestep_s

    def _sense(self) -> Sensation:
        """Returns what the robot senses in the present posture, in arrays that nobody writes to again."""
        rings = self._ring_centres()
        axis = rings[0] - rings[-1]
        length_m = float(np.linalg.norm(axis))
        masses = self.model.body_mass[self._moves]
        return Sensation(
            time_s=self._time_s,
            stretch_m=self._stretch(),
            rest_stretch_m=self._rest_stretch_m,
            ring_length_m=self.data.actuator_length[self._actuators] / self._gear,
            muscle_force_N=self._now["muscle_force"].copy(),
            contact_force_N=self._now["contact_force"].copy(),
            center_of_mass_m=masses @ self.data.xipos[self._moves] / self.total_mass_kg,
            front_m=rings[0],
            heading=axis / length_m if length_m > 0 else np.full(3, np.nan),
        )

    def alarm(self) -> str | None:
        """Returns a sentence where the engine has warned or a quantity exceeds its guard, else None."""
        for warning, words in ENGINE_WARNINGS.items():
            if self.data.warning.number[warning]:
                return f"{words}; a shorter clock.physics_timestep_s or softer settings may help"
        guard = self._config.guard
        rise_m = float(np.abs(self._ring_centres()[:, 2] - self._first_height_m).max())
        for field, words, value, limit, unit in (
            ("guard.kinetic_energy_J", "kinetic energy", self._kinetic_energy_J(), guard.kinetic_energy_J, "J"),
            ("guard.height_m", "height of a ring over that at the start", rise_m, guard.height_m, "m"),
        ):
            # Written so that NaN fails it.
            if not value <= limit:
                return f"{words} is {value:.3g} {unit}, above the limit {field} = {limit:g} {unit}"
        return None

    def recordable(self) -> Recordable:
        """Names the signals, also the posture of every frame."""
        known = super().recordable()
        signals = [replace(one, units=self._units.get(one.name, one.units)) for one in known.signals]
        posture = Signal("qpos", ("coordinate",), (self.model.nq,), "1", "generalised position", True)
        return Recordable((*signals, posture), known.coords, known.attrs)

    def read(self, frame: bool) -> Values:
        """Reads the present values of the posture, or of all others."""
        return {"qpos": self.data.qpos.copy()} if frame else self._values()

    def get_state(self) -> State:
        """Returns the engine's whole state and the forces of its last step."""
        mujoco.mj_getState(self.model, self.data, self._now["engine"], STATE_PARTS)
        return super().get_state()

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        super().set_state(state)
        mujoco.mj_setState(self.model, self.data, self._now["engine"], STATE_PARTS)
        self._place()

    def _values(self) -> Values:
        sensed = self._sensed
        return {
            "stretch_length": sensed.stretch_m,
            "ring_length": sensed.ring_length_m,
            "muscle_force": sensed.muscle_force_N,
            "contact_force": sensed.contact_force_N,
            "center_of_mass": sensed.center_of_mass_m,
            "kinetic_energy": self._kinetic_energy_J(),
        }

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"muscle": self._names, "axis": ["x", "y", "z"]}

    def _attrs(self) -> dict[str, float | int | str]:
        return {"total_mass_kg": self.total_mass_kg, "body_length_m": self.length_m}

    def _place(self) -> None:
        """Brings places, lengths and what is sensed of them up to the present posture."""
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon, mujoco.mj_transmission):
            stage(self.model, self.data)
        mujoco.mj_sensorPos(self.model, self.data)
        self._sensed = self._sense()

    def _kinetic_energy_J(self) -> float:
        mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy[1])

    def _reading(self, name: str) -> tuple[str, int]:
        """Returns the engine's array and the place in it of a stretch sensor: a tendon, a sensor or a joint."""
        model = self.model
        if (tendon := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, name)) >= 0:
            return "ten_length", tendon
        if (sensor := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, name)) >= 0:
            return "sensordata", int(model.sensor_adr[sensor])
        joint = model.joint(name).id
        if mujoco.mjtJoint(model.jnt_type[joint]) not in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
            raise ConfigError(f"body.sensors: the joint {name!r} is neither a hinge nor a slide, so it has no length")
        return "qpos", int(model.jnt_qposadr[joint])

    def _stretch(self) -> Array:
        return np.array([[float(getattr(self.data, where)[place]) for where, place in row] for row in self._sensors])

    def _angles(self) -> dict[str, str]:
        """Returns the units of signals that hinges give, and says that tables take these for lengths."""
        model, hinge = self.model, int(mujoco.mjtJoint.mjJNT_HINGE)
        hinges = {("qpos", place) for place in model.jnt_qposadr[model.jnt_type == hinge].tolist()}
        is_of_joint = model.sensor_objtype == mujoco.mjtObj.mjOBJ_JOINT
        sensed = is_of_joint & (model.jnt_type[np.where(is_of_joint, model.sensor_objid, 0)] == hinge)
        hinges |= {("sensordata", place) for place in model.sensor_adr[sensed].tolist()}
        sensors = [sensor in hinges for row in self._sensors for sensor in row]
        driven = model.actuator_trnid[self._actuators, 0]
        is_joint = np.isin(model.actuator_trntype[self._actuators], _JOINTS)
        rings = is_joint & (model.jnt_type[np.where(is_joint, driven, 0)] == hinge)
        if any(sensors) or rings.any():
            warnings.warn(
                "sensors or actuators of this robot are angles: where a table says cm, read 0.01 rad, and N m for N",
                stacklevel=2,
            )
        units = {"stretch_length": "rad"} if all(sensors) else {}
        return units | ({"ring_length": "rad", "muscle_force": "N m"} if rings.all() else {})

    def _commands(self, actuator: int) -> tuple[float, float]:
        """Returns the commands of an actuator at rest and contracted."""
        model = self.model
        name, gear = model.actuator(actuator).name, float(model.actuator_gear[actuator, 0])
        low, high = model.actuator_ctrlrange[actuator].tolist()
        if not (model.actuator_ctrllimited[actuator] and low < high):
            raise ConfigError(
                f"the actuator {name!r} has no ctrlrange: annelid needs its commands at rest and contracted"
            )
        if gear == 0 or self._joints_or_sites(actuator) is None:
            raise ConfigError(f"the actuator {name!r} must drive a tendon, a joint or a site along its first gear")
        affine = model.actuator_biastype[actuator] == _AFFINE
        if affine and model.actuator_biasprm[actuator, 1] < 0:
            return (high, low) if gear > 0 else (low, high)
        pulls = gear < 0
        if model.actuator_gaintype[actuator] == _MUSCLE or model.actuator_gainprm[actuator, 0] < 0:
            pulls = not pulls
        rest, contracted = min(max(0.0, low), high), high if pulls else low
        if rest == contracted:
            raise ConfigError(
                f"the actuator {name!r} cannot pull: no command in its ctrlrange {low:g} .. {high:g} shortens anything"
            )
        return rest, contracted

    def _joints_or_sites(self, actuator: int) -> tuple[str, list[int]] | None:
        """Returns the engine's array of the places that an actuator acts at and which of them, None without any."""
        model = self.model
        kind, first, second = int(model.actuator_trntype[actuator]), *model.actuator_trnid[actuator].tolist()
        if kind in _JOINTS:
            return "xanchor", [first]
        if kind == _SITE:
            return "site_xpos", [first, second] if second >= 0 else [first]
        if kind == _TENDON:
            wraps = slice(model.tendon_adr[first], model.tendon_adr[first] + model.tendon_num[first])
            types, objects = model.wrap_type[wraps], model.wrap_objid[wraps]
            for array, wrap in _WRAPPED:
                if (of := objects[types == wrap]).size:
                    return array, np.unique(of).tolist()
        return None

    def _ring_centres(self) -> Array:
        """Centres of the rings, of both halves together, m, ``(n_segments, 3)``."""
        centres = np.array([getattr(self.data, array)[of].mean(axis=0) for array, of in self._places])
        return centres.reshape(self.n_segments, -1, 3).mean(axis=1)

    def _contact_forces(self) -> Array:
        """Forces of what is at rest on the segments, N, ``(n_segments, 3)``."""
        model, data = self.model, self.data
        forces, own = np.zeros((self.n_segments, 3)), np.zeros(6)
        for number in range(data.ncon):
            contact = data.contact[number]
            bodies = model.geom_bodyid[contact.geom]
            moving = self._moves[bodies]
            if moving[0] == moving[1]:
                continue
            mujoco.mj_contactForce(model, data, number, own)
            # The engine's force is on the second geom.
            force = contact.frame.reshape(3, 3).T @ own[:3]
            forces[self._segment_of_body[bodies[int(moving[1])]]] += force if moving[1] else -force
        return forces

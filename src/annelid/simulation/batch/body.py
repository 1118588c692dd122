"""The bodies of a batch of worms, stepped by one engine batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError
from numpy.typing import NDArray

from annelid.arena.surface import surface_of
from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.protocols import Array
from annelid.simulation.anatomy import Anatomy, Movement, Posture
from annelid.simulation.worm import Worm, compile_worm, engine_stopped, owns_model

_NO_STAGE = int(mujoco.mjtStage.mjSTAGE_NONE)
_TIMES_GIVEN = 1
"""Column of the engine batch's warnings that counts them; the other holds their last information."""


class BodyBatch:
    """Bodies of one structure, each with parameters of its own.

    The engine keeps each body's state and one workspace, not one for each body; bodies with the same physical
    configuration share one compiled model, unless worms set numbers in it as they move (`owns_model`). The thread that
    calls steps them, without holding Python's lock.

    Attributes:
        worms: The worms, each also a plant by itself.
    """

    def __init__(self, configs: Sequence[RunConfig], anatomies: Sequence[Anatomy]) -> None:
        """Makes the bodies.

        Args:
            configs: One configuration for each worm, alike in what `structure.ALIKE` names.
            anatomies: Their compiled bodies, as `compile_worms` returns them.

        Raises:
            ConfigError: Two models' arrays differ in size.
        """
        models = [anatomy.model for anatomy in anatomies]
        self._anatomy = anatomies[0]
        self._batch = Batch(models[0], len(models), nthread=1)
        if owns_model(configs[0]) or any(model is not models[0] for model in models):
            try:
                self._batch.set_models(models)
            except ValueError as error:
                raise ConfigError(f"these worms differ too much for one batch: {error}") from None
        bind = self._batch.bind
        self._time, self._ctrl, self._qpos, self._qvel = (bind(name) for name in ("time", "ctrl", "qpos", "qvel"))
        self._plastic: Array = bind("plastic") if models[0].nplastic else np.empty((len(models), 0))
        self._act: Array = bind("act") if models[0].na else np.empty((len(models), 0))
        self._mass_matrix = bind("M")
        self._mocap = (bind("mocap_pos"), bind("mocap_quat")) if models[0].nmocap else None
        self._outputs: dict[str, Array] = {name: bind(name) for name in self._anatomy.outputs}
        self._work: dict[str, NDArray[Any]] = {name: bind(name) for name in self._anatomy.bookkeeper.outputs}
        self._scratch = mujoco.MjData(models[0])
        self.worms = [
            BatchWorm(config, anatomy, self, row)
            for row, (config, anatomy) in enumerate(zip(configs, anatomies, strict=True))
        ]

    def reset(self, row: int, state: Array | None) -> None:
        """Resets one body, and gives it a state of the engine if there is one."""
        self._batch.reset([row], stage=_NO_STAGE)
        worm = self.worms[row]
        self._act[row] = worm.anatomy.first_act
        if worm.start is not None:
            self._qpos[row], self._plastic[row] = worm.start
        if state is not None:
            self._batch.state[row] = state

    def move(self, rows: Sequence[int], activation: Array, n_steps: int) -> dict[int, str]:
        """Takes physics steps with some of the bodies.

        Args:
            rows: The bodies, in ascending order.
            activation: Muscle activation of each of them, ``(len(rows), n_muscles)``.
            n_steps: Number of physics steps.

        Returns:
            Why the engine gave up, for every body that it could not step.
        """
        for row, own in zip(rows, activation, strict=True):
            self._ctrl[row] = self.worms[row].control(own, n_steps)
        going, reasons = dict(zip(rows, activation, strict=True)), {}
        for _ in range(n_steps):
            for row in going:
                self._prepare(row)
            stopped = self._step({row: self.worms[row].drive(own, self._act[row]) for row, own in going.items()})
            reasons |= stopped
            going = {row: own for row, own in going.items() if row not in stopped}
        return reasons

    def _step(self, drives: Mapping[int, Array]) -> dict[int, str]:
        """Takes one physics step with the bodies that are driven, and has their worms enter it in their books."""
        if not drives:
            return {}
        reasons: dict[int, str] = {}
        try:
            self._batch.step(list(drives), 1)
        except SimulationError as failure:
            for row in map(int, failure.ids):
                reasons[row] = engine_stopped(float(self._time[row]), self._batch.error(row))
        for row, drive in drives.items():
            if row not in reasons:
                self.worms[row].book({name: values[row] for name, values in self._work.items()}, drive)
        return reasons

    def _prepare(self, row: int) -> None:
        """Gives one body's dampers their coefficients, and lays the planes under its skin."""
        worm = self.worms[row]
        if worm.damping is not None:
            worm.damping.renew(self._qpos[row])
        ground, scratch = worm.ground, self._scratch
        if ground is None or self._mocap is None:
            return
        scratch.qpos[:], scratch.qvel[:] = self._qpos[row], self._qvel[row]
        ground.lay(scratch)
        for bound, laid in zip(self._mocap, (scratch.mocap_pos, scratch.mocap_quat), strict=True):
            bound[row] = laid

    def moved(self, rows: Sequence[int]) -> list[Movement]:
        """Reads what the last movement of some bodies has come to."""
        outputs = self._outputs
        if len(rows) < len(self.worms):
            outputs = {name: values[rows] for name, values in outputs.items()}
        postures, forces = self._postures(rows).each(), self._anatomy.forces(outputs).each()
        return [Movement(*one) for one in zip(postures, forces, self._anatomy.ground(outputs), strict=True)]

    def _postures(self, rows: Sequence[int]) -> Posture:
        """Reads the postures of some bodies, with an axis of them in front."""
        crossing = np.empty((len(rows), self._anatomy.geometry.n_crossings, 3))
        center_of_mass = np.empty((len(rows), 3))
        skin = np.empty((len(rows), len(self._anatomy.skin.segment), 3))
        for place, row in enumerate(rows):
            crossing[place], center_of_mass[place], skin[place] = self.located(row)
        return self._anatomy.posture(crossing, center_of_mass, skin)

    def located(self, row: int) -> tuple[Array, Array, Array]:
        """Returns a body's crossings, centre of mass and skin as `Anatomy.locate` does."""
        self._scratch.qpos[:] = self._qpos[row]
        return self.worms[row].anatomy.locate(self._scratch)

    def kinetic_energy_J(self, row: int) -> float:
        """Kinetic energy of a body, from the mass matrix of its last step, J."""
        scratch = self._scratch
        scratch.qvel[:] = self._qvel[row]
        scratch.M[:] = self._mass_matrix[row]
        mujoco.mj_energyVel(self.worms[row].model, scratch)
        return float(scratch.energy[1])

    def actuator_state(self, row: int) -> Array:
        """Returns a body's actuator states, ``(n_states,)``."""
        return self._act[row]

    def qpos(self, row: int) -> Array:
        """Returns a body's generalised positions, ``(nq,)``."""
        return self._qpos[row]

    def plastic(self, row: int) -> Array:
        """Returns what the engine keeps of the rods' frames of a body, ``(nplastic,)``."""
        return self._plastic[row]

    def engine_state(self, row: int) -> Array:
        """Returns a copy of a body's engine state."""
        return self._batch.state[row].copy()

    def warnings(self, row: int) -> NDArray[np.int32]:
        """Returns how often the engine has given each of its warnings to a body."""
        return self._batch.warning[row, :, _TIMES_GIVEN]


class BatchWorm(Worm):
    """One worm of a batch: a plant like any other, whose engine state is a row of the batch."""

    def __init__(self, config: RunConfig, anatomy: Anatomy, bodies: BodyBatch, row: int) -> None:
        """Makes the worm of one row."""
        super().__init__(config, anatomy)
        self._bodies = bodies
        self._row = row

    def reset_engine(self, state: Array | None = None) -> None:
        """Resets its row, and gives it a state that `engine_state` returned if there is one."""
        self._bodies.reset(self._row, state)

    def move(self, activation: Array, n_steps: int) -> Movement:
        """Takes physics steps with this worm alone.

        Raises:
            SimulationStopped: The engine gave up.
        """
        reasons = self._bodies.move([self._row], activation[np.newaxis], n_steps)
        if reasons:
            raise SimulationStopped(reasons[self._row])
        return self._bodies.moved([self._row])[0]

    def actuator_state(self) -> Array:
        """Returns the engine's actuator states, ``(n_states,)``."""
        return self._bodies.actuator_state(self._row)

    def locate(self) -> Posture:
        """Reads the posture from its row's coordinates."""
        return self.anatomy.posture(*self._bodies.located(self._row))

    def qpos(self) -> Array:
        """Returns the generalised positions, ``(nq,)``."""
        return self._bodies.qpos(self._row)

    def plastic(self) -> Array:
        """Returns what the engine keeps of the rods' frames, ``(nplastic,)``."""
        return self._bodies.plastic(self._row)

    def engine_state(self) -> Array:
        """Returns a copy of all that the engine's next step depends on."""
        return self._bodies.engine_state(self._row)

    def warnings(self) -> NDArray[np.int32]:
        """Returns how often the engine has given each of its warnings."""
        return self._bodies.warnings(self._row)

    def kinetic_energy_J(self) -> float:
        """Kinetic energy of the whole body, J."""
        return self._bodies.kinetic_energy_J(self._row)


def compile_worms(configs: Sequence[RunConfig]) -> list[Anatomy]:
    """Compiles one model for each physical configuration; returns the anatomy of every worm.

    Raises:
        ConfigError: The engine refuses a model.
    """
    models: dict[str, Anatomy] = {}
    anatomies: list[Anatomy] = []
    for config in configs:
        physical = config.model_dump_json(include={"body", "arena", "clock"}, exclude={"body": {"heading_deg"}})
        if physical not in models:
            anatomies.append(models.setdefault(physical, compile_worm(config)))
            continue
        known = models[physical]
        assert isinstance(config.body, WormBody)
        assert config.arena is not None
        own = owns_model(config)
        anatomies.append(Anatomy(copy(known.model), config.body, surface_of(config.arena)) if own else known)
    return anatomies

"""The bodies of a batch of worms, stepped by one engine batch."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy

import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from annelid.config import RunConfig
from annelid.errors import ConfigError, SimulationStopped
from annelid.protocols import Array
from annelid.simulation.anatomy import Anatomy, Forces, Movement, Posture
from annelid.simulation.objects import Met
from annelid.simulation.worm import Worm, body_and_arena, compile_worm, engine_stopped, owns_model

_NO_STAGE = int(mujoco.mjtStage.mjSTAGE_NONE)
_TIMES_GIVEN = 1
"""Column of the engine batch's warnings that counts them; the other has their last information."""


class BodyBatch:
    """Bodies of one structure, each with parameters of its own.

    The engine keeps each body's state and one workspace, not one for each body; bodies with the same physical
    configuration share one compiled model, unless worms set numbers in it as they move (`owns_model`). The thread that
    calls steps them, without holding Python's lock.

    Attributes:
        worms: The worms, each also a plant by itself.
        batch: The engine's batch.
        bound: The engine's arrays by name, a row for each worm.
        scratch: Data of one worm, in which what is not part of a step is computed.
    """

    def __init__(
        self, configs: Sequence[RunConfig], anatomies: Sequence[Anatomy], turn: threading.Lock | None = None
    ) -> None:
        """Makes the bodies of worms, alike in what `annelid.simulation.batch.ALIKE` names, from their compiled bodies.

        Args:
            configs: Their configurations.
            anatomies: Their compiled bodies.
            turn: Held by the one thread of several that does not step the engine: numpy gives Python's lock away in
                every operation on long arrays, and threads that pass it to and fro are slower.

        Raises:
            ConfigError: Two models' arrays differ in size.
        """
        model, n = anatomies[0].model, len(anatomies)
        self._turn = turn
        self.batch = Batch(model, n, nthread=1)
        if owns_model(configs[0]) or any(anatomy.model is not model for anatomy in anatomies):
            try:
                self.batch.set_models([anatomy.model for anatomy in anatomies])
            except ValueError as error:
                raise ConfigError(f"these worms differ too much for one batch: {error}") from None
        self._anatomy = anatomies[0]
        names = {"time", "ctrl", "qpos", "qvel", "M", *self._anatomy.outputs, *self._anatomy.energy_meter.outputs}
        names |= {"mocap_pos", "mocap_quat"} if model.nmocap else set()
        self.bound = {name: self.batch.bind(name) for name in sorted(names)}
        for name, size in (("plastic", model.nplastic), ("act", model.na)):
            self.bound[name] = self.batch.bind(name) if size else np.empty((n, 0))
        self.scratch = mujoco.MjData(model)
        worms = enumerate(zip(configs, anatomies, strict=True))
        self.worms = [BatchWorm(config, anatomy, self, row) for row, (config, anatomy) in worms]

    def move(self, rows: Sequence[int], activation: Array, n_steps: int) -> dict[int, str]:
        """Takes physics steps with some bodies, in ascending order, under an activation, ``(len(rows), n_muscles)``.

        Returns why the engine gave up, for every body that it could not step.
        """
        going, reasons = dict(zip(rows, activation, strict=True)), {}
        for row, own in going.items():
            self.bound["ctrl"][row] = self.worms[row].control(own, n_steps)
        for _ in range(n_steps):
            drives = {row: self.worms[row].drive(own) for row, own in going.items()}
            for row in going:
                self._prepare(self.worms[row], row)
            stopped = self._step(drives)
            reasons |= stopped
            going = {row: own for row, own in going.items() if row not in stopped}
        return reasons

    def _step(self, drives: Mapping[int, Array]) -> dict[int, str]:
        """Takes one physics step with the bodies that are driven, and has their worms add it to their energy totals."""
        reasons: dict[int, str] = {}
        if not drives:
            return reasons
        try:
            with self._others_turn():
                self.batch.step(list(drives), 1)
        except SimulationError as failure:
            for row in map(int, failure.ids):
                reasons[row] = engine_stopped(float(self.bound["time"][row]), self.batch.error(row))
        for row in drives.keys() - reasons:
            self.bound["time"][row] += self.worms[row].beyond_s
            self.worms[row].add_step(drives[row])
        return reasons

    @contextmanager
    def _others_turn(self) -> Iterator[None]:
        """Gives the turn away, if this thread has it."""
        if self._turn is None or not self._turn.locked():
            yield
            return
        self._turn.release()
        try:
            yield
        finally:
            self._turn.acquire()

    def _prepare(self, worm: Worm, row: int) -> None:
        """Begins one body's step, gives its dampers their coefficients, and lays the planes under its skin."""
        worm.begin_step()
        if worm.damping is not None:
            worm.damping.renew(worm.qpos)
        if worm.ground is not None:
            scratch, bound = self.scratch, self.bound
            scratch.qpos[:], scratch.qvel[:] = worm.qpos, bound["qvel"][row]
            worm.ground.lay(scratch)
            bound["mocap_pos"][row], bound["mocap_quat"][row] = scratch.mocap_pos, scratch.mocap_quat

    def moved(self, rows: Sequence[int]) -> list[Movement]:
        """Reads what the last movement of some bodies has come to."""
        if not rows:
            return []
        anatomy, all_of_them = self._anatomy, len(rows) == len(self.worms)
        engine = {name: self.bound[name] if all_of_them else self.bound[name][rows] for name in anatomy.outputs}
        forces, ground = anatomy.forces(engine)
        located = zip(*(self.worms[row].located() for row in rows), strict=True)
        postures = zip(*anatomy.posture(*(np.stack(parts) for parts in located)), strict=True)
        met = map(Met._make, zip(*forces.met, strict=True))
        acted = map(Forces._make, zip(*forces[:-1], met, strict=True))
        each = zip(map(Posture._make, postures), acted, ground, strict=True)
        return [Movement(*one) for one in each]


class BatchWorm(Worm):
    """One worm of a batch: a plant like any other, whose engine state is a row of the batch."""

    def __init__(self, config: RunConfig, anatomy: Anatomy, bodies: BodyBatch, row: int) -> None:
        """Makes the worm of one row."""
        super().__init__(config, anatomy)
        self._bodies, self._row = bodies, row
        self.engine = {name: values[row] for name, values in bodies.bound.items()}
        names = ("qpos", "plastic", "act", "ctrl")
        self.qpos, self.plastic, self.act, self.ctrl = (self.engine[name] for name in names)
        self.two_step = self._two_step()
        self.warned = bodies.batch.warning[row, :, _TIMES_GIVEN]

    def move(self, activation: Array, n_steps: int) -> Movement:
        """Takes physics steps with this worm alone, as `Worm.move`."""
        reasons = self._bodies.move([self._row], activation[np.newaxis], n_steps)
        if reasons:
            raise SimulationStopped(reasons[self._row])
        return self._bodies.moved([self._row])[0]

    def located(self) -> tuple[Array, Array, Array, Array]:
        """Returns positions as `Anatomy.locate` does."""
        self._bodies.scratch.qpos[:] = self.qpos
        return self.anatomy.locate(self._bodies.scratch)

    def kinetic_energy_J(self) -> float:
        """Kinetic energy of the whole body, from the mass matrix of its last step, J."""
        scratch = self._bodies.scratch
        scratch.qvel[:] = self.engine["qvel"]
        scratch.M[:] = self.engine["M"]
        mujoco.mj_energyVel(self.model, scratch)
        return float(scratch.energy[1])

    def _reset_engine(self, state: Array | None = None) -> None:
        self._bodies.batch.reset([self._row], stage=_NO_STAGE)
        self.act[:] = self.anatomy.first_act
        if self.start is not None:
            self.qpos[:], self.plastic[:] = self.start
        if state is not None:
            self._bodies.batch.state[self._row] = state

    def _engine_state(self) -> Array:
        return self._bodies.batch.state[self._row].copy()

    def _locate(self) -> Posture:
        return self.anatomy.posture(*self.located())


def compile_worms(configs: Sequence[RunConfig]) -> list[Anatomy]:
    """Compiles one model for each physical configuration; returns the anatomy of every worm, as `compile_worm`."""
    models: dict[str, Anatomy] = {}
    anatomies: list[Anatomy] = []
    for config in configs:
        physical = config.model_dump_json(include={"body", "arena", "clock"}, exclude={"body": {"heading_deg"}})
        known = models.get(physical)
        if known is None:
            known = models[physical] = compile_worm(config)
        elif owns_model(config):
            body, arena = body_and_arena(config)
            known = Anatomy(copy(known.model), body, arena)
        anatomies.append(known)
    return anatomies

"""What goes wrong on purpose between a controller and the body: worse sensors, weaker muscles, a push, a bad start."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, cast

import numpy as np
from pydantic import Field

from annelid.clock import SLACK_S
from annelid.config import ArenaKind, NonNegative, Positive, Share, TrialKind, default_of
from annelid.control import SavedWrapper, WrappedController
from annelid.protocols import Array, Controller, Plant, SavedAndRecorded, Sensation, Stateful
from annelid.simulation import WormPlant

if TYPE_CHECKING:
    from annelid.config import RunConfig

SENSORS = ("stretch_m", "ring_length_m", "muscle_force_N", "contact_force_N", "touch_N")
"""What loss and delay act on; drift and resolution act on the first."""
LOSS_S = 0.2
"""Time that the loss of a sensor lasts."""
RANDOM_S = 0.25
"""Time for which a random command stays the same."""
DRIFT, LOSS, COMMANDS = range(3)
"""Streams of random numbers."""


class Sizes(NamedTuple):
    """All that a blind controller knows of its body."""

    n_segments: int
    n_muscles: int


class Faults(TrialKind):
    """What goes wrong on purpose, and what a controller may not know; fields that are not set do nothing.

    Every random draw depends on the run's seed and the time alone, so that a run continues bit for bit.
    """

    kind: Literal["faults"] = "faults"
    blind: bool = Field(
        default=False, description="the controller is built without arena, noise, trial or seed; reset with 0"
    )
    drift_m_per_s: NonNegative = Field(default=0.0, description="largest rate at which a reading of stretch drifts")
    resolution_m: NonNegative = Field(default=0.0, description="stretch is read in multiples of this")
    loss: Share = Field(default=0.0, description="share of the time in which a sensor keeps its last reading")
    delay_s: Annotated[float, Field(ge=0, le=2)] = Field(default=0.0, description="age of what the controller senses")
    backlash: Share = Field(default=0.0, description="change of a command that is lost where it reverses")
    weak_segment: int = Field(default=1, ge=1, le=200, description="segment that weakens")
    weak_strength: Share = Field(default=1.0, description="share of its activation that it is left")
    weak_from_s: NonNegative = Field(default=0.0, description="when it weakens")
    push_N: NonNegative = Field(default=0.0, description="force that pushes the ring of the middle segment to its left")
    push_from_s: NonNegative = Field(default=0.0, description="when the push begins")
    push_s: Positive = Field(default=0.5, description="time that it lasts")
    silent_s: NonNegative = Field(default=0.0, description="until then no command reaches a muscle")
    random_s: NonNegative = Field(default=0.0, description="until then random commands reach the muscles")

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has the segment that weakens, and can be pushed."""
        if self.weak_segment > config.body.n_segments:
            raise ValueError(
                f"trial.weak_segment = {self.weak_segment}: must be in 1 .. {config.body.n_segments}, the segments of "
                "the body"
            )
        if self.push_N and not config.body.can_be_pushed:
            raise ValueError(
                f"trial.push_N = {self.push_N:g}: body.kind = {config.body.kind!r} cannot be pushed; leave it at 0"
            )

    def known(self, config: RunConfig, plant: Plant) -> tuple[RunConfig, Plant]:
        """Returns what a controller may know: if it is blind no ground, no noise, no faults and no seed."""
        if not self.blind:
            return config, plant
        arena = None if config.arena is None else default_of(ArenaKind)
        sensor = config.sensor.model_copy(update={"noise_m": 0.0})
        hidden = config.model_copy(update={"arena": arena, "sensor": sensor, "trial": None, "seed": 0})
        return hidden, cast(Plant, Sizes(plant.n_segments, plant.n_muscles))

    def between(self, controller: Controller, config: RunConfig, plant: Plant) -> Controller:
        """Returns a controller under these faults, as `TrialKind.between`."""
        kind = SavedFaultyController if isinstance(controller, Stateful) else FaultyController
        state = FaultState(self, plant, config.clock.control_timestep_s)
        return kind(controller, state)


class FaultState(SavedAndRecorded):
    """The faults of one worm's sensors and muscles, and what they depend on."""

    def __init__(self, trial: Faults, plant: Plant, control_timestep_s: float) -> None:
        """Begins as `reset`."""
        self.trial, self._plant = trial, plant
        self._timestep_s, self._n_muscles = control_timestep_s, plant.n_muscles
        self._late = round(trial.delay_s / control_timestep_s)
        per_segment = plant.n_muscles // plant.n_segments
        first = (trial.weak_segment - 1) * per_segment
        self._weak = slice(first, first + per_segment)
        # How much it senses, its first sensation says; a body that is under way goes on from where it is.
        saved = plant if isinstance(plant, Stateful) else None
        state = saved.get_state() if saved is not None else {}
        sensed = plant.reset(0)
        if saved is not None:
            saved.set_state(state)
        self._force_N = _to_the_left(plant, trial.push_N) if isinstance(plant, WormPlant) else np.zeros(0)
        self._n_stretch = sensed.stretch_m.size
        self._n_values = sum(getattr(sensed, name).size for name in SENSORS)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the initial state, in which nothing was sensed; ``seed`` fixes all that is random."""
        self._now = {"seed": np.array(seed, dtype=np.uint64), "moved": np.zeros(self._n_muscles)}
        if self.trial.drift_m_per_s:
            rates = self._random(DRIFT).uniform(-1.0, 1.0, self._n_stretch)
            self._now["drift"] = self.trial.drift_m_per_s * rates
        if self.trial.loss:
            self._now["kept"] = np.full(self._n_values, np.nan)
        if self._late:
            self._now["late"] = np.full((self._late, self._n_values), np.nan)

    def sensed(self, true: Sensation) -> Sensation:
        """Returns what the controller senses at a control step in place of a sensation."""
        trial = self.trial
        parts = [np.asarray(getattr(true, name), dtype=float) for name in SENSORS]
        if trial.drift_m_per_s:
            parts[0] = parts[0] + true.time_s * self._now["drift"].reshape(parts[0].shape)
        if trial.resolution_m:
            parts[0] = np.round(parts[0] / trial.resolution_m) * trial.resolution_m
        if trial.loss or self._late:
            values = self._delayed(
                self._kept(np.concatenate([part.ravel() for part in parts]), true.time_s), true.time_s
            )
            ends = np.cumsum([part.size for part in parts])[:-1]
            parts = [each.reshape(part.shape) for each, part in zip(np.split(values, ends), parts, strict=True)]
        return replace(true, **dict(zip(SENSORS, parts, strict=True)))

    def push(self, time_s: float) -> None:
        """Pushes the body, or ends the push, at a control step."""
        trial = self.trial
        if trial.push_N and isinstance(self._plant, WormPlant):
            pushed = trial.push_from_s <= time_s < trial.push_from_s + trial.push_s
            self._plant.push(self._force_N if pushed else np.zeros_like(self._force_N))

    def moved(self, command: Array, time_s: float) -> Array:
        """Returns the activation that reaches the muscles at a control step in place of a command."""
        trial = self.trial
        if time_s < trial.random_s:
            command = self._random(COMMANDS, _slot(time_s, RANDOM_S)).uniform(size=self._n_muscles)
        if time_s < trial.silent_s:
            command = np.zeros(self._n_muscles)
        if trial.backlash:
            half = 0.5 * trial.backlash
            command = np.clip(self._now["moved"], command - half, command + half)
            self._now["moved"][:] = command
        if trial.weak_strength < 1.0 and time_s >= trial.weak_from_s:
            command = command.copy()
            command[self._weak] *= trial.weak_strength
        return command

    def _random(self, stream: int, place: int = 0) -> np.random.Generator:
        return np.random.default_rng([int(self._now["seed"]), stream, place])

    def _kept(self, values: Array, time_s: float) -> Array:
        """The values, in which sensors that are lost now keep their last ones; none is lost in the first slot."""
        if not self.trial.loss:
            return values
        slot = _slot(time_s, LOSS_S)
        if slot:
            lost = self._random(LOSS, slot).uniform(size=values.size) < self.trial.loss
            values = np.where(lost, self._now["kept"], values)
        self._now["kept"][:] = values
        return values

    def _delayed(self, values: Array, time_s: float) -> Array:
        """The values of some control steps ago; those of the first step before there are any."""
        if not self._late:
            return values
        step, late = round(time_s / self._timestep_s), self._now["late"]
        if not step:
            late[:] = values
        oldest = late[step % self._late].copy()
        late[step % self._late] = values
        return oldest


def _slot(time_s: float, length_s: float) -> int:
    """Number of the slot of time that begins now or has begun."""
    return int((time_s + SLACK_S) / length_s)


def _to_the_left(plant: WormPlant, force_N: float) -> Array:
    """A force on the ring of the middle segment to the worm's left, ``(n_crossings, 3)``."""
    ring = plant.geometry.rings[plant.n_segments // 2]
    force = np.zeros((plant.geometry.n_crossings, 3))
    force[ring, 1] = -force_N / len(ring)
    return force


class FaultyController(WrappedController):
    """A controller between whom and the body something goes wrong."""

    between: FaultState

    def reset(self, seed: int) -> None:
        """Returns to the initial state; a blind controller is reset with seed 0."""
        self.inner.reset(0 if self.between.trial.blind else seed)
        self.between.reset(seed)

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `annelid.protocols.Controller.step`."""
        self.between.push(sensation.time_s)
        command = np.asarray(self.inner.step(self.between.sensed(sensation)), dtype=float)
        return self.between.moved(command, sensation.time_s)


class SavedFaultyController(SavedWrapper, FaultyController):
    """The same of a controller whose state can be saved."""

    prefixes = ("controller_", "trial_")

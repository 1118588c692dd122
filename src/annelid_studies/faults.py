"""What goes wrong on purpose between a controller and the body: lost sensors, a weak segment, a load."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal, NamedTuple, cast

import numpy as np
from pydantic import Field

from annelid.clock import SLACK_S
from annelid.config import ArenaKind, NonNegative, Share, TrialKind, default_of
from annelid.control import SavedWrapper, WrappedController
from annelid.protocols import Array, Controller, Plant, SavedAndRecorded, Sensation, Stateful
from annelid.simulation import WormPlant

if TYPE_CHECKING:
    from annelid.config import RunConfig

SENSORS = ("stretch_m", "ring_length_m", "muscle_force_N", "contact_force_N", "touch_N")
"""What is lost."""
LOSS_S = 0.2
"""Time that the loss of a sensor lasts."""


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
    loss: Share = Field(default=0.0, description="share of the time in which a sensor keeps its last reading")
    weak_segment: int = Field(default=1, ge=1, le=200, description="segment that weakens")
    weak_strength: Share = Field(default=1.0, description="share of its activation that it is left")
    weak_from_s: NonNegative = Field(default=0.0, description="when it weakens")
    pull: Share = Field(default=0.0, description="force that pulls the last ring back, over the worm's weight")
    pull_from_s: NonNegative = Field(default=0.0, description="when that begins")

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has the segment that weakens, and can be pulled."""
        if self.weak_segment > config.body.n_segments:
            raise ValueError(
                f"trial.weak_segment = {self.weak_segment}: must be in 1 .. {config.body.n_segments}, the segments of "
                "the body"
            )
        if self.pull and not config.body.can_be_pushed:
            raise ValueError(
                f"trial.pull = {self.pull:g}: body.kind = {config.body.kind!r} cannot be pulled; leave it at 0"
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
        state = FaultState(self, plant)
        return kind(controller, state)


class FaultState(SavedAndRecorded):
    """The faults of one worm's sensors and muscles, and what they depend on."""

    def __init__(self, trial: Faults, plant: Plant) -> None:
        """Begins as `reset`."""
        self.trial, self._plant = trial, plant
        per_segment = plant.n_muscles // plant.n_segments
        first = (trial.weak_segment - 1) * per_segment
        self._weak = slice(first, first + per_segment)
        # How much it senses, its first sensation says; a body that is under way goes on from where it is.
        saved = plant if isinstance(plant, Stateful) else None
        state = saved.get_state() if saved is not None else {}
        sensed = plant.reset(0)
        if saved is not None:
            saved.set_state(state)
        self._pull_N = np.zeros(0)
        if isinstance(plant, WormPlant):
            weight_N = plant.model.body_mass.sum() * np.linalg.norm(plant.model.opt.gravity)
            self._pull_N = _backwards(plant, trial.pull * float(weight_N))
        self._n_values = sum(getattr(sensed, name).size for name in SENSORS)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the initial state, in which nothing was sensed; ``seed`` fixes all that is random."""
        self._now = {"seed": np.array(seed, dtype=np.uint64), "kept": np.full(self._n_values, np.nan)}

    def sensed(self, true: Sensation) -> Sensation:
        """Returns what the controller senses at a control step in place of a sensation."""
        if not self.trial.loss:
            return true
        parts = [np.asarray(getattr(true, name), dtype=float) for name in SENSORS]
        values = self._kept(np.concatenate([part.ravel() for part in parts]), true.time_s)
        ends = np.cumsum([part.size for part in parts])[:-1]
        split = zip(parts, np.split(values, ends), strict=True)
        return replace(true, **dict(zip(SENSORS, (each.reshape(part.shape) for part, each in split), strict=True)))

    def pull(self, time_s: float) -> None:
        """Pulls the body at a control step, if its time has come."""
        if self.trial.pull and isinstance(self._plant, WormPlant):
            self._plant.push((time_s >= self.trial.pull_from_s) * self._pull_N)

    def moved(self, command: Array, time_s: float) -> Array:
        """Returns the activation that reaches the muscles at a control step in place of a command."""
        trial = self.trial
        if trial.weak_strength < 1.0 and time_s >= trial.weak_from_s:
            command = command.copy()
            command[self._weak] *= trial.weak_strength
        return command

    def _kept(self, values: Array, time_s: float) -> Array:
        """The values, in which sensors that are lost now keep their last ones; none is lost in the first slot."""
        slot = int((time_s + SLACK_S) / LOSS_S)
        if slot:
            lost = np.random.default_rng([int(self._now["seed"]), slot]).uniform(size=values.size) < self.trial.loss
            values = np.where(lost, self._now["kept"], values)
        self._now["kept"][:] = values
        return values


def _backwards(plant: WormPlant, force_N: float) -> Array:
    """A force on the ring of the last segment against the worm's heading, ``(n_crossings, 3)``."""
    ring = plant.geometry.rings[-1]
    force = np.zeros((plant.geometry.n_crossings, 3))
    force[ring, 0] = force_N / len(ring)
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
        self.between.pull(sensation.time_s)
        command = np.asarray(self.inner.step(self.between.sensed(sensation)), dtype=float)
        return self.between.moved(command, sensation.time_s)


class SavedFaultyController(SavedWrapper, FaultyController):
    """The same of a controller whose state can be saved."""

    prefixes = ("controller_", "trial_")

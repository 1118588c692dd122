"""One worm's episode: from an action to activations of every physics step, and from these to what the agent gets."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from annelid.body.worm import WormBody
from annelid.environments.observation import Layout, Observation, Senses, layout_of
from annelid.environments.task import Deed, Task, reward_terms
from annelid.environments.way import Place, way_of
from annelid.errors import ConfigError
from annelid.morphology import Array
from annelid.protocols import Sensation
from annelid.simulation.worm import Worm

ACTION_SLACK = 1e-6


class Outcome(NamedTuple):
    """What an agent gets for a step."""

    observation: Observation
    reward: float
    terminated: bool
    truncated: bool
    info: dict[str, Any]


class Episode:
    """The state of one worm's episode, whoever steps the worm.

    Attributes:
        task: What is asked of the worm.
        worm: The worm.
        layout: How observations are laid out.
        stopped: Why the simulation of the worm broke down; empty while it goes on.
    """

    def __init__(self, task: Task, worm: Worm) -> None:
        """Puts the worm at its start."""
        body, arena = task.config.body, task.config.arena
        assert isinstance(body, WormBody)
        assert arena is not None
        self.task = task
        self.worm = worm
        self.layout: Layout = layout_of(worm)
        self.stopped = ""
        self._way = way_of(arena, body.heading_deg)
        self._sensation: Sensation = worm.reset(0)
        self._senses = Senses(worm, task.interval_s)
        self._begin(np.zeros(worm.n_muscles))

    @property
    def sensation(self) -> Sensation:
        """What the worm feels, without noise."""
        return self._sensation

    @property
    def activation(self) -> Array:
        """Activation of its muscles, ``(n_muscles,)``."""
        return self._activation

    def reset(self, random: np.random.Generator) -> tuple[Observation, dict[str, Any]]:
        """Puts the worm at its start, with activations drawn anew; returns the first observation and its info."""
        self.stopped = ""
        self._sensation = self.worm.reset(0)
        self._begin(random.uniform(0.0, 1.0, self.worm.n_muscles) * self.task.start_activation)
        self._observation = self._observed(random, self._ring_m, np.zeros(3))
        return self._observation.copy(), {"time_s": 0.0, "travel": 0.0}

    def _begin(self, activation: Array) -> None:
        self._steps = 0
        self._activation = activation
        self._ring_m = self._sensation.ring_length_m
        self._place, self._middle_m = self._located()
        self._start_m = self._place.along_m
        self._slid_m, self._slip_loss_J, self._work_J = self._spent()
        self._ended = False

    def activations(self, action: ArrayLike) -> Array:
        """Returns the activations of every physics step: a ramp from the last action to this one.

        Args:
            action: Activation of every ring muscle in [0, 1], ``(n_muscles,)``.

        Returns:
            Shape ``(moves_per_step, n_muscles)``; the last row is the action.

        Raises:
            ConfigError: The episode has ended, or the action has another shape or a value out of its range.
        """
        if self._ended:
            raise ConfigError("the episode has ended: call reset() before the next step()")
        wanted = np.asarray(action, dtype=float)
        if wanted.shape != self._activation.shape:
            raise ConfigError(
                f"the action has shape {wanted.shape}: must be {self._activation.shape}, one a ring muscle"
            )
        bad = np.flatnonzero(~((wanted >= -ACTION_SLACK) & (wanted <= 1.0 + ACTION_SLACK)))
        if bad.size:
            raise ConfigError(
                f"action[{bad[0]}] = {wanted[bad[0]]:g}: must be in 0 .. 1; gymnasium.wrappers.ClipAction clips actions"
            )
        share = np.arange(1, self.task.moves_per_step + 1)[:, np.newaxis] / self.task.moves_per_step
        return (1.0 - share) * self._activation + share * np.clip(wanted, 0.0, 1.0)

    def felt(self, sensation: Sensation) -> None:
        """Takes note of a physics step, and of whether the numbers have run away."""
        whole = (sensation.stretch_m, sensation.ring_length_m, sensation.center_of_mass_m, sensation.contact_force_N)
        finite = all(np.isfinite(part).all() for part in whole)
        reason = self.worm.alarm() if finite else "a length, a position or a force became infinite or NaN"
        if reason:
            self.stop(reason)
        else:
            self._sensation = sensation

    def stop(self, reason: str) -> None:
        """Takes note that the simulation of the worm broke down."""
        self.stopped = f"at {self._sensation.time_s:.6g} s of simulated time: {reason}"

    def outcome(self, action: ArrayLike, random: np.random.Generator) -> Outcome:
        """Returns what the agent gets at the end of a step.

        Args:
            action: The action of this step.
            random: Of the noise of the worm's sensors.
        """
        task = self.task
        self._steps += 1
        broke_down = bool(self.stopped)
        advance_m = slid_m = slip_loss_J = work_J = 0.0
        if not broke_down:
            before, (ring_m, middle_m) = self._place, (self._ring_m, self._middle_m)
            spent = self._slid_m, self._slip_loss_J, self._work_J
            self._activation = np.clip(np.asarray(action, dtype=float), 0.0, 1.0)
            self._place, self._middle_m = self._located()
            self._ring_m = self._sensation.ring_length_m
            self._slid_m, self._slip_loss_J, self._work_J = self._spent()
            advance_m = self._place.along_m - before.along_m
            slid_m, slip_loss_J, work_J = self._slid_m - spent[0], self._slip_loss_J - spent[1], self._work_J - spent[2]
            self._observation = self._observed(random, ring_m, self._middle_m - middle_m)
        passed = not broke_down and task.goal_m is not None and self._place.along_m >= task.goal_m
        deed = Deed(advance_m, slid_m, self._activation, passed, broke_down)
        length_m = self.worm.geometry.length_m
        terms = reward_terms(deed, task.weights, length_m, task.interval_s)
        info = {
            **terms,
            "time_s": self._steps * task.interval_s,
            "travel": (self._place.along_m - self._start_m) / length_m,
            "muscle_work_J": work_J,
            "slip_loss_J": slip_loss_J,
            "is_success": passed,
            "stopped": self.stopped,
        }
        terminated = broke_down or passed
        truncated = not terminated and self._steps >= task.steps_per_episode
        self._ended = terminated or truncated
        return Outcome(self._observation.copy(), sum(terms.values()), terminated, truncated, info)

    def _located(self) -> tuple[Place, Array]:
        """Returns where the worm is on its way, and its middle, m, ``(3,)``."""
        centres = self.worm.posture.crossing.take(self.worm.geometry.rings, axis=0).mean(axis=1)
        return self._way.place(centres), centres.mean(axis=0)

    def _spent(self) -> tuple[float, float, float]:
        """Mean way slid so far, m, work lost to friction so far, and work of the muscles so far, J."""
        touch = self.worm.touch
        return float(touch.slip_distance.mean()), float(touch.slip_loss.sum()), float(self.worm.books.muscle_work.sum())

    def _observed(self, random: np.random.Generator, before_m: Array, moved_m: Array) -> Observation:
        felt, noise_m = self._sensation, self.task.config.sensor.noise_m
        if noise_m:
            felt = replace(felt, stretch_m=felt.stretch_m + random.normal(0.0, noise_m, felt.stretch_m.shape))
        values = self._senses.values(self.worm, felt, before_m, self._place, moved_m, self._activation)
        return self.layout.packed(values)

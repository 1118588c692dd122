"""One worm's episode: from an action to activations of every physics step, and from these to what the agent gets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from annelid.arena.course import AHEAD, LEFT, UP
from annelid.config import ArenaKind
from annelid.environments.task import Deed, Task, reward_terms
from annelid.errors import ConfigError, SimulationStopped
from annelid.morphology import Array, heading_turn
from annelid.protocols import SIDES, Sensation
from annelid.simulation.worm import WormPlant, body_and_arena

Observation = NDArray[np.float32]
ACTION_SLACK = 1e-6
STANDARD_GRAVITY_M_PER_S2 = 9.80665
"""What the worm's weight is computed with, whatever acts on it."""


class Place(NamedTuple):
    """Where a worm is on its route."""

    along_m: float  # how far its middle has come, from a point of the arena
    axes: Array  # unit vectors forwards, to the left and upwards there, as rows, (3, 3)


class Route:
    """The path that a worm is to go: straight ahead on open ground, or along a pipe's centre line."""

    def __init__(self, arena: ArenaKind, heading_deg: float = 0.0) -> None:
        """Takes the arena, and the heading at the start."""
        self._line = arena.centre_line()
        self._axes = np.stack([AHEAD, LEFT, UP]) @ heading_turn(heading_deg).T

    def place(self, ring_centre_m: Array) -> Place:
        """Finds a worm's place from the centres of its rings, m, ``(n_segments, 3)``."""
        middle = ring_centre_m.mean(axis=0)
        if self._line is None:
            return Place(float(middle @ self._axes[0]), self._axes)
        along = float(self._line.nearest(ring_centre_m).arc_m.mean())
        tangent = self._line.nearest(middle[np.newaxis]).tangent[0]
        left = np.cross(UP, tangent)
        left /= np.sqrt(left @ left)
        return Place(along, np.stack([tangent, left, np.cross(tangent, left)]))


@dataclass(frozen=True, slots=True)
class Entry:
    """One kind of number in an observation.

    Attributes:
        low: What the lower end of the scaled range stands for: ``-high`` or 0.
        high: What 1 stands for; numbers beyond are clipped.
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    low: float
    high: float
    meaning: str

    @property
    def size(self) -> int:
        """How many numbers these are."""
        return prod(self.shape)


class Layout:
    """How an observation is laid out: named entries with units and ranges, each scaled into [-1, 1] or [0, 1].

    Attributes:
        entries: Its entries in order.
        size: How many numbers it has.
    """

    def __init__(self, entries: tuple[Entry, ...]) -> None:
        self.entries = entries
        self.size = sum(entry.size for entry in entries)
        self._high = np.concatenate([np.full(entry.size, entry.high) for entry in entries])
        self._least = np.concatenate([np.full(entry.size, entry.low / entry.high) for entry in entries])

    def space(self) -> Box[np.float32]:
        """Returns the space of observations, ``(size,)``."""
        return Box(self._least.astype(np.float32), np.ones(self.size, dtype=np.float32), (self.size,), np.float32)

    def packed(self, values: Mapping[str, Array]) -> Observation:
        """Scales, clips and lays out numbers.

        Args:
            values: Numbers in their units, by name.

        Returns:
            Shape ``(size,)``.
        """
        flat = np.concatenate([np.ravel(values[entry.name]) for entry in self.entries])
        return np.clip(flat / self._high, self._least, 1.0).astype(np.float32)

    def named(self, observations: ArrayLike) -> dict[str, Array]:
        """Takes observations apart: numbers in their units, by name.

        Args:
            observations: Shape ``(..., size)``; of one worm or of many.

        Returns:
            Each of shape ``(..., *entry.shape)``.
        """
        scaled: Array = np.asarray(observations, dtype=float)
        parts = np.split(scaled, np.cumsum([entry.size for entry in self.entries])[:-1], axis=-1)
        return {
            entry.name: entry.high * part.reshape(*scaled.shape[:-1], *entry.shape)
            for entry, part in zip(self.entries, parts, strict=True)
        }


def layout_of(worm: WormPlant) -> Layout:
    """Returns how a worm's observations are laid out."""
    n, m, sensors = worm.n_segments, worm.n_muscles, worm.anatomy.rest_stretch_m.shape
    ring = "change of a ring muscle's length since the start, of that length"
    stretch = "change of a stretch sensor's length from that at rest, of that length"
    touch = "normal force of the ground on belly, left, back, right"
    heading = "unit vector from the last ring to the first, along the axes below"
    upright = "how far the middle ring's back and left side point upwards"
    velocity = "of the worm's middle over the last step, along the axes below"
    return Layout(
        (
            Entry("ring_strain", (m,), "1", -1.0, 1.0, ring),
            Entry("ring_rate", (m,), "1/s", -5.0, 5.0, "how fast the same has changed over the last step"),
            Entry("stretch_strain", sensors, "1", -2.0, 2.0, stretch),
            Entry("touch", (n, len(SIDES)), "weights", 0.0, 2.0, touch),
            Entry("heading", (3,), "1", -1.0, 1.0, heading),
            Entry("upright", (2,), "1", -1.0, 1.0, upright),
            Entry("velocity", (3,), "body lengths/s", -1.0, 1.0, velocity),
            Entry("activation", (m,), "1", 0.0, 1.0, "of the ring muscles at the end of the last step"),
        )
    )


class Outcome(NamedTuple):
    """What an agent gets for a step."""

    observation: Observation
    reward: float
    terminated: bool
    truncated: bool
    info: dict[str, Any]


class Episode:
    """The state of one worm's episode.

    Attributes:
        stopped: Why the simulation of the worm broke down; empty while it goes on.
    """

    def __init__(self, task: Task, worm: WormPlant) -> None:
        """Puts the worm at its start."""
        body, arena = body_and_arena(task.config)
        self.task = task
        self.worm = worm
        self.layout: Layout = layout_of(worm)
        self._route = Route(arena, body.heading_deg)
        self._begin(np.zeros(worm.n_muscles))
        geometry = worm.geometry
        self._weight_N = worm.total_mass_kg * STANDARD_GRAVITY_M_PER_S2
        # Strains are counted from the rest posture.
        self._rest_m = worm.posture.ring_length.copy()
        self._middle_ring = geometry.rings[geometry.n_segments // 2]
        away = geometry.crossings_m[self._middle_ring]
        away = away - away.mean(axis=0)
        # Weights that make of the ring's corners its back and its left side.
        self._outwards = np.stack([away[:, 2], -away[:, 1]])

    def reset(self, random: np.random.Generator) -> tuple[Observation, dict[str, Any]]:
        """Puts the worm at its start, with activations drawn anew; returns the first observation and its info."""
        self._begin(random.uniform(0.0, 1.0, self.worm.n_muscles) * self.task.start_activation)
        self._observation = self._observed(random, self._ring_m, np.zeros(3))
        return self._observation.copy(), {"time_s": 0.0, "travel": 0.0}

    def _begin(self, activation: Array) -> None:
        self.stopped = ""
        self.sensation: Sensation = self.worm.reset(0)
        self._steps = 0
        self.activation = activation
        self._take_stock()
        self._start_m = self._place.along_m
        self._ended = False

    def _take_stock(self) -> None:
        """Notes where the worm is, its rings, and the mean path slid, work lost to friction and work of the muscles."""
        centres = self.worm.posture.crossing.take(self.worm.geometry.rings, axis=0).mean(axis=1)
        self._place, self._middle_m = self._route.place(centres), centres.mean(axis=0)
        self._ring_m = self.sensation.ring_length_m
        touch = self.worm.touch
        self._slid_m, self._slip_loss_J = float(touch.slip_distance.mean()), float(touch.slip_loss.sum())
        self._work_J = float(self.worm.energies.muscle_work.sum())

    def activations(self, action: ArrayLike) -> Array:
        """Returns the activations of every physics step, a ramp from the last action to this, ``(n_moves, n_muscles)``.

        Raises:
            ConfigError: The episode has ended, or the action has another shape or a value out of its range.
        """
        if self._ended:
            raise ConfigError("the episode has ended: call reset() before the next step()")
        wanted = np.asarray(action, dtype=float)
        if wanted.shape != self.activation.shape:
            raise ConfigError(
                f"the action has shape {wanted.shape}: must be {self.activation.shape}, one per ring muscle"
            )
        bad = np.flatnonzero(~((wanted >= -ACTION_SLACK) & (wanted <= 1.0 + ACTION_SLACK)))
        if bad.size:
            raise ConfigError(
                f"action[{bad[0]}] = {wanted[bad[0]]:g}: must be in 0 .. 1; gymnasium.wrappers.ClipAction clips actions"
            )
        share = np.arange(1, self.task.moves_per_step + 1)[:, np.newaxis] / self.task.moves_per_step
        return (1.0 - share) * self.activation + share * np.clip(wanted, 0.0, 1.0)

    def step(self, action: ArrayLike, random: np.random.Generator) -> Outcome:
        """Moves the worm for a step under an action; ``random`` is the sensors' noise.

        Raises:
            ConfigError: As `activations`.
        """
        for activation in self.activations(action):
            try:
                self._observe(self.worm.step(activation))
            except SimulationStopped as stop:
                self._stop(str(stop))
            if self.stopped:
                break
        return self._outcome(action, random)

    def _observe(self, sensation: Sensation) -> None:
        """Takes note of a physics step, and of whether the numbers have run away."""
        whole = (sensation.stretch_m, sensation.ring_length_m, sensation.center_of_mass_m, sensation.contact_force_N)
        finite = all(np.isfinite(part).all() for part in whole)
        reason = self.worm.alarm() if finite else "a length, a position or a force became infinite or NaN"
        if reason:
            self._stop(reason)
        else:
            self.sensation = sensation

    def _stop(self, reason: str) -> None:
        """Takes note that the simulation of the worm broke down."""
        self.stopped = f"at {self.sensation.time_s:.6g} s of simulated time: {reason}"

    def _outcome(self, action: ArrayLike, random: np.random.Generator) -> Outcome:
        """Returns what the agent gets at the end of a step, whose action this was."""
        task, length_m = self.task, self.worm.geometry.length_m
        self._steps += 1
        broke_down = bool(self.stopped)
        before, ring_m, middle_m = self._place, self._ring_m, self._middle_m
        slid_m, slip_loss_J, work_J = self._slid_m, self._slip_loss_J, self._work_J
        if not broke_down:
            self.activation = np.clip(np.asarray(action, dtype=float), 0.0, 1.0)
            self._take_stock()
            self._observation = self._observed(random, ring_m, self._middle_m - middle_m)
        passed = not broke_down and task.goal_m is not None and self._place.along_m >= task.goal_m
        advance_m = self._place.along_m - before.along_m
        deed = Deed(advance_m, self._slid_m - slid_m, self.activation, passed, broke_down)
        terms = reward_terms(deed, task.weights, length_m, task.interval_s)
        info = {
            **terms,
            "time_s": self._steps * task.interval_s,
            "travel": (self._place.along_m - self._start_m) / length_m,
            "muscle_work_J": self._work_J - work_J,
            "slip_loss_J": self._slip_loss_J - slip_loss_J,
            "is_success": passed,
            "stopped": self.stopped,
        }
        terminated = broke_down or passed
        truncated = not terminated and self._steps >= task.steps_per_episode
        self._ended = terminated or truncated
        return Outcome(self._observation.copy(), sum(terms.values()), terminated, truncated, info)

    def _observed(self, random: np.random.Generator, before_m: Array, moved_m: Array) -> Observation:
        """The observation, with the rings' lengths one step before, and what the middle was displaced by since, m."""
        sensed, noise_m, axes = self.sensation, self.task.config.sensor.noise_m, self._place.axes
        stretch_m, ring_m, interval_s = sensed.stretch_m, sensed.ring_length_m, self.task.interval_s
        if noise_m:
            stretch_m = stretch_m + random.normal(0.0, noise_m, stretch_m.shape)
        corners = self.worm.posture.crossing[self._middle_ring]
        sides = self._outwards @ (corners - corners.mean(axis=0))
        return self.layout.packed(
            {
                "ring_strain": ring_m / self._rest_m - 1.0,
                "ring_rate": (ring_m - before_m) / (self._rest_m * interval_s),
                "stretch_strain": stretch_m / sensed.rest_stretch_m - 1.0,
                "touch": sensed.touch_N / self._weight_N,
                "heading": axes @ sensed.heading,
                "upright": sides @ axes[2] / np.sqrt((sides * sides).sum(axis=1)),
                "velocity": axes @ moved_m / (self.worm.geometry.length_m * interval_s),
                "activation": self.activation,
            }
        )

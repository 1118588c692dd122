"""One worm as a Gymnasium environment: ``annelid/Worm-v0``, and in a pipe ``annelid/WormPipe-v0``."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from annelid.draw.camera import view_angles
from annelid.draw.scene import PostureScene
from annelid.environments.observation import Layout, Observation, Place, Route, layout_of
from annelid.environments.task import COARSE, task_of
from annelid.errors import ConfigError, SimulationStopped, require_at_least, suggest
from annelid.morphology import Array
from annelid.protocols import Sensation
from annelid.simulation.worm import WormPlant, body_and_arena

PRESET = "riddle2025-muscles"
INTERVAL_S = 0.12
EPISODE_S = 12.0
START_ACTIVATION = 0.1
RENDER_MODES = ("rgb_array",)
SIZE = (640, 400)
ACTION_SLACK = 1e-6
STANDARD_GRAVITY_M_PER_S2 = 9.80665
"""What the worm's weight is computed with, whatever acts on it."""


class Snapshot(NamedTuple):
    """A worm between two steps."""

    place: Place  # on its route
    middle_m: Array  # mean of its rings' centres, (3,)
    ring_m: Array  # lengths of the ring muscles, (n_muscles,)
    slid_m: float  # mean path that its segments have slid on the ground so far
    slip_loss_J: float  # work lost to friction so far
    work_J: float  # work of the muscles so far


class WormEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A 3D worm whose agent sets the activation of every ring muscle.

    A step lasts ``interval_s``, in which activations go evenly from the last action to this one. The worm is to go
    ahead, or in a pipe along its centre line. docs/environments.md lists the spaces and the terms of the reward.

    Attributes:
        task: What is asked of the worm.
        worm: The plant.
        layout: How observations are laid out; ``layout.named(observation)`` takes one apart.
        sensation: What the worm senses, in full and without noise.
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": round(1 / INTERVAL_S)}  # noqa: RUF012 -- as the base has it

    def __init__(
        self,
        preset: str = PRESET,
        changes: Mapping[str, Any] | None = None,
        *,
        arena: str | None = None,
        fidelity: str | None = COARSE,
        interval_s: float = INTERVAL_S,
        episode_s: float = EPISODE_S,
        weights: Mapping[str, float] | None = None,
        start_activation: float = START_ACTIVATION,
        render_mode: str | None = None,
        camera: str = "isometric",
        width: int = SIZE[0],
        height: int = SIZE[1],
    ) -> None:
        """Builds the worm.

        Args:
            preset: Name of a preset of the 3D worm, or path of a TOML file; its controller is left out.
            changes: Fields of the configuration by dotted path, for example ``{"arena.friction": 0.3}``.
            arena: Name of an arena to put the worm into; None for the preset's own.
            fidelity: How finely the worm is resolved: ``"coarse"``, a level of `annelid.config.LEVELS`, or None for
                the preset's own resolution.
            interval_s: Time of a step, s, a multiple of the physics timestep.
            episode_s: Time after which an episode is truncated, s, a multiple of ``interval_s``.
            weights: What terms of the reward are multiplied by, where not as usual: ``progress``, ``effort``, ``slip``,
                ``success``, ``failure``.
            start_activation: Activations at the start are drawn evenly from 0 to this; the only thing that the seed
                decides, beside the noise of the sensors (``changes={"sensor.noise_m": ..}``).
            render_mode: None, or ``"rgb_array"``.
            camera: View of the pictures, see `annelid.draw.camera.VIEWS_DEG`.
            width: Of the pictures, pixels.
            height: Of the pictures, pixels.

        Raises:
            ConfigError: A name, a field or a value that cannot be.
        """
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ConfigError(f"unknown render_mode {render_mode!r}: {suggest(render_mode, RENDER_MODES)}")
        view_angles(camera)
        require_at_least(1, width=width, height=height)
        self.task = task = task_of(preset, changes, arena, fidelity, interval_s, episode_s, weights, start_activation)
        self.render_mode, self._view = render_mode, (width, height, camera)
        self.metadata = {**self.metadata, "render_fps": round(1 / interval_s) or 1}
        self._scenes: list[PostureScene] = []
        # OpenGL cannot be freed any more once Python is shutting down, and environments are often left open.
        weakref.finalize(self, _close, self._scenes)
        self.worm = worm = WormPlant(task.config)
        self.layout: Layout = layout_of(worm)
        self.observation_space = self.layout.space()
        self.action_space = Box(0.0, 1.0, (worm.n_muscles,), np.float32)
        _, ground = body_and_arena(task.config)
        self._route = Route(ground)
        geometry = worm.geometry
        self._weight_N = worm.total_mass_kg * STANDARD_GRAVITY_M_PER_S2
        self._begin(np.zeros(worm.n_muscles))
        # Strains are counted from the rest posture.
        self._rest_m = worm.posture.ring_length.copy()
        self._middle_ring = geometry.rings[geometry.n_segments // 2]
        away = geometry.crossings_m[self._middle_ring]
        away = away - away.mean(axis=0)
        # Weights that make of the ring's corners its back and its left side.
        self._outwards = np.stack([away[:, 2], -away[:, 1]])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Puts the worm at its start.

        Args:
            seed: Of all that is drawn from now on; None goes on with the present random numbers.
            options: There are none.

        Returns:
            The first observation, and info.

        Raises:
            ConfigError: There are options.
        """
        for name in options or {}:
            raise ConfigError(f"reset() has no option {name!r}: fields are changed where the environment is made")
        super().reset(seed=seed)
        self._begin(self.np_random.uniform(0.0, 1.0, self.worm.n_muscles) * self.task.start_activation)
        self._observation = self._observed(self._now)
        return self._observation.copy(), {"time_s": 0.0, "travel": 0.0}

    def step(self, action: ArrayLike) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Lets the worm move for one interval.

        Args:
            action: Activation of every ring muscle in [0, 1], ``(n_muscles,)``.

        Returns:
            Observation, reward, whether the worm has passed its pipe or its simulation broke down, whether the time is
            up, and info.

        Raises:
            ConfigError: The episode has ended, or the action has another shape or a value out of its range.
        """
        task, length_m, before = self.task, self.worm.geometry.length_m, self._now
        stopped = self._move(self._ramp(action))
        self._n_steps += 1
        if not stopped:
            self._activation = np.clip(np.asarray(action, dtype=float), 0.0, 1.0)
            self._now = self._snapshot()
            self._observation = self._observed(before)
        now = self._now
        passed = not stopped and task.goal_m is not None and now.place.along_m >= task.goal_m
        # Where the simulation broke down, nothing else counts: the worm is where it was.
        weights, per_length_and_s = task.weights, 1.0 / (length_m * task.interval_s)
        effort = 0.0 if stopped else float(np.mean(self._activation * self._activation))
        terms = {
            "reward_progress": weights["progress"] * ((now.place.along_m - before.place.along_m) * per_length_and_s),
            "reward_effort": 0.0 - weights["effort"] * effort,
            "reward_slip": 0.0 - weights["slip"] * ((now.slid_m - before.slid_m) * per_length_and_s),
            "reward_success": weights["success"] * float(passed),
            "reward_failure": 0.0 - weights["failure"] * float(bool(stopped)),
        }
        info = {
            **terms,
            "time_s": self._n_steps * task.interval_s,
            "travel": (now.place.along_m - self._start_m) / length_m,
            "muscle_work_J": now.work_J - before.work_J,
            "slip_loss_J": now.slip_loss_J - before.slip_loss_J,
            "is_success": passed,
            "stopped": stopped,
        }
        terminated = bool(stopped) or passed
        truncated = not terminated and self._n_steps >= task.steps_per_episode
        self._ended = terminated or truncated
        return self._observation.copy(), sum(terms.values()), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Draws the worm as it is now: pixels, ``(height, width, 3)``; None without a render mode.

        Raises:
            RenderingUnavailable: No OpenGL back-end works.
        """
        if self.render_mode is None:
            return None
        if not self._scenes:
            self._scenes.append(PostureScene(self.task.config, *self._view))
        return self._scenes[0].picture(self.worm.coordinates, self._activation, f"{self.sensation.time_s:.2f} s")

    def close(self) -> None:
        """Frees what drew the pictures."""
        _close(self._scenes)

    def _begin(self, activation: Array) -> None:
        self.sensation: Sensation = self.worm.reset(0)
        self._activation = activation
        self._n_steps, self._ended = 0, False
        self._now = self._snapshot()
        self._start_m = self._now.place.along_m

    def _snapshot(self) -> Snapshot:
        worm = self.worm
        centres = worm.posture.crossing.take(worm.geometry.rings, axis=0).mean(axis=1)
        return Snapshot(
            self._route.place(centres),
            centres.mean(axis=0),
            self.sensation.ring_length_m,
            float(worm.touch.slip_distance.mean()),
            float(worm.touch.slip_loss.sum()),
            float(worm.energies.muscle_work.sum()),
        )

    def _ramp(self, action: ArrayLike) -> Array:
        """Returns the activations of every physics step, from the last action to this, ``(n_moves, n_muscles)``."""
        if self._ended:
            raise ConfigError("the episode has ended: call reset() before the next step()")
        wanted, last = np.asarray(action, dtype=float), self._activation
        if wanted.shape != last.shape:
            raise ConfigError(f"the action has shape {wanted.shape}: must be {last.shape}, one per ring muscle")
        bad = np.flatnonzero(~((wanted >= -ACTION_SLACK) & (wanted <= 1.0 + ACTION_SLACK)))
        if bad.size:
            raise ConfigError(
                f"action[{bad[0]}] = {wanted[bad[0]]:g}: must be in 0 .. 1; gymnasium.wrappers.ClipAction clips actions"
            )
        share = np.arange(1, self.task.moves_per_step + 1)[:, np.newaxis] / self.task.moves_per_step
        return (1.0 - share) * last + share * np.clip(wanted, 0.0, 1.0)

    def _move(self, activations: Array) -> str:
        """Takes physics steps; returns why the simulation broke down, or an empty text."""
        for activation in activations:
            sensed = self.sensation
            try:
                sensed = self.worm.step(activation)
                whole = (sensed.stretch_m, sensed.ring_length_m, sensed.center_of_mass_m, sensed.contact_force_N)
                finite = all(np.isfinite(part).all() for part in whole)
                reason = self.worm.alarm() if finite else "a length, a position or a force became infinite or NaN"
            except SimulationStopped as stop:
                reason = str(stop)
            if reason:
                return f"at {self.sensation.time_s:.6g} s of simulated time: {reason}"
            self.sensation = sensed
        return ""

    def _observed(self, before: Snapshot) -> Observation:
        """Returns the observation of the worm as it is now, one step after ``before``."""
        now, sensed, noise_m = self._now, self.sensation, self.task.config.sensor.noise_m
        stretch_m, axes, interval_s = sensed.stretch_m, now.place.axes, self.task.interval_s
        if noise_m:
            stretch_m = stretch_m + self.np_random.normal(0.0, noise_m, stretch_m.shape)
        corners = self.worm.posture.crossing[self._middle_ring]
        sides = self._outwards @ (corners - corners.mean(axis=0))
        moved_m = now.middle_m - before.middle_m
        return self.layout.packed(
            {
                "ring_strain": now.ring_m / self._rest_m - 1.0,
                "ring_rate": (now.ring_m - before.ring_m) / (self._rest_m * interval_s),
                "stretch_strain": stretch_m / sensed.rest_stretch_m - 1.0,
                "touch": sensed.touch_N / self._weight_N,
                "heading": axes @ sensed.heading,
                "upright": sides @ axes[2] / np.sqrt((sides * sides).sum(axis=1)),
                "velocity": axes @ moved_m / (self.worm.geometry.length_m * interval_s),
                "activation": self._activation,
            }
        )


def _close(scenes: list[PostureScene]) -> None:
    while scenes:
        scenes.pop().close()

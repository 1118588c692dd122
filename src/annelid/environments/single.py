"""One worm as a Gymnasium environment: ``annelid/Worm-v0``, and in a pipe ``annelid/WormPipe-v0``."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from annelid.draw.camera import view_angles
from annelid.draw.scene import PostureScene
from annelid.environments.episode import Episode, Layout, Observation
from annelid.environments.task import COARSE, task_of
from annelid.errors import ConfigError, require_at_least, suggest
from annelid.protocols import Sensation
from annelid.simulation.worm import WormPlant

PRESET = "riddle2025-muscles"
INTERVAL_S = 0.12
EPISODE_S = 12.0
START_ACTIVATION = 0.1
RENDER_MODES = ("rgb_array",)
SIZE = (640, 400)


class WormEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A 3D worm whose agent sets the activation of every ring muscle.

    A step lasts ``interval_s``, in which activations go evenly from the last action to this one. The worm is to go
    ahead, or in a pipe along its centre line. docs/environments.md lists the spaces and the terms of the reward.

    Attributes:
        task: What is asked of the worm.
        worm: The plant.
        layout: How observations are laid out; ``layout.named(observation)`` takes one apart.
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
        self.task = task_of(preset, changes, arena, fidelity, interval_s, episode_s, weights, start_activation)
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": round(1 / interval_s) or 1}
        self._pictures = Pictures(render_mode, camera, width, height)
        self.worm: WormPlant = WormPlant(self.task.config)
        self._episode = Episode(self.task, self.worm)
        self.layout: Layout = self._episode.layout
        self.observation_space = self.layout.space()
        self.action_space = Box(0.0, 1.0, (self.worm.n_muscles,), np.float32)

    @property
    def sensation(self) -> Sensation:
        """What the worm senses, in full and without noise."""
        return self._episode.sensation

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
        return self._episode.reset(self.np_random)

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
        return self._episode.step(action, self.np_random)

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Draws the worm as it is now: pixels, ``(height, width, 3)``; None without a render mode.

        Raises:
            RenderingUnavailable: No OpenGL back-end works.
        """
        return None if self.render_mode is None else self._pictures.draw(self._episode)

    def close(self) -> None:
        """Frees what drew the pictures."""
        self._pictures.close()


class Pictures:
    """Draws a worm as it is now."""

    def __init__(self, mode: str | None, camera: str, width: int, height: int) -> None:
        """Keeps how they are to be drawn; `AnnelidError` for what cannot be."""
        if mode is not None and mode not in RENDER_MODES:
            raise ConfigError(f"unknown render_mode {mode!r}: {suggest(mode, RENDER_MODES)}")
        view_angles(camera)
        require_at_least(1, width=width, height=height)
        self._camera, self._width, self._height = camera, width, height
        self._scenes: list[PostureScene] = []
        # OpenGL cannot be freed any more once Python is shutting down, and environments are often left open.
        weakref.finalize(self, _close, self._scenes)

    def draw(self, episode: Episode) -> NDArray[np.uint8]:
        """Draws a worm: pixels, ``(height, width, 3)``."""
        if not self._scenes:
            self._scenes.append(PostureScene(episode.task.config, self._width, self._height, self._camera))
        caption = f"{episode.sensation.time_s:.2f} s"
        return self._scenes[0].picture(episode.worm.qpos, episode.activation, caption)

    def close(self) -> None:
        """Frees what was opened."""
        _close(self._scenes)


def _close(scenes: list[PostureScene]) -> None:
    while scenes:
        scenes.pop().close()

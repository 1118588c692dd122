"""Many worms as one Gymnasium vector environment, stepped on a few threads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from annelid.environments import single
from annelid.environments.episode import Episode, Layout, Observation
from annelid.environments.single import Pictures, WormEnv, action_space, refuse_options
from annelid.environments.task import COARSE, Task, task_of
from annelid.errors import ConfigError, SimulationStopped, require_at_least, suggest
from annelid.morphology import Array
from annelid.protocols import Sensation
from annelid.simulation.anatomy import Anatomy
from annelid.simulation.batch import checked_configs, compile_worms, threads_for
from annelid.simulation.worm import WormPlant

Flags = NDArray[np.bool_]


class WormVectorEnv(VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """Worms that are each, bit for bit, a `WormEnv`; one that breaks down ends alone.

    Args:
        num_envs: Number of worms.
        changes: As for `WormEnv`, or one mapping for each worm; they may differ in all that `annelid.simulate_batch`
            lets differ, friction and stiffness among them.
        autoreset_mode: When a worm that has ended begins anew: ``"NextStep"``, ``"SameStep"`` or ``"Disabled"``, as
            `gymnasium.vector.AutoresetMode` says.
        threads: Threads that step the worms; by default as many as there are processors.
        **others: As for `WormEnv`; with a render mode, `render` gives a picture of every worm.

    Attributes:
        tasks: What is asked of every worm.
        layout: How an observation is laid out; ``layout.named(observations)`` takes those of all worms apart.

    Raises:
        ConfigError: A name, a field or a value that cannot be, or worms that do not fit into one batch.
    """

    closed = True
    """Until it is whole, since Gymnasium closes even what could not be made."""

    def __init__(
        self,
        num_envs: int = 1,
        preset: str = single.PRESET,
        changes: Mapping[str, Any] | Sequence[Mapping[str, Any]] | None = None,
        *,
        arena: str | None = None,
        fidelity: str | None = COARSE,
        interval_s: float = single.INTERVAL_S,
        episode_s: float = single.EPISODE_S,
        weights: Mapping[str, float] | None = None,
        start_activation: float = single.START_ACTIVATION,
        render_mode: str | None = None,
        camera: str = "isometric",
        width: int = single.SIZE[0],
        height: int = single.SIZE[1],
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
    ) -> None:
        require_at_least(1, num_envs=num_envs)
        given = [changes] * num_envs if changes is None or isinstance(changes, Mapping) else list(changes)
        if len(given) != num_envs:
            raise ConfigError(f"changes has {len(given)} mappings for num_envs = {num_envs}: give one for each, or one")
        self.tasks: list[Task] = [
            task_of(preset, own, arena, fidelity, interval_s, episode_s, weights, start_activation) for own in given
        ]
        self.num_envs = num_envs
        names = [mode.value for mode in AutoresetMode]
        if not isinstance(autoreset_mode, AutoresetMode) and autoreset_mode not in names:
            raise ConfigError(f"unknown autoreset_mode {autoreset_mode!r}: {suggest(autoreset_mode, names)}")
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.render_mode = render_mode
        fps = round(1 / interval_s) or 1
        self.metadata = {**WormEnv.metadata, "render_fps": fps, "autoreset_mode": self.autoreset_mode}
        self._pictures = Pictures(render_mode, camera, width, height)
        anatomies = compile_worms(checked_configs([task.config for task in self.tasks], None, None))
        shares = np.array_split(np.arange(num_envs), threads_for(num_envs, threads))
        self._teams = [_Team(list(map(int, share)), self.tasks, anatomies) for share in shares]
        self._episodes: list[Episode] = [episode for team in self._teams for episode in team.episodes]
        self._pool = ThreadPoolExecutor(len(self._teams)) if len(self._teams) > 1 else None
        first = self._episodes[0]
        self.layout: Layout = first.layout
        self.single_observation_space = self.layout.space()
        self.single_action_space = action_space(first.worm)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._random = [seeding.np_random()[0] for _ in range(num_envs)]
        self._observations = np.zeros((num_envs, self.layout.size), dtype=np.float32)
        self._ended = np.ones(num_envs, dtype=bool)
        self.closed = False

    @property
    def sensations(self) -> list[Sensation]:
        """What every worm senses, in full and without noise."""
        return [episode.sensation for episode in self._episodes]

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Puts worms at their start.

        Args:
            seed: Of the first worm, the others have the numbers after it; or one for each worm; None goes on with the
                present random numbers.
            options: ``{"reset_mask": mask}`` resets only the worms whose place in the mask, ``(num_envs,)``, is true.

        Returns:
            The observations of all worms, ``(num_envs, size)``, and info of those that were reset.

        Raises:
            ConfigError: Seeds, mask or options that cannot be.
        """
        options = dict(options or {})
        n = self.num_envs
        mask = options.pop("reset_mask", None)
        mask = np.ones(n, dtype=bool) if mask is None else mask
        if not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (n,) and mask.any()):
            raise ConfigError(f"reset_mask must be an array of truth values of shape ({n},) with at least one true")
        refuse_options(options)
        if seed is not None:
            seeds = [seed + row for row in range(n)] if isinstance(seed, int | np.integer) else list(seed)
            if len(seeds) != n:
                raise ConfigError(f"seed has {len(seeds)} numbers for num_envs = {n}: give one for each")
            for row, own in enumerate(seeds):
                if mask[row] and own is not None:
                    self._random[row] = seeding.np_random(own)[0]
        infos: dict[str, Any] = {}
        for row in map(int, np.flatnonzero(mask)):
            infos = self._add_info(infos, self._restart(row), row)
        self._ended[mask] = False
        return self._observations.copy(), infos

    def step(self, actions: ArrayLike) -> tuple[Observation, Array, Flags, Flags, dict[str, Any]]:
        """Lets all worms move for one interval.

        Args:
            actions: Activations in [0, 1], ``(num_envs, n_muscles)``.

        Returns:
            Observations, rewards, terminations, truncations and infos, as of so many `WormEnv`.

        Raises:
            ConfigError: Actions of another shape or out of their range, or a worm that has ended and is not reset.
        """
        actions = np.asarray(actions, dtype=float)
        if actions.shape != self.action_space.shape:
            raise ConfigError(f"the actions have shape {actions.shape}: must be {self.action_space.shape}")
        restarted = self._ended & (self.autoreset_mode is AutoresetMode.NEXT_STEP)
        ramps = {row: self._episodes[row].activations(actions[row]) for row in map(int, np.flatnonzero(~restarted))}
        if self._pool is None:
            self._teams[0].move(ramps)
        else:
            list(self._pool.map(lambda team: team.move(ramps), self._teams))
        rewards, terminated, truncated = np.zeros(self.num_envs), *np.zeros((2, self.num_envs), dtype=bool)
        infos: dict[str, Any] = {}
        for row, episode in enumerate(self._episodes):
            if restarted[row]:
                infos = self._add_info(infos, self._restart(row), row)
                continue
            outcome = episode.outcome(actions[row], self._random[row])
            self._observations[row], rewards[row], terminated[row], truncated[row], info = outcome
            if (terminated[row] or truncated[row]) and self.autoreset_mode is AutoresetMode.SAME_STEP:
                infos = self._add_info(infos, {"final_obs": outcome.observation, "final_info": info}, row)
                info = self._restart(row)
            infos = self._add_info(infos, info, row)
        self._ended = terminated | truncated
        return self._observations.copy(), rewards, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Draws every worm as it is now: pixels, ``(height, width, 3)`` each; None without a render mode.

        Raises:
            RenderingUnavailable: No OpenGL back-end works.
        """
        if self.render_mode is None:
            return None
        return tuple(self._pictures.draw(episode) for episode in self._episodes)

    def close_extras(self, **_: Any) -> None:
        """Ends the threads and frees what drew the pictures."""
        self._pictures.close()
        if self._pool is not None:
            self._pool.shutdown()

    def _restart(self, row: int) -> dict[str, Any]:
        """Puts one worm at its start and returns its info."""
        self._observations[row], info = self._episodes[row].reset(self._random[row])
        return info


class _Team:
    """Worms that one thread steps; the engine does so without Python's lock."""

    def __init__(self, numbers: Sequence[int], tasks: Sequence[Task], anatomies: Sequence[Anatomy]) -> None:
        """Builds the bodies of the worms with these numbers."""
        self._first = numbers[0]
        self.episodes = [Episode(tasks[one], WormPlant(tasks[one].config, anatomies[one])) for one in numbers]

    def move(self, ramps: Mapping[int, Array]) -> None:
        """Takes the physics steps of one step of the environment.

        Given are the activations of every physics step by number of the worm, ``(n_steps, n_muscles)`` each; worms of
        other teams are among them.
        """
        for row, episode in enumerate(self.episodes, start=self._first):
            for activation in ramps.get(row, ()):
                if episode.stopped:
                    break
                try:
                    episode.observe(episode.worm.step(activation))
                except SimulationStopped as stopped:
                    episode.stop(str(stopped))

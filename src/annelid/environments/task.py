"""What an environment asks of its worm: which body, where, how often it acts, for how long, and a step's reward."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from annelid.body import worm_of
from annelid.config import LEVELS, Clock, RunConfig, load_config
from annelid.errors import ConfigError, require_at_least, require_positive, suggest

COARSE = "coarse"
COARSE_BASE = "fast"
COARSE_CHANGES: Mapping[str, Any] = {"body.mesh.elements_per_side": 1, "clock.physics_timestep_s": 0.02}
"""The default resolution: level `fast` with 0.43 of its coordinates and twice its step; docs/evidence/environments.md
has its cost."""
FIDELITIES = (COARSE, *LEVELS)
UNUSED = ("controller", "turning", "record", "duration", "seed", "clock.control")
"""Beginnings of fields that an environment has no use for: the agent acts, and nothing is recorded."""
_WITHOUT_CONTROLLER = {"controller": {"kind": "sns"}, "turning": None}


WEIGHTS: Mapping[str, float] = {"progress": 1.0, "effort": 0.05, "slip": 0.1, "success": 10.0, "failure": 10.0}
"""What each term of the reward is multiplied by, by its name; docs/environments.md defines the terms."""


@dataclass(frozen=True)
class Task:
    """One worm's task."""

    config: RunConfig  # body, arena, sensors and guard; both clocks are those of the physics
    moves_per_step: int  # physics steps in a step of the environment
    steps_per_episode: int  # steps of the environment until the time is up
    weights: Mapping[str, float]  # of the terms of the reward
    start_activation: float  # largest activation that a ring may have at the start
    goal_m: float | None  # arc length of the pipe at which the worm's middle has passed; None on open ground

    @property
    def interval_s(self) -> float:
        """Time of a step of the environment, s."""
        return self.moves_per_step * self.config.clock.physics_timestep_s


def task_of(
    preset: str,
    changes: Mapping[str, Any] | None,
    arena: str | None,
    fidelity: str | None,
    interval_s: float,
    episode_s: float,
    weights: Mapping[str, float] | None,
    start_activation: float,
) -> Task:
    """Checks what a user asks of an environment; takes and raises what `annelid.environments.WormEnv` does."""
    require_positive(interval_s=interval_s, episode_s=episode_s)
    if not 0.0 <= start_activation <= 1.0:
        raise ConfigError(f"start_activation = {start_activation}: must be in 0 .. 1")
    config = _worm(preset, changes or {}, arena, fidelity)
    physics_s = config.clock.physics_timestep_s
    moves = _whole("interval_s", interval_s, "clock.physics_timestep_s", physics_s)
    steps = _whole("episode_s", episode_s, "interval_s", interval_s)
    config = config.model_copy(update={"clock": Clock(control_timestep_s=physics_s, physics_timestep_s=physics_s)})
    for name, value in (weights or {}).items():
        if name not in WEIGHTS:
            raise ConfigError(f"unknown weight {name!r}: {suggest(name, WEIGHTS)}")
        require_at_least(0.0, **{f"weights[{name!r}]": value})
    # The middle of a worm has passed a pipe behind all that bends or narrows, else a body length on.
    reach_m = config.arena.reach_m() if config.arena is not None else None
    goal_m = None if reach_m is None else reach_m[1] or worm_of(config).geometry().length_m
    return Task(config, moves, steps, {**WEIGHTS, **(weights or {})}, float(start_activation), goal_m)


def _worm(preset: str, changes: Mapping[str, Any], arena: str | None, fidelity: str | None) -> RunConfig:
    """Loads the worm, whatever the preset's own controller is."""
    for path in changes:
        if path.startswith(UNUSED) or (path.startswith("sensor.") and not path.startswith("sensor.noise")):
            raise ConfigError(f"changes[{path!r}] has no effect in an environment, where the agent acts on the muscles")
    if fidelity is not None and fidelity not in FIDELITIES:
        raise ConfigError(f"unknown fidelity {fidelity!r}: {suggest(fidelity, FIDELITIES)}")
    coarse = fidelity == COARSE
    config = load_config(
        preset,
        {**_WITHOUT_CONTROLLER, **(COARSE_CHANGES if coarse else {}), **changes},
        fidelity=COARSE_BASE if coarse else fidelity,
        arena=arena,
    )
    worm_of(config)
    return config


def _whole(name: str, value: float, unit_name: str, unit: float) -> int:
    """Returns how many times one time goes into another, which must be a whole number."""
    ratio = value / unit
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6 * ratio:
        near = max(1, round(ratio)) * unit
        raise ConfigError(
            f"{name} = {value:g}: must be an integer multiple of {unit_name} = {unit:g}, for example {near:g}"
        )
    return round(ratio)

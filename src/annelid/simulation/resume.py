"""Where a continued run takes off: the state, the configuration and the name of the run before it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from annelid.config import RunConfig
from annelid.errors import ConfigError
from annelid.simulation.checkpoint import Checkpoint
from annelid.simulation.runfile import FILE_NAME, Run, read_checkpoint, read_config

_FREE = frozenset({"duration_s", "record", "name", "summary", "published"})


@dataclass(frozen=True, slots=True)
class Origin:
    """The run that is continued.

    Attributes:
        path: Its file.
        config: Its configuration.
        checkpoint: Its last checkpoint.
    """

    path: Path
    config: RunConfig
    checkpoint: Checkpoint

    @property
    def time_s(self) -> float:
        """Simulated time of the checkpoint, s."""
        return self.checkpoint.step * self.config.clock.control_timestep_s

    def attrs(self) -> dict[str, Any]:
        """Returns the global attributes that name it in the file of the run that goes on."""
        return {"resumed_from": f"{self.path.resolve().parent.name}/{self.path.name}", "resumed_at_s": self.time_s}


def origin_of(run: Run | str | Path) -> Origin:
    """Reads what is needed to continue a run.

    Raises:
        RunFileError: It is no readable run, or has no checkpoint.
    """
    path = Path(run.path if isinstance(run, Run) else run)
    if path.is_dir():
        path /= FILE_NAME
    return Origin(path, read_config(path), read_checkpoint(path))


def continued_config(config: RunConfig | None, origin: Origin, out: Path) -> RunConfig:
    """Checks that a configuration continues a run, and returns it (that run's own if there is none).

    ``duration_s`` counts from time zero of the first run, so it must lie beyond the checkpoint.

    Raises:
        ConfigError: It differs in more than the duration, the recording and the name, ends before the
            checkpoint, or ``out`` is the folder of the run that is continued.
    """
    if out.resolve() == origin.path.resolve().parent:
        raise ConfigError(f"the output folder {out} holds the run to continue: name another")
    config = config or origin.config
    changed = _differences(_fixed(config), _fixed(origin.config))
    if changed:
        raise ConfigError(
            f"a continued run may differ in duration_s, record and name only, but {', '.join(changed)} "
            f"differs from {origin.path}"
        )
    if round(config.duration_s / config.clock.control_timestep_s) <= origin.checkpoint.step:
        raise ConfigError(
            f"duration_s = {config.duration_s:g} does not go beyond the {origin.time_s:g} s that {origin.path} "
            "holds already; it counts from time zero of the first run"
        )
    return config


def _fixed(config: RunConfig) -> dict[str, Any]:
    return config.model_dump(mode="json", exclude=set(_FREE))


def _differences(new: Mapping[str, Any], old: Mapping[str, Any], prefix: str = "") -> list[str]:
    found: list[str] = []
    for key in sorted({*new, *old}):
        ours, theirs = new.get(key), old.get(key)
        if isinstance(ours, Mapping) and isinstance(theirs, Mapping):
            found += _differences(ours, theirs, f"{prefix}{key}.")
        elif ours != theirs:
            found.append(f"{prefix}{key}")
    return found

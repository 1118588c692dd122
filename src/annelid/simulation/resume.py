"""How a run goes on from the last checkpoint of another: what is read of it, and in what it may differ."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from annelid.config import RunConfig, field_value, fields_of
from annelid.errors import ConfigError, RunFileError
from annelid.simulation.checkpoint import Checkpoint
from annelid.simulation.runfile import ACTED, Run, config_in, read_attributes, read_checkpoint

_FREE = frozenset({"duration_s", "record", "name", "summary", "published"})
"""Fields in which a continued run may differ from the one before it."""


@dataclass(frozen=True, slots=True)
class Origin:
    """The run that is continued: its file, its configuration, and its last checkpoint."""

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
    """Reads what is needed to continue a run; raises as `read_checkpoint`, and where a gone field acted in it."""
    path, attrs = read_attributes(run.path if isinstance(run, Run) else run)
    if acted := attrs.get(ACTED):
        raise RunFileError(f"{path} cannot be continued: {acted} acted in it, which is gone; run it anew")
    return Origin(path, config_in(path, attrs), read_checkpoint(path))


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
    ours, theirs = (
        {path: field_value(each, path) for path in fields_of(each) if path.partition(".")[0] not in _FREE}
        for each in (config, origin.config)
    )
    changed = sorted(path for path in ours.keys() | theirs.keys() if ours.get(path) != theirs.get(path))
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

"""A case: one run of a study, described by its preset and what is changed in it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from annelid.config import RunConfig, load_config, toml_value
from annelid.config.loading import seen_from
from annelid.output import write_text
from annelid.textfiles import nested, toml_text

SHEAR_OVER_YOUNG = 1.0 / 1.5
"""G/E of the paper's strands (0.2 and 0.3 GPa) and of the authors' later model's (1.33 and 2 GPa)."""

# Samples and postures of a study's runs: enough for its numbers and for a picture at 1.5 s, a tenth of the disk.
_SAMPLES_S, _FRAMES_S = 0.01, 0.5


@dataclass(frozen=True)
class Case:
    """One run of a study.

    Attributes:
        preset: The preset or TOML file that it starts from.
        changes: Fields that differ from it, by their dotted paths.
        base: A configuration that it starts from instead, recorded as that says; ``preset`` is then its name.
    """

    preset: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    base: RunConfig | None = None

    @cached_property
    def config(self) -> RunConfig:
        """Its configuration; a preset's is sparsely recorded unless the case says otherwise."""
        if self.base is not None:
            return load_config(self.base.model_dump(exclude_none=True), dict(self.changes))
        config = load_config(self.preset, dict(self.changes))
        if any(path.startswith("record.") for path in self.changes):
            return config
        # Whole numbers of control steps, which worms of one's own size have of other lengths.
        samples_s = _multiple(_SAMPLES_S, config.clock.control_timestep_s)
        frames_s = _multiple(_FRAMES_S, samples_s)
        sparse = {"record.signals_interval_s": samples_s, "record.frames_interval_s": frames_s}
        return load_config(config.model_dump(), sparse)

    @property
    def stem(self) -> str:
        """Beginning of its folder's name: the preset's name, or the file's."""
        return "run" if self.base is not None else Path(self.preset).name.removesuffix(".toml")

    @property
    def command(self) -> str:
        """The command line that makes the same run, but for what is recorded of it."""
        changes = ((path, value) for path, value in self.changes.items() if not path.startswith("record."))
        words = [f"--set {shlex.quote(f'{path}={toml_value(value)}')}" for path, value in changes]
        return " ".join(["annelid run", self.preset, *words])

    @property
    def cost_s(self) -> float:
        """About how long the run takes on one core, s: for the order of the runs and the progress bar."""
        steps = self.config.duration_s / self.config.clock.physics_timestep_s
        return steps * self.config.body.step_cost_ms / 1e3

    def but(self, changes: Mapping[str, Any]) -> Case:
        """Returns the case with further changes."""
        return replace(self, changes={**self.changes, **changes})


def _multiple(interval_s: float, of_s: float) -> float:
    """The multiple of a step that is nearest to an interval, at least one."""
    return round(max(1, round(interval_s / of_s)) * of_s, 12)


def write_worm(path: Path, source: str, fields: Mapping[str, Any], heading: Sequence[str]) -> None:
    """Writes a worm as a file that ``annelid run`` takes: the preset or file that it extends, and what differs.

    Fields are given by their dotted paths; the heading are lines of a comment.

    Args:
        path: The file.
        source: The preset or file that it extends.
        fields: What differs, by dotted path.
        heading: Lines of a comment above.
    """
    base = seen_from(Path.cwd(), source)
    write_text(path, toml_text({"extends": base, **nested(fields)}, "\n".join(heading)))

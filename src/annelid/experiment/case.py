"""A case: one run of a study, told by its preset and what is changed in it."""

from __future__ import annotations

import shlex
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from annelid.body.worm import WormBody
from annelid.config import RunConfig, load_config, toml_value
from annelid.errors import ConfigError
from annelid.plausibility import refuse_nonsense

SHEAR_OVER_YOUNG = 1.0 / 1.5
"""G/E of the paper's strands (0.2 and 0.3 GPa) and of the authors' later model's (1.33 and 2 GPa)."""

# Samples and postures of a study's runs: enough for its numbers and for a picture at 1.5 s, a tenth of the disk.
_SPARSE = {"record.signals_interval_s": 0.01, "record.frames_interval_s": 0.5}

# Milliseconds of one core for each evaluation of the dynamics, only to start the longest runs first.
_PLANAR_STEP_MS = 0.05


class Work(ABC):
    """One run that a store computes and keeps."""

    @property
    @abstractmethod
    def stem(self) -> str:
        """What the name of its folder begins with."""

    @property
    @abstractmethod
    def command(self) -> str:
        """The command line that makes it."""

    @abstractmethod
    def configured(self) -> RunConfig:
        """Makes its configuration."""

    @cached_property
    def config(self) -> RunConfig:
        """Its configuration."""
        return self.configured()

    @property
    def cost_s(self) -> float:
        """About how long the run takes on one core, s: for the order of the runs and the progress bar."""
        body, clock = self.config.body, self.config.clock
        evaluations = self.config.duration_s / clock.physics_timestep_s
        if not isinstance(body, WormBody):
            return evaluations * _PLANAR_STEP_MS / 1e3
        size = body.mesh.n_segments / 3 * body.mesh.elements_per_side / 3
        return evaluations * size * body.formulation.step_cost_ms / 1e3


@dataclass(frozen=True)
class Case(Work):
    """One run of a study.

    Attributes:
        preset: The preset that it starts from.
        changes: Fields that differ from it, by their dotted paths.
    """

    preset: str
    changes: Mapping[str, Any] = field(default_factory=dict)

    def configured(self) -> RunConfig:
        """Makes its configuration; sparsely recorded unless the case says otherwise."""
        config = load_config(self.preset, dict(self.changes))
        if any(path.startswith("record.") for path in self.changes):
            return config
        return load_config(config.model_dump(), _SPARSE)

    @property
    def stem(self) -> str:
        """What the name of its folder begins with: the preset's name, or the file's."""
        return Path(self.preset).name.removesuffix(".toml")

    @property
    def command(self) -> str:
        """The command line that makes the same run."""
        return run_command(self.preset, self.changes)

    def but(self, changes: Mapping[str, Any]) -> Case:
        """Returns the case with further changes."""
        return Case(self.preset, {**self.changes, **changes})


def refusal(case: Work) -> ConfigError | None:
    """Returns why a case's configuration is refused; None if it is not."""
    try:
        refuse_nonsense(case.config)
    except ConfigError as error:
        return error
    return None


def run_command(preset: str, changes: Mapping[str, Any]) -> str:
    """Returns the command line that runs a preset or file with changes, but for those of the record."""
    told = {path: value for path, value in changes.items() if not path.startswith("record.")}
    words = [f"--set {shlex.quote(f'{path}={toml_value(value)}')}" for path, value in told.items()]
    return " ".join(["annelid run", preset, *words])

"""The tasks of the benchmark, frozen as data with a version, and the entrants: which run each pair of them makes.

Both are TOML, ``tasks.toml`` and ``entrants.toml``; their comments describe the fields. A draw is a function of the
version, the task's name and a seed. Seeds below `FIRST_TEST_SEED` are for training, the others for tests.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, Self
from zlib import crc32

import numpy as np
from pydantic import model_validator

from annelid.config import Section, check_section
from annelid.control import own_controller
from annelid.errors import ConfigError, suggest
from annelid.experiment import Case
from annelid.textfiles import read_toml

REFERENCE = "timed"
"""The entrant that the others are compared with: a wave by the clock, tuned once."""
FIRST_TEST_SEED = 1000
QUICK_TASKS, QUICK_ENTRANTS = ("flat-middle", "slope", "noise"), (REFERENCE, "sine", "sns")
QUICK_DRAWS, QUICK_DURATION_S = 2, 8.0
DIGITS = 4
"""Significant digits of what is drawn."""


class Range(Section):
    """What a number is drawn from."""

    low: float
    high: float
    log: bool = False
    either_side: bool = False

    def draw(self, rng: np.random.Generator) -> float:
        """Draws a number."""
        share, sign = rng.random(), rng.choice((-1.0, 1.0))
        value = self.low * (self.high / self.low) ** share if self.log else self.low + (self.high - self.low) * share
        return float(f"{value * (sign if self.either_side else 1.0):.{DIGITS}g}")


class Task(Section):
    """A task, as its table in ``tasks.toml``."""

    summary: str
    goal: Literal["ahead", "pipe", "heading"] = "ahead"
    event_s: float | None = None
    set: Mapping[str, Any] = {}
    draw: Mapping[str, Range] = {}


class Tasks(Section):
    """All tasks, and what they share."""

    version: int
    preset: str
    settling_s: float
    friction_spread: float
    set: Mapping[str, Any]
    tasks: Mapping[str, Task]

    def drawn(self, name: str, seed: int) -> dict[str, float]:
        """Returns the fields that are drawn for a seed of a task."""
        task = self.tasks[name]
        rng = np.random.default_rng([self.version, crc32(name.encode()), seed])
        drawn = {field: among.draw(rng) for field, among in task.draw.items()}
        friction = drawn["arena.friction"] if "arena.friction" in drawn else {**self.set, **task.set}["arena.friction"]
        spread = Range(low=1.0 - self.friction_spread, high=1.0 + self.friction_spread)
        return {**drawn, "arena.friction": float(f"{friction * spread.draw(rng):.{DIGITS}g}")}


class Entrant(Section):
    """An entrant, as its table in a file."""

    summary: str = ""
    controller: Mapping[str, Any]
    per_segment: Mapping[str, float] = {}
    tuned_on: tuple[int, ...] | Mapping[str, tuple[int, ...]] = ()

    @model_validator(mode="after")
    def _tuned_on_training_seeds(self) -> Self:
        by_task = self.tuned_on if isinstance(self.tuned_on, Mapping) else {"all tasks": self.tuned_on}
        test_seeds = {task: [seed for seed in seeds if seed >= FIRST_TEST_SEED] for task, seeds in by_task.items()}
        if named := "; ".join(f"{task}: {', '.join(map(str, seeds))}" for task, seeds in test_seeds.items() if seeds):
            raise ValueError(f"tuned_on has test seeds ({named}): tune on seeds below {FIRST_TEST_SEED}")
        return self

    def fields(self, n_segments: int) -> dict[str, Any]:
        """Returns its controller for a number of segments."""
        return {**self.controller, **{field: n_segments * value for field, value in self.per_segment.items()}}


@dataclass(frozen=True)
class Entry:
    """One entrant at one task with one draw."""

    entrant: str  # Its name
    task: str  # Name of the task
    seed: int  # Of the draw
    drawn: str  # What was drawn, as text
    segments: int  # Of the worm
    case: Case  # Its run

    @property
    def setup(self) -> str:
        """Digest of what the task and the entrant set, whatever code runs it."""
        text = json.dumps([self.case.preset, dict(self.case.changes)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def all_tasks() -> Tasks:
    """Reads the tasks."""
    return check_section(Tasks, read_toml(_file("tasks.toml")))


@cache
def _own_entrants() -> Mapping[str, Entrant]:
    return read_entrants(_file("entrants.toml"))


def _file(name: str) -> Path:
    return Path(str(files("annelid_studies") / "challenge" / name))


def read_entrants(path: Path) -> dict[str, Entrant]:
    """Reads a file of entrants, a table each.

    Raises:
        ConfigError: It cannot be read, a field is unknown, or an entrant was tuned on test seeds.
    """
    found = {}
    for name, fields in read_toml(path, "the file of entrants").items():
        if not isinstance(fields, Mapping):
            raise ConfigError(f"{path}: {name} is no table: an entrant is a table [NAME] with its controller")
        try:
            found[name] = check_section(Entrant, fields)
        except ConfigError as error:
            raise ConfigError(f"{path}, entrant {name}: {error}") from None
    return found


def find_entrants(names: Sequence[str]) -> dict[str, Entrant]:
    """Finds entrants, the reference first.

    Args:
        names: Each one of ``entrants.toml``, the path of a file like it, or ``module:name`` of a controller of one's
            own; none for all of annelid's.

    Raises:
        ConfigError: One is unknown, cannot be read, or two bear one name.
    """
    own = _own_entrants()
    found = {REFERENCE: own[REFERENCE]}
    for name in names or own:
        if name.endswith(".toml"):
            new = read_entrants(Path(name))
        elif ":" in name:
            new = {name: Entrant(summary="a user's own", controller={"kind": own_controller(name)})}
        elif name in own:
            new = {name: own[name]}
        else:
            raise ConfigError(f"unknown entrant {name!r}: {suggest(name, own)}")
        if taken := [each for each in new if new[each] != {**own, **found}.get(each, new[each])]:
            raise ConfigError(f"{name}: there is another entrant {taken[0]!r} already; give yours a name of its own")
        found |= new
    return found


def entries(
    entrants: Mapping[str, Entrant],
    names: Sequence[str],
    seeds: Sequence[int],
    *,
    finer: int = 1,
    duration_s: float | None = None,
) -> list[Entry]:
    """Lays out the runs of entrants at tasks.

    Args:
        entrants: By their names.
        names: Of the tasks; none for all.
        seeds: Of the draws.
        finer: How many times as short the bodies' steps are.
        duration_s: How long every run lasts; None for each task's own time.

    Raises:
        ConfigError: A task is unknown.
    """
    found = all_tasks()
    for name in names:
        if name not in found.tasks:
            raise ConfigError(f"unknown task {name!r}: {suggest(name, found.tasks)}")
    made = []
    for name in names or found.tasks:
        shared = {**found.set, **found.tasks[name].set}
        if finer != 1:
            shared["clock.physics_timestep_s"] = round(shared["clock.physics_timestep_s"] / finer, 9)
        if duration_s is not None:
            shared["duration_s"] = duration_s
        segments = int(shared.get("body.mesh.n_segments", 3))
        for seed in seeds:
            drawn = found.drawn(name, seed)
            changes, listed = {**shared, **drawn, "seed": seed}, " ".join(f"{name}={x:g}" for name, x in drawn.items())
            for entrant, its in entrants.items():
                case = Case(found.preset, {**changes, "controller": its.fields(segments)})
                made.append(Entry(entrant, name, seed, listed, segments, case))
    return made

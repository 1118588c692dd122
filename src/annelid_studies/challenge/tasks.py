"""The tasks of the benchmark, frozen as data with a version, and the entrants: which run each pair of them makes.

They are TOML: ``tasks.toml``, ``entrants.toml``, of which the comments describe the fields, and ``policy.toml``, which
`learning.train` wrote. A draw is a function of the version, the task's name and a seed, so that all entrants and both
bodies have the same. Seeds below `FIRST_TEST_SEED` are for training, the others for tests.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, Self
from zlib import crc32

import numpy as np
from pydantic import model_validator

from annelid.config import Section, check_section, load_config
from annelid.control import own_controller
from annelid.errors import ConfigError, suggest
from annelid.experiment import Case
from annelid.textfiles import read_toml

REFERENCE = "timed"
"""The entrant that the others are compared with: a wave by the clock, tuned once for each body."""
FIRST_TEST_SEED = 1000
QUICK_TASKS, QUICK_ENTRANTS, QUICK_BODIES = ("level", "slope"), (REFERENCE, "discrete", "sns"), ("three",)
QUICK_DRAWS, QUICK_DURATION_S = 2, 6.0
HALF_OF = 8
"""One in so many draws is run at half the step, too."""
DIGITS = 4
"""Significant digits of what is drawn."""
MAY_SET = ("controller", "sensor.tolerance_m", "sensor.hysteresis_m")
"""What an entrant may set: its controller, and the threshold of its stretch sensors."""


class Range(Section):
    """What a number is drawn from, or searched in."""

    low: float
    high: float
    log: bool = False
    whole: bool = False

    def draw(self, rng: np.random.Generator) -> float:
        """Draws a number."""
        return self.at(rng.random())

    def at(self, share: float) -> float:
        """Returns the number at a share of the range."""
        value = self.low * (self.high / self.low) ** share if self.log else self.low + (self.high - self.low) * share
        return float(f"{value:.{DIGITS}g}")


class Body(Section):
    """A body, as its table in ``tasks.toml``."""

    summary: str
    preset: str
    set: Mapping[str, Any] = {}


class Task(Section):
    """A task, as its table in ``tasks.toml``."""

    summary: str
    goal: Literal["ahead", "pipe"] = "ahead"
    set: Mapping[str, Any] = {}
    draw: Mapping[str, Range] = {}


class Tasks(Section):
    """All tasks and bodies, and what they share."""

    version: int
    settling_s: float
    friction_spread: float
    set: Mapping[str, Any]
    bodies: Mapping[str, Body]
    tasks: Mapping[str, Task]

    @property
    def walking(self) -> list[str]:
        """Names of the tasks of walking on open ground, which bodies of other kinds can be given."""
        fields = {name: {*task.set, *task.draw} for name, task in self.tasks.items() if task.goal == "ahead"}
        return [name for name, own in fields.items() if all(field.startswith("arena.") for field in own)]

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
    preset: str | None = None
    """A body of its own, for the tasks of walking: a preset, or a TOML or MJCF file beside the entrant's."""
    controller: Mapping[str, Any]
    on: Mapping[str, Mapping[str, Any]] = {}
    """Fields by their dotted path, for a body (``three``) or for a task on a body (``three/slope``)."""
    vary: Mapping[str, Range] = {}
    """What was searched, and `tuning.tune` searches."""
    each_task: bool = False
    """Whether it was tuned for each task."""
    tuned_on: tuple[int, ...] = ()

    @model_validator(mode="after")
    def _tuned_on_training_seeds(self) -> Self:
        if test := [str(seed) for seed in self.tuned_on if seed >= FIRST_TEST_SEED]:
            raise ValueError(f"tuned_on has test seeds ({', '.join(test)}): tune on seeds below {FIRST_TEST_SEED}")
        for field in {field for own in self.on.values() for field in own} | set(self.vary):
            if not any(field == one or field.startswith(f"{one}.") for one in MAY_SET):
                raise ValueError(f"an entrant cannot set {field}, only {', '.join(MAY_SET)}")
        return self

    def fields(self, body: str, task: str) -> dict[str, Any]:
        """Returns what it sets for a task on a body."""
        own = {**self.on.get(body, {}), **self.on.get(f"{body}/{task}", {})}
        controller, others = deepcopy(dict(self.controller)), dict[str, Any]()
        for path, value in own.items():
            first, *between, last = path.split(".")
            if first != "controller":
                others[path] = value
                continue
            place = controller
            for name in between:
                place = place.setdefault(name, {})
            place[last] = value
        return {"controller": controller, **others}


@dataclass(frozen=True)
class Entry:
    """One entrant at one task, on one body, with one draw."""

    entrant: str  # Its name
    body: str  # Name of the body
    task: str  # Name of the task
    seed: int  # Of the draw
    finer: int  # How many times as short the body's steps are
    drawn: str  # What was drawn, as text
    case: Case  # Its run

    @property
    def setup(self) -> str:
        """Digest of what the task and the entrant set, whatever code runs it."""
        text = json.dumps([self.case.preset, dict(self.case.changes)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def halved(self) -> Entry:
        """Returns it at half the step."""
        step_s = load_config(self.case.preset, dict(self.case.changes)).clock.physics_timestep_s / 2
        case = Case(self.case.preset, {**self.case.changes, "clock.physics_timestep_s": round(step_s, 9)})
        return replace(self, finer=2 * self.finer, case=case)


@cache
def all_tasks() -> Tasks:
    """Reads the tasks."""
    return check_section(Tasks, read_toml(_file("tasks.toml")))


@cache
def own_entrants() -> Mapping[str, Entrant]:
    """Reads the entrants that come with annelid."""
    return {**read_entrants(_file("entrants.toml")), **read_entrants(_file("policy.toml"))}


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
            one = check_section(Entrant, fields)
            if one.preset is not None:
                is_file = one.preset.endswith((".toml", ".xml"))
                preset = str(path.parent / one.preset) if is_file else one.preset
                load_config(preset)
                one = one.model_copy(update={"preset": preset})
        except ConfigError as error:
            raise ConfigError(f"{path}, entrant {name}: {error}") from None
        found[name] = one
    return found


def find_entrants(names: Sequence[str]) -> dict[str, Entrant]:
    """Finds entrants, the reference first.

    Args:
        names: Each one of ``entrants.toml``, the path of a file like it, or ``module:name`` of a controller of one's
            own; none for all of annelid's.

    Raises:
        ConfigError: One is unknown, cannot be read, or two bear one name.
    """
    own = own_entrants()
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
    bodies: Sequence[str] = (),
    finer: int = 1,
    duration_s: float | None = None,
) -> list[Entry]:
    """Lays out the runs of entrants at tasks.

    An entrant that brings its body runs the tasks of walking with it, and only the first of them if the body has its
    ground. All others run all tasks on all bodies.

    Args:
        entrants: By their names.
        names: Of the tasks; none for all.
        seeds: Of the draws.
        bodies: Names of the bodies; none for all.
        finer: How many times as short the bodies' steps are.
        duration_s: How long every run lasts; None for each task's own time.

    Raises:
        ConfigError: A task or a body is unknown.
    """
    found = all_tasks()
    for kind, given, known in (("task", names, found.tasks), ("body", bodies, found.bodies)):
        for name in given:
            if name not in known:
                raise ConfigError(f"unknown {kind} {name!r}: {suggest(name, known)}")
    given = [(name, found.bodies[name], "") for name in bodies or found.bodies]
    given += [
        (Path(one.preset).stem, Body(summary="", preset=one.preset), name)
        for name, one in entrants.items()
        if one.preset
    ]
    made = []
    for body, its_body, owner in given:
        config = load_config(its_body.preset, dict(its_body.set))
        runners = {name: one for name, one in entrants.items() if (name == owner if owner else one.preset is None)}
        for name in names or found.tasks:
            if owner and name not in (found.walking if config.arena is not None else found.walking[:1]):
                continue
            shared = {**found.set, **its_body.set, **found.tasks[name].set}
            if finer != 1:
                shared["clock.physics_timestep_s"] = round(config.clock.physics_timestep_s / finer, 9)
            if duration_s is not None:
                shared["duration_s"] = duration_s
            for seed in seeds:
                drawn = found.drawn(name, seed)
                listed = " ".join(f"{field}={x:g}" for field, x in drawn.items())
                for entrant, its in runners.items():
                    changes = {**shared, **drawn, "seed": seed, **its.fields(body, name)}
                    if owner:
                        # Its control steps may be of another length, and it may have a ground of its own.
                        left_out = ("record.",) if config.arena is not None else ("record.", "arena.")
                        changes = {field: value for field, value in changes.items() if not field.startswith(left_out)}
                    case = Case(its_body.preset, changes)
                    made.append(Entry(entrant, body, name, seed, finer, listed, case))
    return made

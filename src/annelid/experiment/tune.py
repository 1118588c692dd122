"""Tuning a gait: fields of controller and body in ranges or among choices, by speed, cost of transport or slip.

An optimiser asks for generations of gaits, and the store of runs computes them. A search leaves its trials as CSV, its
best gaits as files that run, a table and a figure.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from annelid.analysis.gait import Gait
from annelid.config import RunConfig, Vary, field_value, fields_of, load_config, parse_assignments, toml_value
from annelid.config.checking import check_section
from annelid.draw.figures.experiments import Mark, pareto_figure, progress_figure
from annelid.errors import ConfigError, suggest
from annelid.experiment.case import Case, write_worm
from annelid.experiment.optimisers import optimiser_of
from annelid.experiment.outcome import Outcome
from annelid.experiment.space import Choice, Variable, variables_of
from annelid.experiment.store import Done, Store, case_key
from annelid.output import write_csv

LEAST_WORK_J = 0.01
"""Muscles that do less work leave the worm where it lies, and a share of their work says nothing."""
START = -1
"""Number of the gait that the search starts from, which is no trial."""
HOW = "give FIELD=LOW:HIGH, FIELD=LOW:HIGH:log or FIELD=VALUE,VALUE,.."
LEAST_CYCLES = 2
"""Complete cycles that a gait must have."""
HISTORY, BEST, FRONT, FIGURE = "trials.csv", "best.toml", "front", "tuning"
_ROWS = {
    "speed (m/s)": "speed_m_per_s",
    "body lengths/s": "speed_body_lengths_per_s",
    "cost of transport": "cost_of_transport",
    "the same, net work": "cost_of_transport_net",
    "the same, cables": "cost_of_transport_cables",
    "slip ratio": "slip_ratio",
    "period (s)": "gait_period_s",
    "cycles": "cycles",
}
MOST_SHOWN = 8
"""Gaits of a Pareto front in the table, evenly picked from it."""


@dataclass(frozen=True, slots=True)
class Objective:
    """A number that a gait is tuned for: the name that a user gives, a label with its unit, and its name in `Gait`."""

    name: str
    label: str
    number: str
    more_is_better: bool
    penalty: float
    """What counts for a run that does not walk."""


OBJECTIVES: Mapping[str, Objective] = {
    one.name: one
    for one in (
        Objective("speed", "speed (m/s)", "speed_m_per_s", True, 0.0),
        Objective("cost-of-transport", "cost of transport", "cost_of_transport", False, 100.0),
        Objective("slip", "slip ratio", "slip_ratio", False, 10.0),
    )
}
"""The objectives. The cost of transport counts positive work, none of it regained. The penalties are worse than any
gait that advances: no speed, and a cost and a slip beyond reach."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What was found of one run."""

    gait: Gait | None
    """Its numbers; None where it was stopped or could not be computed."""
    problem: str
    """Why it does not count as a gait; empty if it does."""

    def value(self, objective: Objective) -> float:
        """Returns the value of an objective, its penalty for a run that does not walk."""
        value = None if self.gait is None or self.problem else getattr(self.gait, objective.number)
        return objective.penalty if value is None or not isfinite(value) else value

    def score(self, objective: Objective) -> float:
        """Returns the value of an objective, signed so that less is better."""
        return -self.value(objective) if objective.more_is_better else self.value(objective)


def objectives_of(names: list[str]) -> list[Objective]:
    """Returns one or two objectives by name."""
    for name in names:
        if name not in OBJECTIVES:
            raise ConfigError(f"unknown objective {name!r}: {suggest(name, OBJECTIVES)}")
    if not 1 <= len(set(names)) == len(names) <= 2:
        raise ConfigError(f"objectives must be one or two of {', '.join(OBJECTIVES)}, not {', '.join(names)}")
    return [OBJECTIVES[name] for name in names]


def judge(outcome: Outcome, numerics: float | None = None) -> Judged:
    """Judges a run: it must have ended whole, in order, over at least two cycles, and advance.

    In order are neighbours that take turns with steady periods and lags; onsets need not be evenly spaced.

    Args:
        outcome: Of the run.
        numerics: Largest share of the muscles' work that the integrator may take or add; None for any.
    """
    problem = _problem(outcome)
    if not problem and numerics is not None:
        problem = numerical_problem(outcome, numerics)
    return Judged(None if outcome.message else outcome.summary, problem)


def numerical_problem(outcome: Outcome, largest_share: float) -> str:
    """Says if the integrator took or added more of the muscles' work than it may; nothing if it did not.

    Args:
        outcome: Of the run.
        largest_share: How much of that work it may take or add; below 1.
    """
    work_J, share = outcome.summary.energy_muscle_work_J, outcome.summary.energy_numerical_share
    if work_J is None or work_J < LEAST_WORK_J:
        return ""
    if share is None or abs(share) <= largest_share:
        return ""
    return f"the integrator {'took' if share > 0 else 'added'} {abs(share):.0%} of the muscles' work"


def _problem(outcome: Outcome) -> str:
    rhythm, gait = outcome.rhythm, outcome.summary
    if outcome.message:
        return f"stopped: {outcome.message}"
    if rhythm.verdict == "silent":
        return f"silent: {rhythm.reason}"
    if not rhythm.is_regular:
        return f"out of order: {rhythm.reason}"
    if gait.cycles < LEAST_CYCLES:
        return f"fewer than {LEAST_CYCLES} complete cycles"
    if gait.speed_m_per_s is None or not gait.speed_m_per_s > 0.0:
        return "does not advance"
    return ""


def parsed_variables(texts: Sequence[str], config: RunConfig) -> list[Variable]:
    """Reads what is varied of a configuration; where nothing is given, the fields of the controller's timing.

    ``FIELD=LOW:HIGH`` or ``FIELD=LOW:HIGH:log`` is a number, whole where the field's own value is;
    ``FIELD=VALUE,VALUE,..`` are choices, each as TOML or plain text. Values out of the field's range are refused.
    """
    kind, tuned = config.controller.kind, config.controller.tuned
    if not texts and not tuned:
        raise ConfigError(f"controller.kind = {kind!r} has no fields that are varied by default: {HOW} with --vary")
    variables = variables_of([check_section(Vary, _parsed(text)) for text in texts or tuned], config)
    for one in variables:
        if one.field not in (known := fields_of(config)):
            raise ConfigError(f"unknown field {one.field!r}: {suggest(one.field, known)}")
        for end in one.values if isinstance(one, Choice) else map(one.rounded, (one.low, one.high)):
            load_config(config.model_dump(), {one.field: end})
    return variables


def _parsed(text: str) -> dict[str, Any]:
    path, equals, right = (part.strip() for part in text.partition("="))
    if not equals or not right:
        raise ConfigError(f"{text!r} says nothing to vary: {HOW}")
    if ":" not in right:
        # As TOML: brackets of a list keep its commas together.
        listed = parse_assignments([f"{path}=[{right}]"])[path]
        choices = listed if isinstance(listed, list) else [word.strip() for word in right.split(",")]
        if len(choices) < 2:
            raise ConfigError(f"{text}: one value is no choice: {HOW}")
        return {"field": path, "choices": choices}
    low, high, *rest = (part.strip() for part in right.split(":"))
    if rest not in ([], ["log"]):
        raise ConfigError(f"{text}: only 'log' may follow the ends of a range: {HOW}")
    try:
        return {"field": path, "from": float(low), "to": float(high), "log": bool(rest)}
    except ValueError:
        raise ConfigError(f"{text}: the ends of a range must be numbers: {HOW}") from None


@dataclass(frozen=True)
class Task:
    """What is tuned, and for what: a preset or TOML file, and fields that differ from it in every run."""

    source: str
    changes: Mapping[str, Any]
    variables: Sequence[Variable]
    objectives: Sequence[Objective]
    """One or two."""
    n_trials: int
    seed: int = 0
    """Of the optimiser."""
    numerics: float | None = None
    """Largest share of the muscles' work that the integrator may take or add in a gait; None for any."""

    @property
    def start(self) -> Case:
        """The run that the search starts from."""
        return Case(self.source, self.changes)


@dataclass(frozen=True)
class Trial:
    """One run of a search."""

    number: int
    """From 0; `START` for the gait that the search starts from."""
    values: Mapping[str, Any]
    """Of the variables, by field."""
    case: Case
    judged: Judged
    path: Path = field(compare=False)
    """Folder of the run."""
    failed: bool = False
    """Whether it could not be computed, though it could be built."""


def search(task: Task, store: Store) -> Iterator[list[Trial]]:
    """Searches, and yields the trials generation by generation; first the start alone.

    One objective over numbers is searched by CMA-ES, which starts at the source's own values if they lie in the ranges;
    two objectives, or choices among the variables, by a tree-structured Parzen estimator. Generations are asked for and
    scored in the order of their numbers, so that the search depends on its seed and not on the number of processes:
    called again it asks for the same gaits, finds those in the store that it has computed, and goes on.

    A run that cannot be built, stops, falls silent or out of order, or does not advance counts as a trial with the
    objectives' penalties; the run that it starts from must be one that can be built and written.
    """
    found: list[Trial] = []

    def report(stage: str, done: int, _: int, __: float) -> None:
        done += max(len(found) - 1, 0)
        store.progress(stage, done, task.n_trials, done / task.n_trials)

    start = task.start
    own = {one.field: field_value(start.config, one.field) for one in task.variables}
    inside = all(own[one.field] in one for one in task.variables)
    optimiser = optimiser_of(task.variables, len(task.objectives), own if inside else None, task.seed)
    generation = next(optimiser)
    outcomes = store.compute([start], "the gait it starts from", progress=report)
    found.append(_trial(START, {}, start, Done(outcomes[case_key(start)]), task.numerics))
    yield list(found)
    while (done := len(found) - 1) < task.n_trials:
        values = generation[: task.n_trials - done]
        cases = [start.but(of_trial) for of_trial in values]
        leaders = {objective: leader(found, [objective]) for objective in task.objectives}
        words = [f"{one.name} {best.judged.value(one):.3g}" for one, best in leaders.items() if best is not None]
        stage = f"tuning, best so far {', '.join(words)}" if words else "tuning, no gait so far"
        results = store.finish(cases, stage, progress=report)
        of_trials = enumerate(zip(values, cases, results, strict=True))
        trials = [_trial(done + i, *of_it, task.numerics) for i, of_it in of_trials]
        found += trials
        yield trials
        if len(trials) == len(generation):
            generation = optimiser.send([_scores(trial, task.objectives) for trial in trials])


def _trial(number: int, values: Mapping[str, Any], case: Case, done: Done, numerics: float | None) -> Trial:
    if done.outcome is not None:
        return Trial(number, values, case, judge(done.outcome, numerics), done.outcome.path)
    failed = not isinstance(done.error, ConfigError)
    problem = f"{'failed' if failed else 'cannot be built'}: {done.error}"
    return Trial(number, values, case, Judged(None, problem), Path(), failed)


def _scores(trial: Trial, objectives: Sequence[Objective]) -> tuple[float, ...]:
    return tuple(trial.judged.score(objective) for objective in objectives)


def front(trials: Sequence[Trial], objectives: Sequence[Objective]) -> list[Trial]:
    """Returns the Pareto front: those that walk and that no other beats in all objectives, by the first of them.

    Of trials with the same run the first is taken: one of them may have the start's own values.
    """
    walking: dict[Path, Trial] = {}
    for trial in trials:
        if not trial.judged.problem:
            walking.setdefault(trial.path, trial)
    scores = {trial.number: _scores(trial, objectives) for trial in walking.values()}
    kept: list[Trial] = []
    # Whatever beats a trial comes before it.
    for trial in sorted(walking.values(), key=lambda trial: (scores[trial.number], trial.number)):
        mine = scores[trial.number]
        others = (scores[other.number] for other in kept)
        if not any(other != mine and all(a <= b for a, b in zip(other, mine, strict=True)) for other in others):
            kept.append(trial)
    return kept


def leader(trials: Sequence[Trial], objectives: Sequence[Objective]) -> Trial | None:
    """Returns the best gait: of the front the nearest to the ideal, every objective scaled to its range on the front.

    Of one objective that is the best of all; None if none walks.
    """
    on_front = front(trials, objectives)
    scores = {trial.number: _scores(trial, objectives) for trial in on_front}
    spans = [(min(column), max(column)) for column in zip(*scores.values(), strict=True)]

    def distance(trial: Trial) -> float:
        pairs = zip(scores[trial.number], spans, strict=True)
        return sum(((score - low) / (high - low or 1.0)) ** 2 for score, (low, high) in pairs)

    return min(on_front, key=distance, default=None)


def write_results(task: Task, trials: Sequence[Trial], command: str, folder: Path) -> list[Path]:
    """Writes what has been found so far by a command: the CSV, the figure, and the best gaits where one walks.

    Returns the paths of the CSV, the picture in pixels and the best gait.
    """
    folder.mkdir(parents=True, exist_ok=True)
    fields = [variable.field for variable in task.variables]
    rows = ([_name(one), *_values(one, fields), *_numbers(one), one.judged.problem, one.path.name] for one in trials)
    columns = ["trial", *fields, *_ROWS.values(), "problem", "run"]
    written = [write_csv(folder / HISTORY, columns, rows), _figure(task, trials, folder / FIGURE)]
    best = leader(trials, task.objectives)
    if best is not None:
        written.append(write_gait(task, best, command, folder / BEST))
    if len(task.objectives) == 2:
        (folder / FRONT).mkdir(exist_ok=True)
        for old in (folder / FRONT).glob("*.toml"):
            old.unlink()
        for trial in front(trials, task.objectives):
            write_gait(task, trial, command, folder / FRONT / f"{_name(trial)}.toml")
    return written


def write_gait(task: Task, trial: Trial, command: str, path: Path) -> Path:
    """Writes a gait as a file that `annelid run` takes: what it extends, and every field that was changed."""
    before = task.start.config
    lines = [
        f"Tuned by: {command} ({task.n_trials} trials, seed {task.seed})",
        f"{'Trial ' if trial.number != START else ''}{_name(trial)}:",
        *(f"  {label}: {number}" for label, number in zip(_ROWS, _numbers(trial), strict=True) if number),
        *(f"  before: {field} = {toml_value(field_value(before, field))}" for field in trial.values),
    ]
    summary = f"{before.name}, tuned for {_words(task)}"
    write_worm(path, task.source, {"name": path.stem, "summary": summary, **task.changes, **trial.values}, lines)
    return path


def results_table(task: Task, trials: Sequence[Trial]) -> Table:
    """Returns the gait that was started from and the best ones side by side."""
    best = leader(trials, task.objectives)
    leaders = [] if best is None else [best]
    if len(task.objectives) == 2:
        on_front = front(trials, task.objectives)
        places = np.linspace(0, len(on_front) - 1, min(len(on_front), MOST_SHOWN))
        leaders = [on_front[round(place)] for place in places.tolist()]
    shown = [trials[0], *(one for one in leaders if one.number != START)]
    failed = sum(bool(trial.judged.problem) for trial in trials[1:])
    table = Table(
        "trial",
        title=f"{task.start.config.name}, tuned for {_words(task)}",
        caption=f"{len(trials) - 1} trials, of which {failed} did not walk",
    )
    for trial in shown:
        table.add_column(_name(trial), justify="right")
    for row in zip(_ROWS, *map(_numbers, shown), strict=True):
        table.add_row(*row)
    table.add_section()
    fields = [variable.field for variable in task.variables]
    for row in zip(fields, *(_values(trial, fields) for trial in shown), strict=True):
        table.add_row(*row)
    return table


def _figure(task: Task, trials: Sequence[Trial], stem: Path) -> Path:
    first, *_ = objectives = task.objectives
    values = [tuple(trial.judged.value(one) for one in objectives) for trial in trials]
    marks = [Mark(trial.number, value, not trial.judged.problem) for trial, value in zip(trials, values, strict=True)]
    if len(objectives) == 1:
        return progress_figure(marks, first.label, first.more_is_better, stem)
    on_front = {trial.number for trial in front(trials, objectives)}
    return pareto_figure(marks, on_front, (first.label, objectives[1].label), first.more_is_better, stem)


def _name(trial: Trial) -> str:
    return "start" if trial.number == START else str(trial.number)


def _words(task: Task) -> str:
    return " and ".join(one.name.replace("-", " ") for one in task.objectives)


def _numbers(trial: Trial) -> list[str]:
    """The numbers of a trial's gait, each empty where there is none."""
    found = (getattr(trial.judged.gait, name, None) for name in _ROWS.values())
    return ["" if number is None else f"{number:.4g}" for number in found]


def _values(trial: Trial, fields: Sequence[str]) -> list[str]:
    """The values of the varied fields, as far as it could be built as its configuration has them."""
    built = not trial.judged.problem.startswith("cannot be built")
    values: list[Any] = [field_value(trial.case.config, one) if built else trial.values[one] for one in fields]
    return [toml_value(value).strip('"') for value in values]

"""Tuning a gait: fields of controller and body in ranges or among choices, by speed, cost of transport or slip.

An optimiser asks for generations of gaits, and the store of runs computes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from annelid.config import RunConfig, Vary, field_value, fields_of, load_config, parse_assignments
from annelid.config.checking import check_section
from annelid.errors import ConfigError, suggest
from annelid.experiment.case import Case
from annelid.experiment.objectives import Judged, Objective, judge
from annelid.experiment.optimisers import optimiser_of
from annelid.experiment.progress import StudyProgress, in_stage
from annelid.experiment.space import Choice, Variable, variables_of
from annelid.experiment.store import Done, Store, case_key

START = -1
"""Number of the gait that the search starts from, which is no trial."""
LOG = "log"
HOW = "give FIELD=LOW:HIGH, FIELD=LOW:HIGH:log or FIELD=VALUE,VALUE,.."


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
    if rest not in ([], [LOG]):
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


def search(
    task: Task, store: Store, *, jobs: int | None = None, progress: StudyProgress | None = None
) -> Iterator[list[Trial]]:
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
        if progress is not None:
            done += max(len(found) - 1, 0)
            progress(stage, done, task.n_trials, done / task.n_trials)

    start = task.start
    own = {one.field: field_value(start.config, one.field) for one in task.variables}
    inside = all(own[one.field] in one for one in task.variables)
    optimiser = optimiser_of(task.variables, len(task.objectives), own if inside else None, task.seed)
    generation = next(optimiser)
    outcomes = store.compute([start], jobs=jobs, progress=in_stage(report, "the gait it starts from"))
    found.append(_trial(START, {}, start, Done(outcomes[case_key(start)])))
    yield list(found)
    while (done := len(found) - 1) < task.n_trials:
        values = generation[: task.n_trials - done]
        cases = [start.but(of_trial) for of_trial in values]
        results = store.finish(cases, _best_words(task, found), jobs=jobs, progress=report)
        trials = [_trial(done + i, *of_it) for i, of_it in enumerate(zip(values, cases, results, strict=True))]
        found += trials
        yield trials
        if len(trials) == len(generation):
            generation = optimiser.send([_scores(trial, task.objectives) for trial in trials])


def _trial(number: int, values: Mapping[str, Any], case: Case, done: Done) -> Trial:
    if done.outcome is not None:
        return Trial(number, values, case, judge(done.outcome), done.outcome.path)
    failed = not isinstance(done.error, ConfigError)
    problem = f"{'failed' if failed else 'cannot be built'}: {done.error}"
    return Trial(number, values, case, Judged(None, problem), Path(), failed)


def _best_words(task: Task, found: Sequence[Trial]) -> str:
    leaders = {objective: leader(found, [objective]) for objective in task.objectives}
    words = [f"{one.name} {best.judged.value(one):.3g}" for one, best in leaders.items() if best is not None]
    return f"tuning, best so far {', '.join(words)}" if words else "tuning, no gait so far"


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

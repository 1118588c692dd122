"""The search: an optimiser asks for generations of gaits, the store of runs computes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from annelid.errors import ConfigError
from annelid.experiment.case import Case
from annelid.experiment.progress import StudyProgress, in_stage
from annelid.experiment.space import Variable
from annelid.experiment.store import Store
from annelid.experiment.tune.judge import Judged, Objective, judge
from annelid.experiment.tune.optimiser import optimiser_of
from annelid.experiment.tune.space import own_values

START = -1
"""Number of the gait that the search starts from, which is no trial."""


@dataclass(frozen=True)
class Task:
    """What is tuned, and for what.

    Attributes:
        source: Preset or TOML file.
        changes: Fields that differ from it in every run.
        variables: What is varied.
        objectives: One or two.
        n_trials: How many runs the search may take.
        seed: Of the optimiser.
    """

    source: str
    changes: Mapping[str, Any]
    variables: Sequence[Variable]
    objectives: Sequence[Objective]
    n_trials: int
    seed: int = 0

    @property
    def start(self) -> Case:
        """The run that the search starts from."""
        return Case(self.source, self.changes)

    @property
    def own(self) -> dict[str, Any] | None:
        """The source's own values of the variables; None if one lies outside of its range."""
        return own_values(self.start.config, self.variables)


@dataclass(frozen=True)
class Trial:
    """One run of a search.

    Attributes:
        number: Its number, from 0; `START` for the gait that the search starts from.
        values: Values of the variables, by field.
        case: The run.
        judged: What was found.
        path: Folder of the run.
        failed: Whether it could not be computed, though it could be built.
    """

    number: int
    values: Mapping[str, Any]
    case: Case
    judged: Judged
    path: Path = field(compare=False)
    failed: bool = False


def search(
    task: Task, store: Store, *, jobs: int | None = None, progress: StudyProgress | None = None
) -> Iterator[list[Trial]]:
    """Searches, and hands over the trials generation by generation; first the start alone.

    One objective over numbers is searched by CMA-ES, which starts at the source's own values if they lie in the ranges;
    two objectives, or choices among the variables, by a tree-structured Parzen estimator. Generations are asked for
    and told in the order of their numbers, so that the search depends on its seed and not on the number of processes:
    called again it asks for the same gaits, finds those in the store that it has computed, and goes on.

    A run that cannot be built, stops, falls silent or out of order, or does not advance counts as a trial with the
    objectives' penalties.

    Args:
        task: What is tuned, and for what.
        store: Where runs are kept.
        jobs: Processes; default: one a core.
        progress: Called as runs finish, with the best so far.

    Yields:
        The trials of each generation.

    Raises:
        MissingDependency: Optuna or cmaes is not installed.
        AnnelidError: The run that it starts from cannot be built or written.
        KeyboardInterrupt: Finished runs are kept.
    """
    optimiser = optimiser_of(task.variables, len(task.objectives), task.own, task.seed)
    report = _after(progress, 0, task.n_trials)
    store.compute([task.start], jobs=jobs, progress=in_stage(report, "the gait it starts from"))
    first = _trial(task.start, store, START, {})
    yield [first]
    found = [first]
    while (done := len(found) - 1) < task.n_trials:
        values = optimiser.ask()[: task.n_trials - done]
        cases = [task.start.but(of_trial) for of_trial in values]
        report = _after(progress, done, task.n_trials)
        results = store.finish(cases, _best_words(task, found), jobs=jobs, progress=report)
        trials = [
            _trial(case, store, done + i, of_trial, one.error)
            for i, (case, of_trial, one) in enumerate(zip(cases, values, results, strict=True))
        ]
        optimiser.tell([scores(trial, task.objectives) for trial in trials])
        found += trials
        yield trials


def best(trials: Sequence[Trial], objective: Objective) -> Trial | None:
    """Returns the best of those that walk; None if none does."""
    walking = [trial for trial in trials if not trial.judged.problem]
    return min(walking, key=lambda trial: trial.judged.score(objective), default=None)


def front(trials: Sequence[Trial], objectives: Sequence[Objective]) -> list[Trial]:
    """Returns the Pareto front: those that walk and that no other beats in both objectives, by the first of them.

    Of trials with the same run the first is taken: one of them may have the start's own values.
    """
    walking = list({trial.path: trial for trial in reversed(trials) if not trial.judged.problem}.values())
    marks = {trial.number: scores(trial, objectives) for trial in walking}
    kept = [
        trial for trial in walking if not any(_dominates(marks[other.number], marks[trial.number]) for other in walking)
    ]
    return sorted(kept, key=lambda trial: marks[trial.number])


def compromise(trials: Sequence[Trial], objectives: Sequence[Objective]) -> Trial | None:
    """Returns the trial of the front nearest to the ideal, every objective scaled to its range on the front."""
    on_front = front(trials, objectives)
    marks = [scores(trial, objectives) for trial in on_front]
    if not marks:
        return None
    spans = [(min(column), max(column)) for column in zip(*marks, strict=True)]

    def distance(i: int) -> float:
        pairs = zip(marks[i], spans, strict=True)
        return sum(((score - low) / (high - low or 1.0)) ** 2 for score, (low, high) in pairs)

    return on_front[min(range(len(marks)), key=distance)]


def scores(trial: Trial, objectives: Sequence[Objective]) -> tuple[float, ...]:
    """Values of the objectives, signed so that less is better."""
    return tuple(trial.judged.score(objective) for objective in objectives)


def _dominates(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return one != other and all(a <= b for a, b in zip(one, other, strict=True))


def judged_run(store: Store, case: Case) -> Judged:
    """Judges a gait by its run.

    Args:
        store: The store, which has computed the run.
        case: The run.

    Returns:
        The gait's numbers, or why it does not count as one.

    Raises:
        KeyError: The store has not computed it.
    """
    outcome = store[case]
    return judge(outcome, None if outcome.message else outcome.gait)


def _trial(case: Case, store: Store, number: int, values: Mapping[str, Any], error: Exception | None = None) -> Trial:
    if error is not None:
        failed = not isinstance(error, ConfigError)
        what = "failed" if failed else "cannot be built"
        return Trial(number, values, case, Judged(None, f"{what}: {error}"), Path(), failed)
    return Trial(number, values, case, judged_run(store, case), store.path(case))


def _best_words(task: Task, found: Sequence[Trial]) -> str:
    words = []
    for objective in task.objectives:
        leader = best(found, objective)
        if leader is not None:
            words.append(f"{objective.name} {leader.judged.value(objective):.3g}")
    return f"tuning, best so far {', '.join(words)}" if words else "tuning, no gait so far"


def _after(progress: StudyProgress | None, before: int, n_trials: int) -> StudyProgress | None:
    """Returns what tells the progress of a generation as one of the whole search."""
    if progress is None:
        return None

    def report(stage: str, done: int, _: int, __: float) -> None:
        progress(stage, before + done, n_trials, (before + done) / n_trials)

    return report

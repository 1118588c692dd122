"""Tuning a gait: fields of controller and body in ranges or among choices, by speed, cost of transport or slip.

Optuna asks for generations of gaits, and the store of runs computes them. A search leaves its trials as CSV, its best
gaits as files that run, a table and a figure.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, isfinite, log, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table

from annelid.analysis import NUMBERS
from annelid.config import RunConfig, Vary, field_value, fields_of, load_config, parse_assignments, toml_value
from annelid.config.checking import check_section
from annelid.draw.figures.experiments import pareto_figure, progress_figure
from annelid.errors import ConfigError, MissingDependency, suggest
from annelid.experiment.case import Case, write_worm
from annelid.experiment.gait_criteria import Judged, judge
from annelid.experiment.search_space import Choice, Variable, spread_evenly, variables_of
from annelid.experiment.store import Done, Store
from annelid.output import write_csv

if TYPE_CHECKING:
    import optuna

HOW = "give FIELD=LOW:HIGH, FIELD=LOW:HIGH:log or FIELD=VALUE,VALUE,.."
HISTORY, BEST, FRONT, FIGURE = "trials.csv", "best.toml", "front", "tuning"
"""What is in the folder of the results."""
SHOWN = (
    "speed_m_per_s",
    "speed_body_lengths_per_s",
    "cost_of_transport",
    "cost_of_transport_net",
    "cost_of_transport_cables",
    "slip_ratio",
    "gait_period_s",
    "cycles",
)
"""Numbers of a gait in its row, in the table and in its file."""
MOST_SHOWN = 8
"""Gaits of a Pareto front in the table, evenly picked from it."""


@dataclass(frozen=True, slots=True)
class Objective:
    """A number that a gait is tuned for: the name that a user gives, and its name in `NUMBERS`."""

    name: str
    number: str
    more_is_better: bool
    penalty: float
    """What counts for a run that does not walk."""

    def value(self, judged: Judged) -> float:
        """Returns its value for a run: the penalty where that does not walk."""
        value = None if judged.gait is None or judged.problem else getattr(judged.gait, self.number)
        return self.penalty if value is None or not isfinite(value) else value


OBJECTIVES: Mapping[str, Objective] = {
    one.name: one
    for one in (
        Objective("speed", "speed_m_per_s", True, 0.0),
        Objective("cost-of-transport", "cost_of_transport", False, 100.0),
        Objective("slip", "slip_ratio", False, 10.0),
    )
}
"""The objectives. The cost of transport counts positive work, none of it regained. The penalties are worse than any
gait that advances: no speed, and a cost and a slip beyond reach."""


def labelled(name: str) -> str:
    """Returns what a run's table calls a number, with its unit."""
    return NUMBERS[name].heading


def objectives_of(names: list[str]) -> list[Objective]:
    """Returns one or two objectives by name."""
    for name in names:
        if name not in OBJECTIVES:
            raise ConfigError(f"unknown objective {name!r}: {suggest(name, OBJECTIVES)}")
    if not 1 <= len(set(names)) == len(names) <= 2:
        raise ConfigError(f"objectives must be one or two of {', '.join(OBJECTIVES)}, not {', '.join(names)}")
    return [OBJECTIVES[name] for name in names]


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

    @property
    def title(self) -> str:
        """The worm, and what it is tuned for."""
        words = " and ".join(one.name.replace("-", " ") for one in self.objectives)
        return f"{self.start.config.name}, tuned for {words}"


@dataclass(frozen=True)
class Trial:
    """One run of a search.

    Attributes:
        name: Its number from 0; ``start`` for the gait that the search starts from.
        values: Of the variables, by field.
        case: The run.
        judged: What was found of it.
        path: Folder of the run.
        failed: Whether it could not be computed, though it could be built.
    """

    name: str
    values: Mapping[str, Any]
    case: Case
    judged: Judged
    path: Path = field(compare=False)
    failed: bool = False

    def scores(self, objectives: Sequence[Objective]) -> list[float]:
        """Returns the values of objectives."""
        return [one.value(self.judged) for one in objectives]

    @property
    def numbers(self) -> list[float | None]:
        """The numbers of its gait; None where there is none."""
        return [getattr(self.judged.gait, name, None) for name in SHOWN]

    def settings(self, task: Task) -> list[str]:
        """Returns the values of the varied fields; of the start, those of its configuration."""
        fields = [one.field for one in task.variables]
        values = [self.values[one] if self.values else field_value(self.case.config, one) for one in fields]
        return [toml_value(value).strip('"') for value in values]


def search(task: Task, store: Store) -> Iterator[list[Trial]]:
    """Searches, and yields the trials generation by generation; first the start alone.

    The optimiser is Optuna's multivariate tree-structured Parzen estimator (Bergstra 2011). It knows the start if that
    lies in the ranges. Generations are asked for and scored in the order of their numbers, so that the search depends
    on its seed and not on the number of processes: called again it asks for the same gaits, finds those in the store
    that it has computed, and goes on.

    A run that cannot be built, stops, falls silent or out of order, or does not advance counts as a trial with the
    objectives' penalties; the run that it starts from must be one that can be built and written.
    """
    study, start = parzen_study(_directions(task.objectives), generation_size(task), task.seed), task.start
    found: list[Trial] = []

    def finish(cases: Sequence[Case], stage: str) -> list[Done]:
        before = max(len(found) - 1, 0)
        return store.finish(
            cases,
            stage,
            progress=lambda words, done, *_: store.progress(
                words, before + done, task.n_trials, (before + done) / task.n_trials
            ),
        )

    [done] = finish([start], "the gait it starts from")
    if done.error is not None:
        raise done.error
    found.append(_trial("start", {}, start, done, task))
    ranges = {one.field: _range(one) for one in task.variables}
    own = {one.field: field_value(start.config, one.field) for one in task.variables}
    if all(own[one.field] in one for one in task.variables):
        known = {one.field: _place(one, own[one.field]) for one in task.variables}
        scores = found[0].scores(task.objectives)
        study.add_trial(load_optuna().trial.create_trial(params=known, distributions=ranges, values=scores))
    yield list(found)
    while (n := len(found) - 1) < task.n_trials:
        asked = [study.ask(ranges) for _ in range(min(generation_size(task), task.n_trials - n))]
        values = [{one.field: _value(one, trial.params[one.field]) for one in task.variables} for trial in asked]
        cases = [start.but(of_trial) for of_trial in values]
        of_runs = zip(values, cases, finish(cases, _stage(task, found)), strict=True)
        trials = [_trial(str(n + i), *of_run, task) for i, of_run in enumerate(of_runs)]
        for theirs, ours in zip(asked, trials, strict=True):
            study.tell(theirs, ours.scores(task.objectives))
        found += trials
        yield trials


def generation_size(task: Task) -> int:
    """Returns how many gaits are asked for at once: more for more variables, an even number, at least 8."""
    return max(8, 2 * floor((5 + 3 * log(len(task.variables))) / 2))


def load_optuna() -> Any:
    """Returns Optuna, silent.

    Raises:
        MissingDependency: It is not installed.
    """
    try:
        import optuna
    except ImportError:
        raise MissingDependency("tuning needs Optuna: install it with  pip install 'annelid[tune]'") from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    return optuna


def parzen_study(directions: Sequence[str], generation: int, seed: int) -> optuna.Study:
    """Returns a study of Optuna whose tree-structured Parzen estimator is asked for several trials at once.

    Args:
        directions: ``maximize`` or ``minimize`` for every value.
        generation: Trials that are asked for at once; the first two generations are random.
        seed: Of the estimator.
    """
    with warnings.catch_warnings():
        # The sampler's options are called experimental.
        warnings.simplefilter("ignore")
        sampler = load_optuna().samplers.TPESampler(
            seed=seed, n_startup_trials=2 * generation, multivariate=True, constant_liar=True
        )
    return load_optuna().create_study(sampler=sampler, directions=directions)


def _directions(objectives: Sequence[Objective]) -> list[str]:
    return ["maximize" if one.more_is_better else "minimize" for one in objectives]


def _range(variable: Variable) -> optuna.distributions.BaseDistribution:
    """Optuna's words for a variable; a choice is its number, since Optuna's own are plain values only."""
    kinds = load_optuna().distributions
    if isinstance(variable, Choice):
        return kinds.CategoricalDistribution(range(len(variable.values)))
    kind, number = (kinds.IntDistribution, int) if variable.whole else (kinds.FloatDistribution, float)
    return kind(number(variable.low), number(variable.high), log=variable.logarithmic)


def _place(variable: Variable, value: Any) -> Any:
    return variable.values.index(value) if isinstance(variable, Choice) else value


def _value(variable: Variable, place: Any) -> Any:
    return variable.values[place] if isinstance(variable, Choice) else variable.rounded(place)


def _stage(task: Task, found: Sequence[Trial]) -> str:
    best = {one: leader(found, [one]) for one in task.objectives}
    words = [f"{one.name} {one.value(trial.judged):.3g}" for one, trial in best.items() if trial is not None]
    return f"tuning, best so far {', '.join(words)}" if words else "tuning, no gait so far"


def _trial(name: str, values: Mapping[str, Any], case: Case, done: Done, task: Task) -> Trial:
    if done.outcome is not None:
        return Trial(name, values, case, judge(done.outcome, task.numerics), done.outcome.path)
    failed = not isinstance(done.error, ConfigError)
    problem = f"{'failed' if failed else 'cannot be built'}: {done.error}"
    return Trial(name, values, case, Judged(None, problem), Path(), failed)


def front(trials: Sequence[Trial], objectives: Sequence[Objective]) -> list[Trial]:
    """Returns the Pareto front: those that walk and that no other beats in all objectives, by the first of them.

    Of trials with the same run the first is taken.
    """
    walking = list({trial.path: trial for trial in reversed(trials) if not trial.judged.problem}.values())
    study = load_optuna().create_study(directions=_directions(objectives))
    study.add_trials([load_optuna().trial.create_trial(values=trial.scores(objectives)) for trial in walking])
    kept = [walking[one.number] for one in study.best_trials]
    return sorted(kept, key=lambda trial: trial.scores(objectives), reverse=objectives[0].more_is_better)


def leader(trials: Sequence[Trial], objectives: Sequence[Objective]) -> Trial | None:
    """Returns the best gait: of the front the nearest to the ideal, every objective scaled to its range on the front.

    Of one objective that is the best of all; None if none walks.
    """
    on_front = front(trials, objectives)
    if not on_front:
        return None
    scores = np.array([trial.scores(objectives) for trial in on_front])
    ideal = [max(of_it) if one.more_is_better else min(of_it) for one, of_it in zip(objectives, scores.T, strict=True)]
    span = np.ptp(scores, axis=0)
    distance = (((scores - ideal) / np.where(span > 0.0, span, 1.0)) ** 2).sum(axis=1)
    return on_front[int(distance.argmin())]


def write_results(task: Task, trials: Sequence[Trial], command: str, folder: Path) -> list[Path]:
    """Writes what has been found so far by a command: the CSV, the figure, and the best gaits where one walks.

    Returns the paths of the CSV, the picture in pixels and the best gait.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = ([one.name, *one.settings(task), *one.numbers, one.judged.problem, one.path.name] for one in trials)
    columns = ["trial", *(one.field for one in task.variables), *SHOWN, "problem", "run"]
    written = [write_csv(folder / HISTORY, columns, rows), _figure(task, trials, folder / FIGURE)]
    best = leader(trials, task.objectives)
    if best is not None:
        written.append(write_gait(task, best, command, folder / BEST))
    if len(task.objectives) == 2:
        (folder / FRONT).mkdir(exist_ok=True)
        for old in (folder / FRONT).glob("*.toml"):
            old.unlink()
        for trial in front(trials, task.objectives):
            write_gait(task, trial, command, folder / FRONT / f"{trial.name}.toml")
    return written


def write_gait(task: Task, trial: Trial, command: str, path: Path) -> Path:
    """Writes a gait as a file that `annelid run` takes: what it extends, and every field that was changed."""
    before = task.start.config
    lines = [
        f"Tuned by: {command} ({task.n_trials} trials, seed {task.seed})",
        f"Trial {trial.name}:",
        *(
            f"  {labelled(name)}: {NUMBERS[name].text(one)}"
            for name, one in zip(SHOWN, trial.numbers, strict=True)
            if one is not None
        ),
        *(f"  before: {field} = {toml_value(field_value(before, field))}" for field in trial.values),
    ]
    write_worm(path, task.source, {"name": path.stem, "summary": task.title, **task.changes, **trial.values}, lines)
    return path


def results_table(task: Task, trials: Sequence[Trial]) -> Table:
    """Returns the gait that was started from and the best ones side by side."""
    best = leader(trials, task.objectives)
    leaders = [] if best is None else [best]
    if len(task.objectives) == 2:
        leaders = spread_evenly(MOST_SHOWN, front(trials, task.objectives))
    shown = [trials[0], *(one for one in leaders if one is not trials[0])]
    failed = sum(bool(trial.judged.problem) for trial in trials[1:])
    caption = f"{len(trials) - 1} trials, of which {failed} did not walk"
    table = Table("trial", title=task.title, caption=caption)
    for trial in shown:
        table.add_column(trial.name, justify="right")
    for name, *values in zip(SHOWN, *(trial.numbers for trial in shown), strict=True):
        table.add_row(labelled(name), *map(NUMBERS[name].text, values))
    table.add_section()
    fields = [variable.field for variable in task.variables]
    for row in zip(fields, *(trial.settings(task) for trial in shown), strict=True):
        table.add_row(*row)
    return table


def _figure(task: Task, trials: Sequence[Trial], stem: Path) -> Path:
    first, *others = objectives = task.objectives
    values = [[nan] * len(objectives) if one.judged.problem else _shown(one, objectives) for one in trials]
    if not others:
        return progress_figure([value for (value,) in values], labelled(first.number), first.more_is_better, stem)
    on_front = {one.name: _shown(one, objectives) for one in front(trials, objectives)}
    return pareto_figure(values, on_front, [labelled(one.number) for one in objectives], first.more_is_better, stem)


def _shown(trial: Trial, objectives: Sequence[Objective]) -> list[float]:
    """Scores in the units of a run's table."""
    factors = (NUMBERS[one.number].factor for one in objectives)
    return [factor * score for factor, score in zip(factors, trial.scores(objectives), strict=True)]

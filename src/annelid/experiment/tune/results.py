"""What a search leaves behind: its trials as CSV, its best gaits as files that run, a table, a figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.config import field_value
from annelid.draw.figures.experiments import Mark, pareto_figure, progress_figure
from annelid.experiment.case import extend
from annelid.experiment.tune.judge import Objective
from annelid.experiment.tune.search import START, Task, Trial, best, compromise, front
from annelid.output import write_csv
from annelid.textfiles import toml_value

if TYPE_CHECKING:
    from rich.table import Table

HISTORY, BEST, FRONT, FIGURE = "trials.csv", "best.toml", "front", "tuning"
_ROWS = {
    "speed (m/s)": "speed_m_per_s",
    "body lengths/s": "speed_body_lengths_per_s",
    "cost of transport": "cost_of_transport",
    "the same, net work": "cost_of_transport_net",
    "the same, cables": "cost_of_transport_cables",
    "slip ratio": "slip_ratio",
    "period (s)": "period_s",
    "cycles": "cycles",
}
MOST_SHOWN = 8
"""Gaits of a Pareto front in the table, evenly picked from it."""


def chosen(task: Task, trials: Sequence[Trial]) -> Trial | None:
    """Returns the best gait: of one objective the best, of two the front's nearest to the ideal; None if none walks."""
    if len(task.objectives) == 1:
        return best(trials, task.objectives[0])
    return compromise(trials, task.objectives)


def write_results(task: Task, trials: Sequence[Trial], command: str, folder: Path) -> list[Path]:
    """Writes what has been found so far: the CSV, the figure, and the best gaits where one walks.

    Args:
        task: What is tuned.
        trials: All trials so far, the start first.
        command: The command line that makes them.
        folder: Where to.

    Returns:
        The paths of the CSV, the picture in pixels and the best gait.

    Raises:
        RunFileError: A file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_trials(task, trials, folder / HISTORY)
    written = [folder / HISTORY, _figure(task, trials, folder / FIGURE)]
    leader = chosen(task, trials)
    if leader is not None:
        write_gait(task, leader, command, folder / BEST)
        written.append(folder / BEST)
    if len(task.objectives) == 2:
        (folder / FRONT).mkdir(exist_ok=True)
        for old in (folder / FRONT).glob("*.toml"):
            old.unlink()
        for trial in front(trials, task.objectives):
            write_gait(task, trial, command, folder / FRONT / f"{_name(trial)}.toml")
    return written


def write_trials(task: Task, trials: Sequence[Trial], path: Path) -> None:
    """Writes one row a trial as CSV with a header.

    Raises:
        RunFileError: The file cannot be written.
    """
    fields = [variable.field for variable in task.variables]
    columns = ["trial", *fields, *_ROWS.values(), "problem", "run"]
    write_csv(path, columns, (_cells(trial, fields) for trial in trials))


def _cells(trial: Trial, fields: Sequence[str]) -> list[object]:
    numbers = [_number(trial, name) for name in _ROWS.values()]
    values = [_plain(field_value(trial.case.config, field)) for field in fields] if _built(trial) else []
    row = [_name(trial), *(values or [_plain(trial.values[field]) for field in fields]), *numbers]
    return [*row, trial.judged.problem, trial.path.name]


def write_gait(task: Task, trial: Trial, command: str, path: Path) -> None:
    """Writes a gait as a file that `annelid run` takes: what it extends, and every field that was changed.

    Raises:
        RunFileError: The file cannot be written.
    """
    before = task.start.config
    lines = [
        f"Tuned by: {command} ({task.n_trials} trials, seed {task.seed})",
        f"{'Trial ' if trial.number != START else ''}{_name(trial)}:",
    ]
    lines += [f"  {label}: {number}" for label, name in _ROWS.items() if (number := _number(trial, name))]
    lines += [f"  before: {field} = {toml_value(field_value(before, field))}" for field in trial.values]
    summary = f"{before.name}, tuned for {_words(task.objectives)}"
    extend(path, task.source, {"name": path.stem, "summary": summary, **task.changes, **trial.values}, lines)


def results_table(task: Task, trials: Sequence[Trial]) -> Table:
    """Returns the gait that was started from and the best ones side by side."""
    from rich.table import Table

    leaders = _thinned(front(trials, task.objectives)) if len(task.objectives) == 2 else [chosen(task, trials)]
    shown = [trials[0], *(one for one in leaders if one is not None and one.number != START)]
    table = Table(title=f"{task.start.config.name}, tuned for {_words(task.objectives)}")
    table.add_column("trial")
    for trial in shown:
        table.add_column(_name(trial), justify="right")
    for label, name in _ROWS.items():
        table.add_row(label, *(_number(trial, name) for trial in shown))
    table.add_section()
    for variable in task.variables:
        table.add_row(variable.field, *(_plain(field_value(trial.case.config, variable.field)) for trial in shown))
    failed = sum(bool(trial.judged.problem) for trial in trials[1:])
    table.caption = f"{len(trials) - 1} trials, of which {failed} did not walk"
    return table


def _figure(task: Task, trials: Sequence[Trial], stem: Path) -> Path:
    labels = [objective.label for objective in task.objectives]
    values = [tuple(trial.judged.value(one) for one in task.objectives) for trial in trials]
    marks = [Mark(trial.number, value, not trial.judged.problem) for trial, value in zip(trials, values, strict=True)]
    more_is_better = task.objectives[0].better == "more"
    if len(task.objectives) == 1:
        return progress_figure(marks, labels[0], more_is_better, stem)
    on_front = {trial.number for trial in front(trials, task.objectives)}
    return pareto_figure(marks, on_front, (labels[0], labels[1]), more_is_better, stem)


def _thinned(leaders: list[Trial]) -> list[Trial]:
    places = np.linspace(0, len(leaders) - 1, min(len(leaders), MOST_SHOWN))
    return [leaders[round(place)] for place in places.tolist()]


def _built(trial: Trial) -> bool:
    return not trial.judged.problem.startswith("cannot be built")


def _name(trial: Trial) -> str:
    return "start" if trial.number == START else str(trial.number)


def _words(objectives: Sequence[Objective]) -> str:
    return " and ".join(one.name.replace("-", " ") for one in objectives)


def _number(trial: Trial, name: str) -> str:
    """A number of a trial's gait; empty where there is none."""
    number = None if trial.judged.gait is None else getattr(trial.judged.gait, name)
    return "" if number is None else f"{number:.4g}"


def _plain(value: Any) -> str:
    return toml_value(value).strip('"')

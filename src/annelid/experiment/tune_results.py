"""What a search leaves behind: its trials as CSV, its best gaits as files that run, a table, a figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from annelid.config import field_value, toml_value
from annelid.draw.figures.tuning import Mark, pareto_figure, progress_figure
from annelid.experiment.case import write_worm
from annelid.experiment.tune import START, Task, Trial, front, leader
from annelid.output import write_csv

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

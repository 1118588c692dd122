"""Sweeps: fields of a configuration varied over a grid or in samples, all runs in one labelled dataset.

Beside the dataset (netCDF), a sweep leaves a row a run as CSV, a figure, and a table of the highest, lowest and failed
runs.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version
from itertools import product, zip_longest
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from rich.table import Table

from annelid.analysis import NUMBERS, Number
from annelid.config import (
    RunConfig,
    Study,
    Vary,
    field_paths,
    load_config,
    load_study,
    toml_value,
    unit_of,
)
from annelid.config.study import INSTEAD, MOST_RUNS
from annelid.draw.figures.sweep import sweep_figure, worded
from annelid.errors import ConfigError, shown
from annelid.experiment.case import Case
from annelid.experiment.check import MORE, Check, check_runs, percent, refinements
from annelid.experiment.executors import workers
from annelid.experiment.numbers import PREFERRED, chosen_numbers
from annelid.experiment.progress import StudyProgress
from annelid.experiment.space import Choice, Variable, from_unit, sampled, unit_samples, variables_of
from annelid.experiment.store import Done, Store
from annelid.output import whole_file, write_csv
from annelid.simulation.lock import locks

__all__ = ["Sweep", "sweep"]

SAMPLE, REPEAT, SEGMENT = "sample", "repeat", "segment"
"""Dimensions beside those of the varied fields."""
RUNS, DATASET, ROWS, FIGURE = "runs", "sweep.nc", "sweep.csv", "sweep"
"""What is in the folder of the results."""
N_SHOWN = 4
"""Numbers in the table and panels in the figure."""
N_ENDS, N_FAILED = 3, 8
"""Rows of the table: from either end, and of reasons."""
LONG_S = 100 * 3600.0
"""Studies that take longer on one core begin with a warning, s."""


@dataclass(frozen=True)
class Plan:
    """All runs of a sweep: the fields of a configuration that are varied, by dotted path."""

    study: Study
    base: RunConfig
    fields: tuple[str, ...]
    samples: Sequence[tuple[Any, ...]]
    """Values of the fields of each combination or sample, ``(n, n_fields)``."""
    levels: Mapping[str, Sequence[Any]]
    """By dimension, what stands along it: a field's values, numbers of samples, seeds of repeats."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the dimensions."""
        return tuple(len(levels) for levels in self.levels.values())

    @cached_property
    def points(self) -> tuple[tuple[Mapping[str, Any], Case], ...]:
        """Each run with its values of the varied fields by dotted path, the last dimension counting fastest."""
        fixed = flattened(self.study.set)
        seeds = [{"seed": seed} for seed in self.levels[REPEAT]] if REPEAT in self.levels else [{}]
        varied = [dict(zip(self.fields, sample, strict=True)) for sample in self.samples]
        return tuple((values, Case(self.study.preset, fixed | values | seed)) for values in varied for seed in seeds)


@dataclass(frozen=True)
class Sweep:
    """A sweep that is done.

    Attributes:
        plan: The design.
        numbers: What is read from every run.
        runs: What became of the plan's points, in their order.
        folder: Folder of the results.
        checks: What the check of a run has found, by the run's number; only of those that were checked.
    """

    plan: Plan
    numbers: tuple[Number, ...]
    runs: tuple[Done, ...]
    folder: Path
    checks: Mapping[int, Check]

    @property
    def checked(self) -> list[str]:
        """What the check says of each run: "resolved" or its sentence; empty where it was not checked."""
        found = map(self.checks.get, range(len(self.runs)))
        return ["" if one is None else "resolved" if one.resolved else one.sentence for one in found]

    @cached_property
    def data(self) -> xr.Dataset:
        """All numbers, labelled, each with ``units`` and ``long_name``; NaN where a run has none.

        They lie along every varied field of a grid, by dotted path, or along ``sample``; ``repeat`` has the seeds of
        repeats and ``segment`` counts from 1.
        """
        plan, dims = self.plan, tuple(self.plan.levels)
        variables: dict[str, Any] = {}
        words = {name: (text, [words_of(run) for run in self.runs]) for name, (text, words_of) in _WORDS.items()}
        words["check"] = ("resolved, or what moves at half the step or with one more element a side", self.checked)
        for name, (text, of_runs) in words.items():
            table = np.array(of_runs, dtype=object).reshape(plan.shape)
            variables[name] = (dims, table, {"units": "1", "long_name": text})
        outcomes = [run.outcome for run in self.runs]
        read = {
            number: [None if one is None else getattr(one.summary, number.name) for one in outcomes]
            for number in self.numbers
        }
        lengths = [len(value or ()) for number, values in read.items() if number.per_segment for value in values]
        n_segments = max(lengths, default=0)
        for number, values in read.items():
            below = {SEGMENT: n_segments} if number.per_segment else {}
            table = np.full((len(values), prod(below.values())), np.nan)
            for row, value in zip(table, values, strict=True):
                if value is not None:
                    row[: np.size(value)] = np.array(value, dtype=float)
            attrs = {"units": number.unit, "long_name": number.meaning}
            variables[number.name] = ((*dims, *below), table.reshape(*plan.shape, *below.values()), attrs)
        counted = {SAMPLE: "number of the sample", REPEAT: "seed of the run", SEGMENT: "segment, from the front"}
        levels = dict(plan.levels) | ({SEGMENT: range(1, n_segments + 1)} if lengths else {})
        coords: dict[str, Any] = {
            name: (name, np.array(levels[name]), {"units": "1", "long_name": text})
            for name, text in counted.items()
            if name in levels
        }
        meanings = field_paths()
        for i, field in enumerate(plan.fields):
            dim, values = (field, levels[field]) if field in levels else (SAMPLE, [row[i] for row in plan.samples])
            attrs = {"units": unit_of(field) or "1", "long_name": meanings[field] or field}
            coords[field] = (dim, _column(values), attrs)
        return xr.Dataset(
            variables,
            coords=coords,
            attrs={
                "title": plan.study.name,
                "study": plan.study.model_dump_json(by_alias=True),
                "base_config": plan.base.model_dump_json(),
                "annelid_version": version("annelid"),
                "n_failed": sum(run.status == "failed" for run in self.runs),
                "n_warned": sum(bool(run.warnings) for run in self.runs),
            },
        )


_WORDS: Mapping[str, tuple[str, Callable[[Done], str]]] = {
    "status": ("complete, stopped by a guard, or failed", lambda run: run.status),
    "reason": ("why a run is not complete", lambda run: run.reason),
    "run": ("folder of the run", lambda run: "" if run.outcome is None else run.outcome.path.name),
    "rhythm": ("verdict on the rhythm", lambda run: "" if run.outcome is None else run.outcome.rhythm.verdict or ""),
    "warnings": ("what is doubtful about a run, a sentence a line", lambda run: "\n".join(run.warnings)),
}


def _column(values: Sequence[Any]) -> np.ndarray:
    """Values of a field as numbers where all are, else as words."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values)
    return np.array([label(value) for value in values], dtype=object)


def label(value: Any) -> str:
    """Writes a value of a field for an axis or a table."""
    return value if isinstance(value, str) else toml_value(value)


@locks("folder")
def sweep(
    study: Study | str | Path | Mapping[str, Any],
    folder: str | Path = "sweep",
    *,
    executor: Executor | None = None,
    jobs: int | None = None,
    check: int = 0,
    progress: StudyProgress | None = None,
    cluster: object = None,
) -> xr.Dataset:
    """Computes a sweep, writes its results, and returns them.

    Call it below ``if __name__ == "__main__":``, since workers start as new processes.

    Args:
        study: The study, the path of its TOML file, or a nested mapping.
        folder: Folder for ``sweep.nc``, ``sweep.csv``, a figure, and the runs, which a second call finds there.
        executor: Who computes the runs; None for processes of this machine.
        jobs: How many processes, by default one a core.
        check: How many of the runs are repeated at half the step and with one more element a side.
        progress: Called at the start and after every run.
        cluster: Replaced by ``executor``, and refused.

    Returns:
        Every number of summary and gait with ``units`` and ``long_name``: along the varied fields of a grid, or along
        ``sample``; further along ``repeat`` and ``segment`` where there are such. ``status``, ``reason``, ``warnings``
        and ``run`` say of each run whether it is complete, why not, what is doubtful about it, and its folder;
        ``check`` is "resolved" or what moves in finer runs, and empty where a run was not checked.

    Raises:
        ConfigError: The study is refused, or all of its runs are, or one to be checked has a step that is no multiple
            of twice the control step.
        ClusterError: The workers are lost for good; finished runs are kept.
        RunFileError: A file cannot be written.
        KeyboardInterrupt: Finished runs are kept, and the results if only the check was interrupted.
    """
    if cluster is not None:
        raise ConfigError(f"cluster = {shown(cluster)}: clusters have no names any more: {INSTEAD}")
    with workers(executor, jobs) as given:
        done = swept(load_study(study), Path(folder), executor=given, check=check, progress=progress)
    write_results(done)
    return done.data


def swept(
    study: Study,
    folder: Path,
    *,
    executor: Executor | None = None,
    check: int = 0,
    progress: StudyProgress | None = None,
) -> Sweep:
    """Computes a sweep as `sweep` does, in a folder that the caller has locked.

    Writes nothing but the runs and, before a check begins, the results as they are without it.
    """
    numbers = chosen_numbers(study.outputs, study.rank)
    plan = plan_of(study)
    cases = [case for _, case in plan.points]
    refusals = [_refusal(case) if check else None for case in cases]
    for i in to_check(plan, check, [True] * len(cases)):
        if (refusal := refusals[i]) is not None:
            raise refusal
    store = Store(folder / RUNS, executor, study.keep, progress)
    done = store.finish(cases, "sweep")
    if all(one.refused for one in done) and done[0].error is not None:
        raise done[0].error
    found = Sweep(plan, numbers, tuple(done), folder, {})
    if check:
        # Whoever interrupts the check keeps the sweep.
        write_results(found)
        usable = [one.status == "complete" and no is None for one, no in zip(done, refusals, strict=True)]
        chosen = to_check(plan, check, usable)
        found = replace(found, checks=dict(zip(chosen, check_runs(store, [cases[i] for i in chosen]), strict=True)))
    return found


def _refusal(case: Case) -> ConfigError | None:
    """Why a run cannot be checked; None also where it cannot even be built, since that is told as its failure."""
    try:
        config = case.config
    except ConfigError:
        return None
    try:
        refinements(config)
    except ConfigError as error:
        return error
    return None


def to_check(plan: Plan, n: int, usable: Sequence[bool]) -> list[int]:
    """Returns the numbers of n runs, spread evenly over the plan; in place of one that is not usable the nearest is.

    Of runs that differ in their seed only, a second is taken once there is one of all others.
    """
    if n < 0:
        raise ConfigError(f"check = {n}: must be at least 0")
    cells: dict[str, list[int]] = {}
    for i, (_, case) in enumerate(plan.points):
        its = cells.setdefault(repr([item for item in case.changes.items() if item[0] != "seed"]), [])
        its += [i] if usable[i] else []
    chosen: list[int] = []
    for one_each in zip_longest(*cells.values()):
        free = {at: run for at, run in enumerate(one_each) if run is not None}
        places = np.linspace(0, len(one_each) - 1, min(n - len(chosen), len(free))).round()
        chosen += [free.pop(min(free, key=lambda at, place=place: abs(at - place))) for place in places]
    return sorted(chosen)


def checked_sentence(sweep: Sweep) -> str:
    """Says how many of the runs are resolved, and which are not and why."""
    if not sweep.checks:
        return "No run is complete, so none was checked."
    more = any(one.name == MORE for check in sweep.checks.values() for one in check.refinements)
    how = f"at half the step{' and with one more element a side' if more else ''}"
    faults = [f"{_named(sweep, i)} ({_brief(check)})" for i, check in sweep.checks.items() if not check.resolved]
    n = len(sweep.checks)
    said = f"Checked {n} of {len(sweep.runs)} runs {how}: {n - len(faults) if faults else 'all'} resolved"
    if len(faults) > N_FAILED:
        faults[N_FAILED:] = [f"{len(faults) - N_FAILED} more, which {ROWS} has"]
    return f"{said}{'; not resolved: ' if faults else ''}{', '.join(faults)}."


def _named(sweep: Sweep, i: int) -> str:
    """Names a run by its varied fields, or by its number where these are many."""
    fields = [*sweep.plan.fields, "seed"]
    pairs = zip(fields, _varied(sweep, i), strict=False)
    return f"run {i}" if len(sweep.plan.fields) > 2 else ", ".join(f"{field} = {value}" for field, value in pairs)


def _brief(check: Check) -> str:
    """What keeps a run from being resolved, in a few words: another order, or the number that moves most."""
    if check.differences:
        return check.differences[0]
    worst, n = max(check.unresolved, key=lambda name: check.largest(name) or 0.0), len(check.unresolved)
    words = worded(worst, NUMBERS[worst].unit).partition(" (")[0]
    return f"{words} {percent(check.largest(worst) or 0.0)}{f' and {n - 1} more' if n > 1 else ''}"


def plan_of(study: Study) -> Plan:
    """Lays out the runs of a study; refuses too many of them."""
    base = load_config(study.preset, flattened(study.set))
    variables = variables_of(study.vary, base)
    fields = tuple(variable.field for variable in variables)
    if "seed" in fields and study.repeats > 1:
        raise ConfigError(f"vary 'seed' and repeats = {study.repeats} both set the seed: leave one out")
    grid = {} if study.samples else dict(zip(fields, map(_levels, variables, study.vary), strict=True))
    levels: dict[str, Sequence[Any]] = dict(grid) or {SAMPLE: range(study.samples or 0)}
    if study.repeats > 1:
        levels[REPEAT] = range(base.seed, base.seed + study.repeats)
    n = prod(map(len, levels.values()))
    total_s = n * Case(study.preset, flattened(study.set)).cost_s
    size = f"the study has {n:,} runs, about {total_s / 3600:,.0f} hours of one core"
    if n > MOST_RUNS:
        raise ConfigError(f"{size}: it must have at most {MOST_RUNS:,}; take fewer values, samples or repeats")
    if total_s > LONG_S:
        warnings.warn(size, stacklevel=2)
    if grid:
        samples = list(product(*grid.values()))
    else:
        places = unit_samples(study.design, study.samples or 0, len(variables), study.seed)
        samples = [tuple(map(sampled, variables, row)) for row in places.tolist()]
    return Plan(study, base, fields, samples, levels)


def flattened(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Returns the fields of nested tables by dotted path."""
    fields: dict[str, Any] = {}
    for name, value in tree.items():
        path = f"{prefix}{name}"
        fields |= flattened(value, f"{path}.") if isinstance(value, Mapping) else {path: value}
    return fields


def _levels(variable: Variable, vary: Vary) -> tuple[Any, ...]:
    if isinstance(variable, Choice):
        return variable.values
    shares = np.linspace(0.0, 1.0, vary.number or 0).tolist()
    levels = tuple(dict.fromkeys(from_unit(variable, share) for share in shares))
    if len(levels) != vary.number:
        raise ConfigError(
            f"vary {variable.field!r}: number = {vary.number}: from {variable.low:g} to {variable.high:g} there are "
            f"only {len(levels)} distinct values"
        )
    return levels


def write_results(sweep: Sweep) -> list[Path]:
    """Writes a sweep's dataset, its rows and its figure; without the figure where there is no number to draw."""
    sweep.folder.mkdir(parents=True, exist_ok=True)
    path = sweep.folder / DATASET
    with whole_file(path) as draft:
        sweep.data.to_netcdf(draft, engine="h5netcdf")
    written = [path, _write_rows(sweep, sweep.folder / ROWS)]
    if names := shown_numbers(sweep):
        written.append(sweep_figure(_drawn(sweep.data, names), sweep.plan.fields, names, sweep.folder / FIGURE))
    return written


def _write_rows(sweep: Sweep, path: Path) -> Path:
    """Writes one row a run as CSV with a header; what there is per segment has a column for each."""
    columns: dict[str, np.ndarray] = {}
    for number in sweep.numbers:
        values = sweep.data[number.name].values.reshape(len(sweep.runs), -1)
        names = [f"{number.name}_{i}" for i in sweep.data[SEGMENT].values] if number.per_segment else [number.name]
        columns |= dict(zip(names, values.T, strict=True))
    checked = sweep.checked
    rows = (
        [
            i,
            *_varied(sweep, i),
            run.status,
            run.reason,
            " | ".join(run.warnings),
            checked[i],
            "" if run.outcome is None else run.outcome.path.name,
            *("" if np.isnan(values[i]) else f"{values[i]:.10g}" for values in columns.values()),
        ]
        for i, run in enumerate(sweep.runs)
    )
    seed = ["seed"] if REPEAT in sweep.plan.levels else []
    words = ["status", "reason", "warnings", "check", "run"]
    return write_csv(path, ["number", *sweep.plan.fields, *seed, *words, *columns], rows)


def shown_numbers(sweep: Sweep) -> list[str]:
    """Returns which numbers the table and the figure show: the one to rank by first, and only such as there are."""
    study, kept = sweep.plan.study, {number.name for number in sweep.numbers}
    wanted = dict.fromkeys([*([] if study.rank is None else [study.rank]), *(study.outputs or PREFERRED)])
    return [name for name in wanted if name in kept and bool(np.isfinite(sweep.data[name]).any())][:N_SHOWN]


def _drawn(data: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Numbers to draw, those per segment as their mean over the segments."""
    chosen = data[[*names, "status"]]
    for name in names:
        if SEGMENT in chosen[name].dims:
            text = f"{chosen[name].attrs['long_name']}, mean of segments"
            chosen[name] = chosen[name].mean(SEGMENT).assign_attrs(chosen[name].attrs | {"long_name": text})
    return chosen


def results_table(sweep: Sweep) -> Table:
    """Returns the runs with the highest and the lowest values of the first number, and those that failed and why."""
    plan, names = sweep.plan, shown_numbers(sweep)
    drawn = _drawn(sweep.data, names)
    columns = [drawn[name].values.reshape(-1) for name in names]
    content = f"highest and lowest {names[0]}" if names else "no number has a value"
    table = Table(title=f"{plan.study.name}: {content}", caption=_caption(sweep))
    heads = [worded(name.rsplit(".", 1)[-1], sweep.data[name].attrs["units"]) for name in (*plan.fields, *names)]
    n = len(plan.fields)
    for head in ("run", *heads[:n], *([REPEAT] if REPEAT in plan.levels else []), *heads[n:]):
        table.add_column(head, justify="right")
    if names:
        order = [i for i in np.argsort(-columns[0], kind="stable").tolist() if np.isfinite(columns[0][i])]
        for rows in [order] if len(order) <= 2 * N_ENDS else [order[:N_ENDS], order[-N_ENDS:]]:
            for i in rows:
                values = ("" if np.isnan(column[i]) else f"{column[i]:.4g}" for column in columns)
                table.add_row(str(i), *_varied(sweep, i), *values)
            table.add_section()
    return table


def failures(sweep: Sweep) -> list[tuple[str, list[int]]]:
    """Returns why runs failed or were stopped, and the numbers of those runs, the most frequent reason first."""
    by_reason: dict[str, list[int]] = {}
    for i, run in enumerate(sweep.runs):
        if run.status != "complete":
            by_reason.setdefault(f"{run.status}: {run.reason}", []).append(i)
    return sorted(by_reason.items(), key=lambda item: -len(item[1]))


def _caption(sweep: Sweep) -> str:
    reasons = failures(sweep)
    lines = [f"{len(sweep.runs)} runs, of which {sum(run.status == 'complete' for run in sweep.runs)} are complete"]
    if doubtful := [i for i, run in enumerate(sweep.runs) if run.warnings]:
        lines[0] += f", and {len(doubtful)} have warnings (run {_listed(doubtful)}), which {ROWS} has"
    lines += [f"{len(numbers)} {reason} (run {_listed(numbers)})" for reason, numbers in reasons[:N_FAILED]]
    if len(reasons) > N_FAILED:
        lines.append(f"{len(reasons) - N_FAILED} more reasons in {ROWS}")
    return "\n".join(lines)


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:5])) + (", .." if len(numbers) > 5 else "")


def _varied(sweep: Sweep, i: int) -> list[str]:
    """Values of the varied fields of a run, and its seed where there are repeats."""
    values, case = sweep.plan.points[i]
    seed = [str(case.changes["seed"])] if REPEAT in sweep.plan.levels else []
    return [*map(label, values.values()), *seed]

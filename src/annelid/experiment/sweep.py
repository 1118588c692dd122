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
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from rich.table import Table

from annelid.analysis import NUMBERS, Number, three_digits
from annelid.config import RunConfig, Study, Vary, field_paths, load_config, load_study, toml_value, unit_of
from annelid.config.study import MOST_RUNS
from annelid.draw.figures.sweep import sweep_figure, worded
from annelid.errors import ConfigError, suggest
from annelid.experiment.case import Case
from annelid.experiment.convergence import Check, check_runs
from annelid.experiment.executors import workers
from annelid.experiment.progress import StudyProgress
from annelid.experiment.search_space import (
    Choice,
    Variable,
    from_unit,
    sampled,
    spread_evenly,
    unit_samples,
    variables_of,
)
from annelid.experiment.store import Done, Store
from annelid.output import whole_file, write_csv
from annelid.protocols import Array
from annelid.simulation.lock import locks

__all__ = ["Sweep", "sweep"]

SAMPLE, REPEAT, SEGMENT = "sample", "repeat", "segment"
"""Dimensions beside those of the varied fields."""
RUNS, DATASET, ROWS, FIGURE = "runs", "sweep.nc", "sweep.csv", "sweep"
"""What is in the folder of the results."""
PREFERRED = ("speed_m_per_s", "cost_of_transport", "slip_ratio", "period_s", "travel_m", "elongation_mean_max_m")
"""What a table and a figure show first unless the study says otherwise."""
N_SHOWN = 4
"""Numbers in the table and panels in the figure."""
N_ENDS, N_FAILED = 3, 8
"""Rows of the table: from either end, and of reasons."""
WORDS: Mapping[str, tuple[str, Callable[[Done, Check | None], str]]] = {
    "status": ("complete, stopped by a guard, or failed", lambda run, _: run.status),
    "reason": ("why a run is not complete", lambda run, _: run.reason),
    "rhythm": ("verdict on the rhythm", lambda run, _: "" if run.outcome is None else run.outcome.rhythm.verdict or ""),
    "warnings": ("what is doubtful about a run", lambda run, _: " | ".join(run.warnings)),
    "check": (
        "resolved, or what moves at half the step or with one more element a side",
        lambda _, check: "" if check is None else "; ".join(check.faults) or "resolved",
    ),
    "run": ("folder of the run", lambda run, _: "" if run.outcome is None else run.outcome.path.name),
}
"""What is said of each run beside its numbers, and what that is."""
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
        follows = dict(zip(self.fields, (vary.follow for vary in self.study.vary), strict=True))
        return tuple(
            (values, Case(self.study.preset, fixed | values | _following(follows, values) | seed))
            for values in varied
            for seed in seeds
        )


def _following(follows: Mapping[str, Mapping[str, float]], values: Mapping[str, Any]) -> dict[str, float]:
    """Values of the fields that keep a ratio to a varied one, by dotted path."""
    return {
        path: float(f"{ratio * values[field]:.6g}") for field, paths in follows.items() for path, ratio in paths.items()
    }


@dataclass(frozen=True)
class Sweep:
    """A sweep that is done.

    Attributes:
        plan: The design.
        numbers: What is read from every run.
        runs: What became of the plan's points, in their order.
        folder: Folder of the results.
        checks: What finer runs have found, by the number of the run; only of those that were checked.
    """

    plan: Plan
    numbers: tuple[Number, ...]
    runs: tuple[Done, ...]
    folder: Path
    checks: Mapping[int, Check]

    @cached_property
    def values(self) -> dict[str, Array]:
        """The numbers of every run, ``(n_runs, 1)`` or ``(n_runs, n_segments)``, by name; NaN where a run has none."""
        summaries = [None if run.outcome is None else run.outcome.summary for run in self.runs]
        n_segments = max((one.n_segments for one in summaries if one is not None), default=0)
        found = {}
        for number in self.numbers:
            table = np.full((len(summaries), n_segments if number.per_segment else 1), np.nan)
            for row, one in zip(table, summaries, strict=True):
                if (value := getattr(one, number.name, None)) is not None:
                    row[: np.size(value)] = np.array(value, dtype=float)
            found[number.name] = table
        return found

    @cached_property
    def rows(self) -> pd.DataFrame:
        """A row a run: varied fields, seed of a repeat, what is said of it, numbers; one per segment has columns."""
        plan = self.plan
        columns: dict[str, Any] = {field: [label(values[field]) for values, _ in plan.points] for field in plan.fields}
        if REPEAT in plan.levels:
            columns["seed"] = [str(case.changes["seed"]) for _, case in plan.points]
        checked = [(run, self.checks.get(i)) for i, run in enumerate(self.runs)]
        columns |= {name: [said(*one) for one in checked] for name, (_, said) in WORDS.items()}
        for number in self.numbers:
            values = self.values[number.name]
            endings = [f"_{i + 1}" for i in range(values.shape[1])] if number.per_segment else [""]
            columns |= zip((f"{number.name}{ending}" for ending in endings), values.T, strict=True)
        return pd.DataFrame(columns).rename_axis("number")

    @cached_property
    def data(self) -> xr.Dataset:
        """All numbers, labelled, each with ``units`` and ``long_name``; NaN where a run has none.

        They lie along every varied field of a grid, by dotted path, or along ``sample``; ``repeat`` has the seeds of
        repeats and ``segment`` counts from 1.
        """
        plan, dims = self.plan, tuple(self.plan.levels)
        levels = dict(plan.levels)
        variables: dict[str, Any] = {}
        for name, (text, _) in WORDS.items():
            table = self.rows[name].to_numpy(dtype=object).reshape(plan.shape)
            variables[name] = (dims, table, {"units": "1", "long_name": text})
        for number in self.numbers:
            table, attrs = self.values[number.name], {"units": number.unit, "long_name": number.meaning}
            if number.per_segment:
                levels[SEGMENT] = range(1, table.shape[1] + 1)
                variables[number.name] = ((*dims, SEGMENT), table.reshape(*plan.shape, -1), attrs)
            else:
                variables[number.name] = (dims, table.reshape(plan.shape), attrs)
        counted = {SAMPLE: "number of the sample", REPEAT: "seed of the run", SEGMENT: "segment, from the front"}
        coords: dict[str, Any] = {
            name: (name, np.array(levels[name]), {"units": "1", "long_name": text})
            for name, text in counted.items()
            if name in levels
        }
        meanings = field_paths()
        for i, field in enumerate(plan.fields):
            dim, values = (field, levels[field]) if field in levels else (SAMPLE, [row[i] for row in plan.samples])
            attrs = {"units": unit_of(field) or "1", "long_name": meanings.get(field) or field}
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
) -> xr.Dataset:
    """Computes a sweep, writes its results, and returns them.

    Call it below ``if __name__ == "__main__":``, since workers start as new processes.

    Args:
        study: The study, the path of its TOML file, or a nested mapping.
        folder: Folder for ``sweep.nc``, ``sweep.csv``, a figure, and the runs, which a second call finds there.
        executor: Who computes the runs; None for processes of this machine.
        jobs: How many processes, by default one a core.
        check: How many complete runs, spread evenly, run also at half the step and with one more element a side.
        progress: Called at the start and after every run.

    Returns:
        Every number of summary and gait with ``units`` and ``long_name``: along the varied fields of a grid, or along
        ``sample``; further along ``repeat`` and ``segment`` where there are such. ``status``, ``reason``, ``warnings``
        and ``run`` say of each run whether it is complete, why not, what is doubtful about it, and its folder;
        ``check`` is "resolved" or what moves in finer runs, and empty where a run was not checked.

    Raises:
        ConfigError: The study is refused, or all of its runs are, or ``check`` is negative.
        ClusterError: The workers are lost for good; finished runs are kept.
        RunFileError: A file cannot be written.
        KeyboardInterrupt: Finished runs are kept, and the results if the check is interrupted.
    """
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

    Writes nothing but the runs and, before a check begins, the results without it.
    """
    if check < 0:
        raise ConfigError(f"check = {check}: must be at least 0")
    numbers = chosen_numbers(study.outputs, study.rank)
    plan = plan_of(study)
    cases = [case for _, case in plan.points]
    store = Store(folder / RUNS, executor, study.keep, progress)
    done = store.finish(cases, "sweep")
    if all(one.refused for one in done) and done[0].error is not None:
        raise done[0].error
    found = Sweep(plan, numbers, tuple(done), folder, {})
    if study.rank is not None and study.rank not in (names := shown_numbers(found)):
        instead = f"the table and the figure begin with {names[0]}" if names else "there is no figure"
        warnings.warn(
            f"rank = {study.rank!r}: no run has a value of it, so {instead}; a longer duration_s may give one",
            stacklevel=2,
        )
    if check:
        write_results(found)
        chosen = spread_evenly(check, [i for i, one in enumerate(done) if one.status == "complete"])
        found = replace(found, checks=dict(zip(chosen, check_runs(store, [cases[i] for i in chosen]), strict=True)))
    return found


def checked_sentence(sweep: Sweep) -> str:
    """Says how many of the runs were checked, and names those that are not resolved."""
    faults = [str(i) for i, one in sweep.checks.items() if not one.resolved]
    found = f"not resolved: run {', '.join(faults)}; {ROWS} says what moves" if faults else "all resolved"
    return f"Checked {len(sweep.checks)} of {len(sweep.runs)} runs{': ' + found if sweep.checks else ''}."


def chosen_numbers(names: Sequence[str], rank: str | None) -> tuple[Number, ...]:
    """Returns numbers by name, all for none; the one to rank runs by must be among them, and not one per segment."""
    known = {name: number for name, number in NUMBERS.items() if number.in_sweeps}
    for name in names:
        if name not in known:
            raise ConfigError(f"outputs: unknown number {name!r}: {suggest(name, known)}")
    chosen = tuple(known[name] for name in dict.fromkeys(names or known))
    scalars = [number.name for number in chosen if not number.per_segment]
    if rank is not None and rank not in scalars:
        raise ConfigError(
            f"rank = {rank!r}: must be one of the outputs with one number per run: {suggest(rank, scalars)}"
        )
    return chosen


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
    # NaN alone is not equal to itself.
    cells = sweep.rows.reset_index().map(
        lambda one: ("" if one != one else f"{one:.10g}") if isinstance(one, float) else one
    )
    written = [path, write_csv(sweep.folder / ROWS, cells.columns, cells.itertuples(index=False))]
    if names := shown_numbers(sweep):
        written.append(sweep_figure(_drawn(sweep.data, names), sweep.plan.fields, names, sweep.folder / FIGURE))
    return written


def shown_numbers(sweep: Sweep) -> list[str]:
    """Returns which numbers the table and the figure show: the one to rank by first, and only such as there are."""
    study, kept = sweep.plan.study, {number.name for number in sweep.numbers}
    wanted = dict.fromkeys([*([] if study.rank is None else [study.rank]), *(study.outputs or PREFERRED)])
    return [name for name in wanted if name in kept and bool(np.isfinite(sweep.data[name]).any())][:N_SHOWN]


def _drawn(data: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """Numbers to draw, as a run's table has them, those per segment as their mean over the segments."""
    chosen = data[[*names, "status"]]
    for name in names:
        number, values, of = NUMBERS[name], chosen[name], ""
        if SEGMENT in values.dims:
            values, of = values.mean(SEGMENT), ", mean of segments"
        heading = (number.heading if number.label else worded(name, number.unit)) + of
        chosen[name] = (number.factor * values).assign_attrs(heading=heading)
    return chosen


def results_table(sweep: Sweep) -> Table:
    """Returns the runs with the highest and the lowest values of the first number, and those that failed and why."""
    plan, names = sweep.plan, shown_numbers(sweep)
    drawn = _drawn(sweep.data, names)
    content = f"highest and lowest {drawn[names[0]].heading}" if names else "no number has a value"
    table = Table(title=f"{plan.study.name}: {content}", caption=_caption(sweep.rows))
    heads = [worded(field.rsplit(".", 1)[-1], sweep.data[field].attrs["units"]) for field in plan.fields]
    heads += [drawn[name].heading for name in names]
    varied = [*plan.fields, *(["seed"] if REPEAT in plan.levels else [])]
    heads[len(plan.fields) : len(plan.fields)] = [REPEAT] if REPEAT in plan.levels else []
    for head in ("run", *heads):
        table.add_column(head, justify="right")
    if names:
        numbers = pd.DataFrame({name: drawn[name].values.ravel() for name in names})
        order = numbers.dropna(subset=names[:1]).sort_values(names[0], ascending=False, kind="stable").index
        for rows in [order] if len(order) <= 2 * N_ENDS else [order[:N_ENDS], order[-N_ENDS:]]:
            for i in rows:
                values = ("" if np.isnan(value) else three_digits(float(value)) for value in numbers.loc[i])
                table.add_row(str(i), *sweep.rows.loc[i, varied], *values)
            table.add_section()
    return table


def _caption(rows: pd.DataFrame) -> str:
    """Says how many runs are complete or doubtful, and why others are not, the most frequent reason first."""
    status: Any = rows["status"]
    warnings: Any = rows["warnings"]
    reasons = status + ": " + rows["reason"]
    lines = [f"{len(rows)} runs, of which {(status == 'complete').sum()} are complete"]
    if doubtful := rows.index[warnings != ""].tolist():
        lines[0] += f", and {len(doubtful)} have warnings (run {_listed(doubtful)}), which {ROWS} has"
    counted = reasons[status != "complete"].value_counts()
    lines += [f"{n} {one} (run {_listed(rows.index[reasons == one])})" for one, n in counted[:N_FAILED].items()]
    if len(counted) > N_FAILED:
        lines.append(f"{len(counted) - N_FAILED} more reasons in {ROWS}")
    return "\n".join(lines)


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:5])) + (", .." if len(numbers) > 5 else "")

"""Sweeps: fields of a configuration varied over a grid or in samples, all runs in one labelled dataset."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import annelid
from annelid.config import (
    Cluster,
    RunConfig,
    Study,
    field_paths,
    find_cluster,
    load_config,
    load_study,
    toml_value,
    unit_of,
)
from annelid.config.study import MOST_RUNS
from annelid.errors import ConfigError
from annelid.experiment.case import Case
from annelid.experiment.cluster import workers_of
from annelid.experiment.numbers import Number, chosen_numbers
from annelid.experiment.progress import StudyProgress
from annelid.experiment.space import Choice, Variable, from_unit, sampled, unit_samples, variables_of
from annelid.experiment.store import Done, Store
from annelid.simulation.lock import locks

__all__ = ["Sweep", "sweep"]

SAMPLE, REPEAT, SEGMENT = "sample", "repeat", "segment"
"""Dimensions beside those of the varied fields."""
RUNS = "runs"
"""Subfolder of the runs."""
LONG_S = 100 * 3600.0
"""Studies that take longer on one core begin with a warning, s."""


@dataclass(frozen=True)
class Plan:
    """All runs of a sweep.

    Attributes:
        study: What the user wrote.
        base: The configuration whose fields are varied.
        fields: The varied fields, by dotted path.
        samples: Values of the fields of each combination or sample, ``(n, n_fields)``.
        levels: By dimension, what stands along it: a field's values, numbers of samples, seeds of repeats.
    """

    study: Study
    base: RunConfig
    fields: tuple[str, ...]
    samples: Sequence[tuple[Any, ...]]
    levels: Mapping[str, Sequence[Any]]

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
    """

    plan: Plan
    numbers: tuple[Number, ...]
    runs: tuple[Done, ...]
    folder: Path

    @cached_property
    def data(self) -> xr.Dataset:
        """All numbers, labelled, each with ``units`` and ``long_name``; NaN where a run has none.

        They lie along every varied field of a grid, by dotted path, or along ``sample``; ``repeat`` has the seeds of
        repeats and ``segment`` counts from 1.
        """
        plan, dims = self.plan, tuple(self.plan.levels)
        variables: dict[str, Any] = {}
        for name, (text, words_of) in _WORDS.items():
            words = np.array([words_of(run) for run in self.runs], dtype=object).reshape(plan.shape)
            variables[name] = (dims, words, {"units": "1", "long_name": text})
        outcomes = [run.outcome for run in self.runs]
        read = {number: [None if one is None else number.read(one) for one in outcomes] for number in self.numbers}
        lengths = [len(value or ()) for number, values in read.items() if number.per_segment for value in values]
        n_segments = max(lengths, default=0)
        for number, values in read.items():
            below = {SEGMENT: n_segments} if number.per_segment else {}
            table = np.full((len(values), prod(below.values())), np.nan)
            for row, value in zip(table, values, strict=True):
                if value is not None:
                    row[: np.size(value)] = np.array(value, dtype=float)
            attrs = {"units": number.unit, "long_name": number.text}
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
            coords[field] = (
                dim,
                _column(values),
                {"units": unit_of(field) or "1", "long_name": meanings[field] or field},
            )
        return xr.Dataset(
            variables,
            coords=coords,
            attrs={
                "title": plan.study.name,
                "study": plan.study.model_dump_json(by_alias=True),
                "base_config": plan.base.model_dump_json(),
                "annelid_version": annelid.__version__,
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
    cluster: Cluster | str | None = None,
    jobs: int | None = None,
    progress: StudyProgress | None = None,
) -> xr.Dataset:
    """Computes a sweep, writes its results, and returns them.

    Call it below ``if __name__ == "__main__":``, since workers start as new processes.

    Args:
        study: The study, the path of its TOML file, or a nested mapping.
        folder: Folder for ``sweep.nc``, ``sweep.csv``, a figure, and the runs, which a second call finds there.
        cluster: Where runs are computed: a section, or a word as `find_cluster` takes; default: processes of this
            machine. What a study says of it is not used, since a scheduler and a job run code: name its file here.
        jobs: Workers, instead of as many as there are cores, or as the cluster says.
        progress: Called at the start and after every run.

    Returns:
        Every number of summary and gait with ``units`` and ``long_name``: along the varied fields of a grid, or along
        ``sample``; further along ``repeat`` and ``segment`` where there are such. ``status``, ``reason``, ``warnings``
        and ``run`` say of each run whether it is complete, why not, what is doubtful about it, and its folder.

    Raises:
        ConfigError: The study is refused, or all of its runs are.
        MissingDependency: Dask or dask-jobqueue is needed and not installed.
        ClusterError: The workers are lost for good; finished runs are kept.
        RunFileError: A file cannot be written.
        KeyboardInterrupt: Finished runs are kept.
    """
    from annelid.experiment.sweep_results import write_results

    to_use = f'pass cluster="{study}"' if isinstance(study, str | Path) else "pass it as cluster"
    done = swept(load_study(study), Path(folder), cluster=cluster, jobs=jobs, progress=progress, to_use=to_use)
    write_results(done)
    return done.data


def swept(
    study: Study,
    folder: Path,
    *,
    cluster: Cluster | str | None = None,
    jobs: int | None = None,
    progress: StudyProgress | None = None,
    to_use: str = "pass it as cluster",
) -> Sweep:
    """Computes a sweep as `sweep` does, in a folder that the caller has locked, and writes nothing but the runs.

    ``to_use`` is what the user has to do to have the cluster used that the study describes, for a sentence.
    """
    numbers = chosen_numbers(study.outputs, study.rank)
    if cluster is None and study.cluster is not None:
        warnings.warn(
            f"the study {study.name!r} describes a cluster ({study.cluster}): not used; {to_use} to use it",
            stacklevel=2,
        )
    to_join = find_cluster(cluster or "processes") if isinstance(cluster, str | None) else cluster
    its_workers = workers_of(to_join, jobs)
    plan = plan_of(study)
    with its_workers as workers:
        cases = [case for _, case in plan.points]
        done = Store(folder / RUNS, workers, study.keep).finish(cases, "sweep", progress=progress)
    if all(one.refused for one in done) and done[0].error is not None:
        raise done[0].error
    return Sweep(plan, numbers, tuple(done), folder)


def plan_of(study: Study) -> Plan:
    """Lays out the runs of a study.

    Raises:
        ConfigError: The preset, a fixed field or a varied field is refused, or there are too many runs.
    """
    base = load_config(study.preset, flattened(study.set))
    variables = variables_of(study.vary, base)
    fields = tuple(variable.field for variable in variables)
    if "seed" in fields and study.repeats > 1:
        raise ConfigError(f"vary 'seed' and repeats = {study.repeats} both set the seed: leave one out")
    _check_size(study)
    levels: dict[str, Sequence[Any]]
    if study.design == "grid":
        levels = {one.field: _levels(one, vary.number) for one, vary in zip(variables, study.vary, strict=True)}
        samples = list(product(*levels.values()))
    else:
        places = unit_samples(study.design, study.samples or 0, len(variables), study.seed)
        samples = [tuple(map(sampled, variables, row)) for row in places.tolist()]
        levels = {SAMPLE: range(len(samples))}
    if study.repeats > 1:
        levels[REPEAT] = range(base.seed, base.seed + study.repeats)
    return Plan(study, base, fields, samples, levels)


def flattened(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Returns the fields of nested tables by dotted path."""
    fields: dict[str, Any] = {}
    for name, value in tree.items():
        below = flattened(value, f"{prefix}{name}.") if isinstance(value, Mapping) else {f"{prefix}{name}": value}
        fields |= below
    return fields


def _levels(variable: Variable, number: int | None) -> tuple[Any, ...]:
    if isinstance(variable, Choice):
        return variable.values
    levels = tuple(dict.fromkeys(from_unit(variable, share) for share in np.linspace(0.0, 1.0, number or 0).tolist()))
    if len(levels) != number:
        raise ConfigError(
            f"vary {variable.field!r}: number = {number}: from {variable.low:g} to {variable.high:g} there are only "
            f"{len(levels)} values to tell apart"
        )
    return levels


def _check_size(study: Study) -> None:
    """Refuses too many runs before they are laid out, and warns of such as take days."""
    n = study.samples or prod(vary.number or len(vary.values or vary.choices or ()) for vary in study.vary)
    n *= study.repeats
    total_s = n * Case(study.preset, flattened(study.set)).cost_s
    size = f"the study has {n:,} runs, about {total_s / 3600:,.0f} hours of one core"
    if n > MOST_RUNS:
        raise ConfigError(f"{size}: it must have at most {MOST_RUNS:,}; take fewer values, samples or repeats")
    if total_s > LONG_S:
        warnings.warn(size, stacklevel=3)

"""The design of a sweep: which values each run has, for every combination or for samples of the ranges."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod
from typing import Any

import numpy as np

from annelid.config import (
    RunConfig,
    Study,
    Vary,
    field_paths,
    field_value,
    fields_of,
    load_config,
    toml_value,
    whole_path,
)
from annelid.config.study import MOST_RUNS
from annelid.errors import ConfigError, suggest
from annelid.experiment.case import Case
from annelid.experiment.space import Choice, Variable, from_unit, interval, sampled, unit_samples

SAMPLE, REPEAT = "sample", "repeat"
"""Dimensions beside those of the varied fields."""
LONG_S = 100 * 3600.0
"""Studies that take longer on one core are told of, s."""


@dataclass(frozen=True)
class Point:
    """One run of a sweep.

    Attributes:
        place: Its index along each dimension of the design.
        values: Values of the varied fields, by dotted path.
        case: The run.
    """

    place: tuple[int, ...]
    values: Mapping[str, Any]
    case: Case


@dataclass(frozen=True)
class Plan:
    """All runs of a sweep.

    Attributes:
        study: What the user wrote.
        base: The configuration that the fields are varied of.
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
    def points(self) -> tuple[Point, ...]:
        """The runs, the last dimension counting fastest."""
        fixed = flattened(self.study.set)
        repeats = self.levels.get(REPEAT)
        found = []
        for row, values in enumerate(dict(zip(self.fields, sample, strict=True)) for sample in self.samples):
            for repeat, seed in enumerate([None] if repeats is None else repeats):
                changes = {**fixed, **values} | ({} if seed is None else {"seed": seed})
                place = np.unravel_index(row * (1 if repeats is None else len(repeats)) + repeat, self.shape)
                found.append(Point(tuple(int(i) for i in place), values, Case(self.study.preset, changes)))
        return tuple(found)


def plan_of(study: Study) -> Plan:
    """Lays out the runs of a study.

    Raises:
        ConfigError: The preset, a fixed field or a varied field is refused, or there are too many runs.
        MissingDependency: SciPy is needed for the samples and not installed.
    """
    base = load_config(study.preset, flattened(study.set))
    variables = [_variable(vary, base) for vary in study.vary]
    fields = tuple(variable.field for variable in variables)
    for field in fields:
        if fields.count(field) > 1:
            raise ConfigError(f"vary {field!r} stands twice: give all of its values once")
    if "seed" in fields and study.repeats > 1:
        raise ConfigError(f"vary 'seed' and repeats = {study.repeats} both set the seed: leave one out")
    levels: dict[str, Sequence[Any]]
    _check_size(n_runs(study), Case(study.preset, flattened(study.set)).cost_s)
    if study.design == "grid":
        levels = {
            variable.field: _levels(variable, vary.number) for variable, vary in zip(variables, study.vary, strict=True)
        }
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
        if isinstance(value, Mapping):
            fields |= flattened(value, f"{prefix}{name}.")
        else:
            fields[f"{prefix}{name}"] = value
    return fields


def _variable(vary: Vary, base: RunConfig) -> Variable:
    field = whole_path(vary.field, base.model_dump())
    # A field of another kind than the preset's counts: the kind may be varied, too.
    if field not in field_paths():
        raise ConfigError(f"vary: unknown field {vary.field!r}: {suggest(field, fields_of(base))}")
    present = field_value(base, field) if field in fields_of(base) else None
    if vary.choices is not None:
        return Choice(field, vary.choices)
    if vary.values is not None:
        numbers = [int(value) if isinstance(present, int) and value.is_integer() else value for value in vary.values]
        return Choice(field, tuple(numbers))
    assert vary.from_ is not None
    assert vary.to is not None
    return interval(field, vary.from_, vary.to, present, logarithmic=vary.log)


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


def n_runs(study: Study) -> int:
    """Counts the runs of a study without making them."""
    if study.design != "grid":
        return (study.samples or 0) * study.repeats
    return prod(vary.number or len(vary.values or vary.choices or ()) for vary in study.vary) * study.repeats


def _check_size(n: int, cost_s: float) -> None:
    """Refuses too many runs, and tells of such as take days; ``cost_s`` is that of one run on one core, s."""
    size = f"the study has {n:,} runs, about {n * cost_s / 3600:,.0f} hours of one core"
    if n > MOST_RUNS:
        raise ConfigError(f"{size}: it must have at most {MOST_RUNS:,}; take fewer values, samples or repeats")
    if n * cost_s > LONG_S:
        warnings.warn(size, stacklevel=3)


def label(value: Any) -> str:
    """Writes a value of a field for an axis or a table."""
    return value if isinstance(value, str) else toml_value(value)

"""The design of a sweep: which values each run has, for every combination or for samples of the ranges.

Samples depend on the study's seed alone. Those of a random or a Sobol design begin alike however many are drawn, so
that more of them leave the earlier runs as they are; those of a Latin hypercube do not.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
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
from annelid.errors import ConfigError, MissingDependency, suggest
from annelid.experiment.case import Case
from annelid.experiment.space import Choice, Interval, Variable, from_unit, is_whole
from annelid.morphology import Array

SAMPLE, REPEAT = "sample", "repeat"
"""Dimensions beside those of the varied fields."""
LONG_S = 100 * 3600.0
"""Studies that take longer on one core are told of, s."""
MISSING = "samples of a sweep need SciPy: install it with  pip install 'annelid[sweep]'"


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
        samples = [_sample(variables, shares) for shares in unit_samples(study, len(variables))]
        levels = {SAMPLE: range(len(samples))}
    if study.repeats > 1:
        levels[REPEAT] = range(base.seed, base.seed + study.repeats)
    return Plan(study, base, fields, samples, levels)


def unit_samples(study: Study, n_fields: int) -> Array:
    """Draws a study's samples.

    Returns:
        Each field's place in its range, in [0, 1), ``(n_samples, n_fields)``.
    """
    n = study.samples or 0
    if study.design == "random":
        return np.random.default_rng(study.seed).random((n, n_fields))
    try:
        from scipy.stats import qmc
    except ImportError:
        raise MissingDependency(MISSING) from None
    rng = np.random.default_rng(study.seed)
    if study.design == "lhs":
        return qmc.LatinHypercube(n_fields, rng=rng).random(n)
    with warnings.catch_warnings():
        # That any number but a power of two is less even: the user may add samples later.
        warnings.simplefilter("ignore", UserWarning)
        return np.minimum(qmc.Sobol(n_fields, rng=rng).random(n), np.nextafter(1.0, 0.0))


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
    low, high = _end(vary.from_), _end(vary.to)
    whole = is_whole(field, present)
    if whole and not (low.is_integer() and high.is_integer()):
        raise ConfigError(f"vary {field!r}: from = {low:g}, to = {high:g}: must be whole numbers, as the field is")
    return Interval(field, low, high, vary.log, whole)


def _end(value: float | None) -> float:
    assert value is not None, "a range has both ends"
    return value


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


def _sample(variables: Sequence[Variable], shares: Array) -> tuple[Any, ...]:
    return tuple(_values(variables, shares.tolist()))


def _values(variables: Sequence[Variable], shares: Sequence[float]) -> Iterator[Any]:
    for variable, share in zip(variables, shares, strict=True):
        if isinstance(variable, Choice):
            yield variable.values[int(share * len(variable.values))]
        elif variable.whole:
            # Each whole number has the same share of the range, the ends too.
            yield variable.rounded(np.floor(variable.low + share * (variable.high - variable.low + 1.0)))
        else:
            yield from_unit(variable, share)


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

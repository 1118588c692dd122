"""What a study varies: fields of a configuration in ranges or among choices, and samples of them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, floor, log
from typing import Any, TypeVar

import numpy as np

from annelid.config import RunConfig, Vary, field_paths, field_value, fields_of, toml_value, whole_path
from annelid.config.study import Design
from annelid.errors import ConfigError, suggest
from annelid.experiment.case import SHEAR_OVER_YOUNG
from annelid.morphology import Array

DIGITS = 4
"""Significant digits of a value, so that a file that states it makes the same run."""

YOUNG, SHEAR = "body.strands.young_modulus_Pa", "body.strands.shear_modulus_Pa"


@dataclass(frozen=True, slots=True)
class Interval:
    """A number in a range, the field by its dotted path."""

    field: str
    low: float
    high: float
    logarithmic: bool = False
    """Whether equal ratios count alike, rather than equal differences."""
    whole: bool = False

    def __contains__(self, value: Any) -> bool:
        return isinstance(value, int | float) and self.low <= value <= self.high

    def rounded(self, value: float) -> float | int:
        """Rounds a value to `DIGITS` digits, or to a whole number, and keeps it in the range."""
        if self.whole:
            return min(max(round(value), int(self.low)), int(self.high))
        return min(max(float(f"{value:.{DIGITS}g}"), self.low), self.high)


@dataclass(frozen=True, slots=True)
class Choice:
    """One of several values: numbers, words, or lists of these."""

    field: str
    values: tuple[Any, ...]

    def __contains__(self, value: Any) -> bool:
        return value in self.values


Variable = Interval | Choice
T = TypeVar("T")


def variables_of(varied: Sequence[Vary], base: RunConfig) -> list[Variable]:
    """Returns what is varied of a configuration: ranges of whole numbers where its own value is whole."""
    variables = [_variable(vary, base) for vary in varied]
    fields = [variable.field for variable in variables]
    for field in fields:
        if fields.count(field) > 1:
            raise ConfigError(f"vary {field!r} stands twice: give all of its values once")
    following = {whole_path(path, base.model_dump()) for vary in varied for path in vary.follow}
    for field in following.intersection(fields):
        raise ConfigError(f"vary {field!r} is varied and follows another field: leave out one of both")
    if YOUNG in fields and SHEAR in fields_of(base) and SHEAR not in following.union(fields):
        warnings.warn(
            f"vary {YOUNG!r} leaves {SHEAR} = {toml_value(field_value(base, SHEAR))}, while both moduli of a material "
            f'change together: vary both, or in a study write  follow = {{ "{SHEAR}" = {SHEAR_OVER_YOUNG:.4g} }}',
            stacklevel=2,
        )
    return variables


def _variable(vary: Vary, base: RunConfig) -> Variable:
    field = whole_path(vary.field, base.model_dump())
    # A field of another kind than the configuration's counts: the kind may be varied, too. So does an entry of a table.
    if field not in field_paths() and not any(field.startswith(f"{path}.") for path in fields_of(base)):
        raise ConfigError(f"vary: unknown field {vary.field!r}: {suggest(field, fields_of(base))}")
    present = field_value(base, field) if field in fields_of(base) else None
    whole = isinstance(present, int) and not isinstance(present, bool)
    if vary.choices is not None:
        return Choice(field, vary.choices)
    if vary.values is not None:
        return Choice(field, tuple(int(value) if whole and value.is_integer() else value for value in vary.values))
    low, high = vary.from_, vary.to
    assert low is not None
    assert high is not None
    if isinstance(present, bool | str | tuple):
        raise ConfigError(f"{field} is {toml_value(present)}, which is no number with a range")
    if whole and not (low.is_integer() and high.is_integer()):
        raise ConfigError(f"{field} from {low:g} to {high:g}: both ends must be whole numbers, as the field is")
    return Interval(field, low, high, vary.log, whole)


def from_unit(variable: Interval, share: float) -> float | int:
    """Returns the value at a place of its range, 0 at the lower end and 1 at the upper one, rounded as the variable."""
    if variable.logarithmic:
        return variable.rounded(variable.low * exp(share * log(variable.high / variable.low)))
    return variable.rounded(variable.low + share * (variable.high - variable.low))


def sampled(variable: Variable, share: float) -> Any:
    """Returns the value of a sample from its place in [0, 1): all choices and all whole numbers alike often."""
    if isinstance(variable, Choice):
        return variable.values[int(share * len(variable.values))]
    if variable.whole:
        return variable.rounded(floor(variable.low + share * (variable.high - variable.low + 1.0)))
    return from_unit(variable, share)


def unit_samples(design: Design, n: int, n_variables: int, seed: int) -> Array:
    """Draws samples of the unit cube, ``(n, n_variables)``, that depend on the seed alone.

    Those of a random or a Sobol design begin alike however many are drawn, so that more of them leave the earlier runs
    as they are; those of a Latin hypercube do not.
    """
    rng = np.random.default_rng(seed)
    if design == "random":
        return rng.random((n, n_variables))
    from scipy.stats import qmc

    engine = qmc.LatinHypercube(n_variables, rng=rng) if design == "lhs" else qmc.Sobol(n_variables, rng=rng)
    with warnings.catch_warnings():
        # That any number but a power of two is less even: the user may add samples later.
        warnings.simplefilter("ignore", UserWarning)
        return np.minimum(engine.random(n), np.nextafter(1.0, 0.0))


def spread_evenly(n: int, items: Sequence[T]) -> list[T]:
    """Returns n of a sequence's items, evenly picked from the first to the last of them; all where there are fewer."""
    places = np.linspace(0, len(items) - 1, min(n, len(items)))
    return [items[round(place)] for place in places.tolist()]

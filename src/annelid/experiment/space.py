"""What may be varied: a field of a configuration in a range, or among choices."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log
from typing import Any

from annelid.config import toml_value
from annelid.errors import ConfigError

DIGITS = 4
"""Significant digits of a value, so that a file that states it makes the same run."""


@dataclass(frozen=True, slots=True)
class Interval:
    """A number in a range.

    Attributes:
        field: Dotted path of the field.
        low: Least value.
        high: Largest value.
        logarithmic: Whether equal ratios count alike, rather than equal differences.
        whole: Whether it is a whole number.
    """

    field: str
    low: float
    high: float
    logarithmic: bool = False
    whole: bool = False

    def __contains__(self, value: Any) -> bool:
        """Whether a value lies in the range."""
        return isinstance(value, int | float) and self.low <= value <= self.high

    def rounded(self, value: float) -> float | int:
        """Rounds a value to `DIGITS` digits, or to a whole number, and keeps it in the range."""
        if self.whole:
            return min(max(round(value), int(self.low)), int(self.high))
        return min(max(float(f"{value:.{DIGITS}g}"), self.low), self.high)


@dataclass(frozen=True, slots=True)
class Choice:
    """One of several values.

    Attributes:
        field: Dotted path of the field.
        values: The values: numbers, words, or lists of these.
    """

    field: str
    values: tuple[Any, ...]

    def __contains__(self, value: Any) -> bool:
        """Whether a value is one of them."""
        return value in self.values


Variable = Interval | Choice


def to_unit(variable: Interval, value: float) -> float:
    """Returns where a value lies in its range: 0 at the lower end, 1 at the upper one."""
    if variable.logarithmic:
        return log(value / variable.low) / log(variable.high / variable.low)
    return (value - variable.low) / (variable.high - variable.low)


def from_unit(variable: Interval, share: float) -> float | int:
    """Returns the value at a place of its range, rounded as the variable is; the inverse of `to_unit` but for that."""
    if variable.logarithmic:
        return variable.rounded(variable.low * exp(share * log(variable.high / variable.low)))
    return variable.rounded(variable.low + share * (variable.high - variable.low))


def is_whole(field: str, present: Any) -> bool:
    """Whether a range of a field is one of whole numbers, as its present value is.

    Raises:
        ConfigError: It is no number at all.
    """
    if isinstance(present, bool | str | tuple):
        raise ConfigError(f"{field} is {toml_value(present)}, which is no number with a range")
    return isinstance(present, int)

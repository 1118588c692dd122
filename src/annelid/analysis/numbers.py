"""How a number of a run is declared: once, with its meaning, how a table prints it, and whether a sweep may output it.

A section of the record (`annelid.analysis.summary.Summary`) is a dataclass whose fields are declared by `number`. The
unit of a number ends its name. Tables, sweeps, `annelid list numbers` and the pages read these declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.config import unit_of

_SHOWN = {"%": (100.0, 1), "cm": (100.0, 2), "cm/s": (100.0, 2), "mm": (1000.0, 1), "N": (1.0, 2), "J": (1.0, 2)}
"""What tables multiply a number by to show it in a unit, and digits behind the point; elsewhere 1 and 3."""
UNKNOWN = "-"
"""Printed where a run does not have a number."""

Value = float | Sequence[float | None] | None
"""One number, one for each segment, or None for what a run does not have."""


@dataclass(frozen=True, slots=True)
class Number:
    """A number of a run, or one for each segment.

    Attributes:
        name: Its name everywhere, which ends with its unit.
        section: Class of the record's section that has it.
        meaning: What it is, in a line.
        label: What a table calls it; empty where no table shows it.
        shown_unit: Unit in a table.
        digits: Digits behind the point in a table.
        per_segment: Whether there is one for each segment.
        in_sweeps: Whether a sweep may output it.
    """

    name: str
    section: type
    meaning: str
    label: str
    shown_unit: str
    digits: int
    per_segment: bool
    in_sweeps: bool

    @property
    def unit(self) -> str:
        """Unit that ends its name; "1" for a share or a count."""
        return unit_of(self.name) or "1"

    @property
    def factor(self) -> float:
        """What a table multiplies it by."""
        return _SHOWN.get(self.shown_unit, (1.0, 3))[0]

    def text(self, value: Value) -> str:
        """Writes a value of it, or one for each segment, as tables do; a dash for None."""
        if value is None:
            return UNKNOWN
        if isinstance(value, Sequence):
            digits = " / ".join(UNKNOWN if one is None else self._digits(one) for one in value)
        else:
            digits = self._digits(value)
        return f"{digits} {self.shown_unit}".rstrip()

    def _digits(self, value: float) -> str:
        return f"{self.factor * value:z.{self.digits}f}"


def number(
    meaning: str,
    label: str = "",
    unit: str = "",
    *,
    digits: int | None = None,
    per_segment: bool = False,
    in_sweeps: bool = True,
    default: Any = None,
    factory: Callable[[], Any] | None = None,
) -> Any:
    """Declares a field of a section, as `dataclasses.field` does.

    Args:
        meaning: What it is, in a line.
        label: What a table calls it; empty where no table shows it.
        unit: Unit in a table.
        digits: Digits behind the point in a table; None for those of the unit.
        per_segment: Whether there is one for each segment.
        in_sweeps: Whether a sweep may output it.
        default: Value where it is not known.
        factory: Makes that value, where it is a list.
    """
    digits = _SHOWN.get(unit, (1.0, 3))[1] if digits is None else digits
    metadata = {"number": (meaning, label, unit, digits, per_segment, in_sweeps)}
    if factory is not None:
        return field(default_factory=factory, metadata=metadata)
    return field(default=default, metadata=metadata)


def numbers_of(section: type) -> dict[str, Number]:
    """Returns what a section itself declares, by name."""
    own = [each for each in fields(section) if each.name in section.__annotations__]
    return {each.name: Number(each.name, section, *each.metadata["number"]) for each in own}


def finite(value: float | None) -> float | None:
    """Returns a number as Python's, None for one that is not finite."""
    return None if value is None or not isfinite(value) else float(value)


def finite_each(values: ArrayLike | None) -> list[float | None] | None:
    """Returns numbers as Python's, None for each that is not finite."""
    return None if values is None else [finite(value) for value in np.asarray(values, dtype=float)]


def ratio(of: float | None, to: float | None) -> float | None:
    """Divides two numbers; None where either is not known, or the quotient is not finite."""
    return None if of is None or not to else finite(of / to)

"""How a number of a run is declared: once, with its meaning, how a table prints it, and whether a sweep may output it.

A section of the record (`annelid.analysis.summary.Summary`) is a dataclass whose fields are declared by `number`. The
unit of a number ends its name. Tables, sweeps, `annelid list numbers` and the pages read these declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from math import floor, isfinite, log10
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.config import unit_of

_FACTORS = {"%": 100.0, "cm": 100.0, "cm/s": 100.0, "mm": 1000.0}
"""What tables multiply a number by to show it in a unit; elsewhere 1."""
_LISTED = 4
"""Up to as many values, one for each segment, are listed in a table; more are shown by their range and mean."""
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
        per_segment: Whether there is one for each segment.
        in_sweeps: Whether a sweep may output it.
    """

    name: str
    section: type
    meaning: str
    label: str
    shown_unit: str
    per_segment: bool
    in_sweeps: bool

    @property
    def unit(self) -> str:
        """Unit that ends its name; "1" for a share or a count."""
        return unit_of(self.name) or "1"

    @property
    def factor(self) -> float:
        """What a table multiplies it by."""
        return _FACTORS.get(self.shown_unit, 1.0)

    @property
    def heading(self) -> str:
        """What a table calls it, with its unit."""
        return f"{self.label} ({self.shown_unit})" if self.shown_unit else self.label

    def text(self, value: Value) -> str:
        """Writes a value of it in the unit of its heading, or a short list of one for each segment; a dash for None."""
        if not isinstance(value, Sequence):
            return UNKNOWN if value is None else three_digits(self.factor * value)
        known = [one for one in value if one is not None]
        if len(value) <= _LISTED or not known:
            return " ".join(map(self.text, value)) if known else UNKNOWN
        least, most, mean = map(self.text, (min(known), max(known), sum(known) / len(known)))
        return f"{least} to {most}, mean {mean}"


def number(
    meaning: str,
    label: str = "",
    unit: str = "",
    *,
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
        per_segment: Whether there is one for each segment.
        in_sweeps: Whether a sweep may output it.
        default: Value where it is not known.
        factory: Makes that value, where it is a list.
    """
    metadata = {"number": (meaning, label, unit, per_segment, in_sweeps)}
    if factory is not None:
        return field(default_factory=factory, metadata=metadata)
    return field(default=default, metadata=metadata)


def numbers_of(section: type) -> dict[str, Number]:
    """Returns what a section itself declares, by name."""
    own = [each for each in fields(section) if each.name in section.__annotations__]
    return {each.name: Number(each.name, section, *each.metadata["number"]) for each in own}


def three_digits(value: float) -> str:
    """Writes a number with three significant digits; a whole one as it is, one far from 1 in powers of ten."""
    if not isfinite(value) or (value == round(value) and abs(value) < 1e6):
        return f"{value:z.0f}"
    rounded = float(f"{value:.2e}")
    digits = 2 - floor(log10(abs(rounded)))
    return f"{rounded:.{max(digits, 0)}f}" if -4 < digits < 7 else f"{rounded:.3g}"


def finite(value: float | None) -> float | None:
    """Returns a number as Python's, None for one that is not finite."""
    return None if value is None or not isfinite(value) else float(value)


def finite_each(values: ArrayLike | None) -> list[float | None] | None:
    """Returns numbers as Python's, None for each that is not finite."""
    return None if values is None else [finite(value) for value in np.asarray(values, dtype=float)]


def ratio(of: float | None, to: float | None) -> float | None:
    """Divides two numbers; None where either is not known, or the quotient is not finite."""
    return None if of is None or not to else finite(of / to)

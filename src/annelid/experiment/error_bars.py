"""The numbers of a run that get error bars, and how those follow from the readings of the run and its variants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor, log2, log10, sqrt
from statistics import stdev

from annelid.analysis import Summary
from annelid.config import unit_of

NOT_CONVERGED = 0.5
"""Numerical error, of the value, above which a quantity does not count as converged."""
UNKNOWN = "-"
SHOWN: Mapping[str, tuple[str, str, float, int]] = {
    "period_s": ("period", "s", 1.0, 3),
    "elongation_mean_max_m": ("elongation {}, mean", "cm", 100.0, 2),
    "elongation_first_helix_pp_m": ("first helix {}, pp", "cm", 100.0, 2),
    "middle_deficit_mean": ("middle deficit, mean", "%", 100.0, 1),
    "middle_deficit": ("middle deficit, pp", "%", 100.0, 1),
    "contraction_force_median_N": ("force, median", "N", 1.0, 2),
    "travel_m": ("travel forwards", "mm", 1000.0, 1),
    "speed_m_per_s": ("speed", "mm/s", 1000.0, 2),
}
"""What gets error bars: its label, with the segment where it is one per segment, the unit in which it is shown, what
the value is multiplied by for that, and digits behind the point where no error says how many."""


def readings(numbers: Summary) -> dict[str, float | None]:
    """Returns what gets error bars in SI units by field, with the segment behind a point; speed is travel over time."""
    travel, duration = numbers.travel_m, numbers.duration_s
    found: dict[str, float | None] = {}
    for field, (label, *_) in SHOWN.items():
        if field == "speed_m_per_s":
            found[field] = travel / duration if travel is not None and duration else None
        elif "{}" in label:
            lengths = getattr(numbers, field) or [None] * numbers.n_segments
            found |= {f"{field}.{segment}": value for segment, value in enumerate(lengths, start=1)}
        else:
            found[field] = getattr(numbers, field)
    return found


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a run with its error bars, all in its ``unit``; None for what is not known.

    Attributes:
        name: Field of the summary, with the segment behind a point where it is one per segment.
        value: The number.
        parameters: Sample standard deviation over the Monte Carlo samples.
        time_step: Largest difference between the run and one of finer steps.
        discretization: Largest difference between the run and one of more elements.
        order: Order in which the value converges with the step, from two halvings; None unless both change it in the
            same direction.
        n_drawn: Number of Monte Carlo samples that it was read in.
    """

    name: str
    value: float | None
    parameters: float | None
    time_step: float | None
    discretization: float | None
    order: float | None
    n_drawn: int

    @property
    def unit(self) -> str:
        """Unit of the value and its errors; "1" for a share."""
        return unit_of(self.name.partition(".")[0]) or "1"

    @property
    def label(self) -> str:
        """What it is called."""
        field, _, segment = self.name.partition(".")
        return SHOWN[field][0].format(segment)

    @property
    def errors(self) -> dict[str, float | None]:
        """The three errors by their kinds."""
        return {"parameters": self.parameters, "time step": self.time_step, "elements": self.discretization}

    @property
    def total(self) -> float | None:
        """Root of the sum of the squares of those errors that are known; None if none is."""
        known = [error for error in self.errors.values() if error is not None]
        return sqrt(sum(error**2 for error in known)) if known else None

    @property
    def converged(self) -> bool | None:
        """Whether neither numerical error exceeds half of the value; None as long as one of them is not known."""
        if self._faults:
            return False
        return None if None in (self.value, self.time_step, self.discretization) else True

    @property
    def note(self) -> str:
        """What is wrong with it, in words; empty where nothing is."""
        if self.value is None:
            return "not known from this run"
        unknown = [kind for kind, error in self.errors.items() if error is None]
        words = [f"not converged: {' and '.join(self._faults)}"] if self._faults else []
        words += [f"without {' and '.join(unknown)}"] if unknown else []
        return "; ".join(words)

    @property
    def _faults(self) -> list[str]:
        limit = None if self.value is None else NOT_CONVERGED * abs(self.value)
        numerical = {"time step": self.time_step, "elements": self.discretization}
        return [kind for kind, error in numerical.items() if limit is not None and error is not None and error > limit]

    def shown(self, value: float | None) -> float | None:
        """Returns a value of it in the unit in which it is shown."""
        return None if value is None else self._format[1] * value

    def error_text(self, error: float | None) -> str:
        """Writes one of its errors with the digits that show two of the total."""
        return UNKNOWN if error is None else f"{self.shown(error):.{self._digits}f}"

    def __str__(self) -> str:
        """Its value with its total error, to two digits of the error: ``6.15 +- 0.21 cm``."""
        if self.value is None:
            return UNKNOWN
        error = "" if self.total is None else f" +- {self.error_text(self.total)}"
        return f"{self.shown(self.value):z.{self._digits}f}{error} {self._format[0]}"

    @property
    def _format(self) -> tuple[str, float, int]:
        return SHOWN[self.name.partition(".")[0]][1:]

    @property
    def _digits(self) -> int:
        _, factor, digits = self._format
        return min(max(1 - floor(log10(factor * self.total)), 0), digits + 1) if self.total else digits


def scatter(values: Sequence[float | None]) -> float | None:
    """Sample standard deviation of the values that are known; None for fewer than two."""
    known = [value for value in values if value is not None]
    return stdev(known) if len(known) > 1 else None


def largest_difference(value: float | None, finer: Sequence[float | None]) -> float | None:
    """Largest distance of a value from those of finer runs; None if it or all of them are unknown."""
    differences = [abs(value - other) for other in finer if value is not None and other is not None]
    return max(differences, default=None)


def order_of_convergence(value: float | None, half: float | None, quarter: float | None) -> float | None:
    """Order p of an error that goes as ``step**p``, from values at a step, its half and its quarter.

    None where one is unknown, or the halvings do not change the value in the same direction.
    """
    if value is None or half is None or quarter is None or (value - half) * (half - quarter) <= 0.0:
        return None
    return log2((value - half) / (half - quarter))

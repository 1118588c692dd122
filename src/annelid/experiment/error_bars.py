"""The numbers of a run that get error bars, and how those follow from the readings of the run and its variants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, log2, log10, sqrt
from statistics import stdev

from annelid.analysis import Summary

NOT_CONVERGED = 0.5
"""Numerical error, of the value, above which a quantity does not count as converged."""
UNKNOWN = "-"


@dataclass(frozen=True, slots=True)
class Reading:
    """One number of a run.

    Attributes:
        name: Field of the summary, with the segment behind a point where it is one per segment.
        label: What it is called.
        unit: Unit of the value.
        value: In SI units; None where it is not known.
        shown_unit: Unit in which it is shown.
        factor: What the value is multiplied by for that.
        digits: Digits behind the point where there is no error that says how many.
    """

    name: str
    label: str
    unit: str
    value: float | None
    shown_unit: str
    factor: float
    digits: int


def readings(numbers: Summary) -> list[Reading]:
    """Picks from a summary what gets error bars.

    Elongations stand in both readings (`annelid.analysis.elongation`), "mean" and "pp"; speed is travel over duration.
    """
    found = [Reading("period_s", "period", "s", numbers.period_s, "s", 1.0, 3)]
    for field, label in (
        ("elongation_mean_max_m", "elongation {}, mean"),
        ("elongation_first_helix_pp_m", "first helix {}, pp"),
    ):
        lengths: list[float | None] = getattr(numbers, field) or [None] * numbers.n_segments
        found += [
            Reading(f"{field}.{segment}", label.format(segment), "m", value, "cm", 100.0, 2)
            for segment, value in enumerate(lengths, start=1)
        ]
    travel, duration = numbers.travel_m, numbers.duration_s
    speed = travel / duration if travel is not None and duration else None
    return [
        *found,
        Reading("middle_deficit_mean", "middle deficit, mean", "1", numbers.middle_deficit_mean, "%", 100.0, 1),
        Reading("middle_deficit", "middle deficit, pp", "1", numbers.middle_deficit, "%", 100.0, 1),
        Reading("contraction_force_median_N", "force, median", "N", numbers.contraction_force_median_N, "N", 1.0, 2),
        Reading("travel_m", "travel forwards", "m", travel, "mm", 1000.0, 1),
        Reading("speed_m_per_s", "speed", "m/s", speed, "mm/s", 1000.0, 2),
    ]


@dataclass(frozen=True, slots=True)
class Quantity(Reading):
    """A number of the run itself with its error bars, all in ``unit``; None for what is not known.

    Attributes:
        parameters: Sample standard deviation over the Monte Carlo samples.
        time_step: Largest difference between the run and one of finer steps.
        discretization: Largest difference between the run and one of more elements.
        order: Order in which the value converges with the step, from two halvings; None unless both change it in the
            same direction.
        n_drawn: Number of Monte Carlo samples that it was read in.
    """

    parameters: float | None
    time_step: float | None
    discretization: float | None
    order: float | None
    n_drawn: int

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
        return None if value is None else self.factor * value

    def error_text(self, error: float | None) -> str:
        """Writes one of its errors with the digits that show two of the total."""
        return UNKNOWN if error is None else f"{self.factor * error:.{self._shown_digits}f}"

    def __str__(self) -> str:
        """Its value with its total error, to two digits of the error: ``6.15 +- 0.21 cm``."""
        if self.value is None:
            return UNKNOWN
        error = "" if self.total is None else f" +- {self.error_text(self.total)}"
        return f"{self.factor * self.value:z.{self._shown_digits}f}{error} {self.shown_unit}"

    @property
    def _shown_digits(self) -> int:
        total = self.total
        return min(max(1 - floor(log10(self.factor * total)), 0), self.digits + 1) if total else self.digits


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

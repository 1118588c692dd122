"""What a gait is worth: its speed, its cost of transport and its slip, or what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from annelid.analysis.gait import Gait
from annelid.errors import ConfigError, suggest
from annelid.experiment.outcome import Outcome

LEAST_CYCLES = 2


@dataclass(frozen=True, slots=True)
class Objective:
    """A number that a gait is tuned for: the name that a user gives, a label with its unit, and its name in `Gait`."""

    name: str
    label: str
    number: str
    more_is_better: bool
    penalty: float
    """What counts for a run that does not walk."""


OBJECTIVES: Mapping[str, Objective] = {
    one.name: one
    for one in (
        Objective("speed", "speed (m/s)", "speed_m_per_s", True, 0.0),
        Objective("cost-of-transport", "cost of transport", "cost_of_transport", False, 100.0),
        Objective("slip", "slip ratio", "slip_ratio", False, 10.0),
    )
}
"""The objectives. The cost of transport counts positive work, none of it regained. The penalties are worse than any
gait that advances: no speed, and a cost and a slip beyond reach."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What was found of one run."""

    gait: Gait | None
    """Its numbers; None where it was stopped or could not be computed."""
    problem: str
    """Why it does not count as a gait; empty if it does."""

    def value(self, objective: Objective) -> float:
        """Returns the value of an objective, its penalty for a run that does not walk."""
        value = None if self.gait is None or self.problem else getattr(self.gait, objective.number)
        return objective.penalty if value is None or not isfinite(value) else value

    def score(self, objective: Objective) -> float:
        """Returns the value of an objective, signed so that less is better."""
        return -self.value(objective) if objective.more_is_better else self.value(objective)


def objectives_of(names: list[str]) -> list[Objective]:
    """Returns one or two objectives by name."""
    for name in names:
        if name not in OBJECTIVES:
            raise ConfigError(f"unknown objective {name!r}: {suggest(name, OBJECTIVES)}")
    if not 1 <= len(set(names)) == len(names) <= 2:
        raise ConfigError(f"objectives must be one or two of {', '.join(OBJECTIVES)}, not {', '.join(names)}")
    return [OBJECTIVES[name] for name in names]


def judge(outcome: Outcome) -> Judged:
    """Judges a run: it must have ended whole, in order, over at least two cycles, and advance.

    In order are neighbours that take turns with steady periods and lags; onsets need not be evenly spaced.
    """
    return Judged(None if outcome.message else outcome.gait, _problem(outcome))


def _problem(outcome: Outcome) -> str:
    rhythm, gait = outcome.rhythm, outcome.gait
    if outcome.message:
        return f"stopped: {outcome.message}"
    if rhythm.verdict == "silent":
        return f"silent: {rhythm.reason}"
    if not rhythm.is_regular:
        return f"out of order: {rhythm.reason}"
    if gait.cycles < LEAST_CYCLES:
        return f"fewer than {LEAST_CYCLES} complete cycles"
    if gait.speed_m_per_s is None or not gait.speed_m_per_s > 0.0:
        return "does not advance"
    return ""

"""What counts as a gait: a run that goes on in order over complete cycles, and advances."""

from __future__ import annotations

from dataclasses import dataclass

from annelid.analysis.gait import Gait
from annelid.experiment.outcome import Outcome

LEAST_WORK_J = 0.01
"""Muscles that do less work leave the worm where it lies, and a share of their work says nothing."""
LEAST_CYCLES = 2
"""Complete cycles that a gait must have."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What was found of one run.

    Attributes:
        gait: Its numbers; None where it was stopped or could not be computed.
        problem: Why it does not count as a gait; empty if it does.
    """

    gait: Gait | None
    problem: str


def judge(outcome: Outcome, numerics: float | None = None) -> Judged:
    """Judges a run: it must have ended whole, in order, over at least two cycles, and advance.

    In order are neighbours that take turns with steady periods and lags; onsets need not be evenly spaced.

    Args:
        outcome: Of the run.
        numerics: Largest share of the muscles' work that the integrator may take or add; None for any.
    """
    problem = _problem(outcome)
    if not problem and numerics is not None:
        problem = numerical_problem(outcome, numerics)
    return Judged(None if outcome.message else outcome.summary, problem)


def numerical_problem(outcome: Outcome, largest_share: float) -> str:
    """Says if the integrator took or added more of the muscles' work than it may; nothing if it did not.

    Args:
        outcome: Of the run.
        largest_share: How much of that work it may take or add; below 1.
    """
    work_J, share = outcome.summary.energy_muscle_work_J, outcome.summary.energy_numerical_share
    if work_J is None or share is None or work_J < LEAST_WORK_J or abs(share) <= largest_share:
        return ""
    return f"the integrator {'took' if share > 0 else 'added'} {abs(share):.0%} of the muscles' work"


def _problem(outcome: Outcome) -> str:
    rhythm, gait = outcome.rhythm, outcome.summary
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

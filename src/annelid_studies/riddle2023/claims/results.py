"""Claims about results: order, period, elongations and cost."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import nan

import numpy as np

from annelid.analysis import (
    PAPER_ELONGATION_M,
    PAPER_END_DIFFERENCE,
    PAPER_MIDDLE_DEFICIT,
    end_difference,
    middle_deficit,
)
from annelid.experiment import Case
from annelid.morphology import Array
from annelid_studies.papers.judging import Judgement, judged, near
from annelid_studies.papers.words import capitalised, in_unit, span
from annelid_studies.riddle2023.claims.evidence import (
    JUDGES,
    PAPER_STEPS,
    PAPER_WALL_S,
    Evidence,
    judges,
    order_of,
    readings_m,
)
from annelid_studies.standard_cases import FAST


@judges
def order(evidence: Evidence) -> Judgement:
    """Every run is one wave 1-2-3."""
    first = evidence.runs[0][0]
    walks = [outcome.rhythm.is_one_wave for outcome, _ in evidence.runs]
    found = {"order": order_of(first), "walks": sum(walks), "runs": len(walks)}
    return judged(walks, "the run"), {**found, "reason": capitalised(first.rhythm.reason)}


@judges
def period(evidence: Evidence) -> Judgement:
    """Every run has the period of the paper's figure 7."""
    periods = [outcome.rhythm.period_s or nan for outcome, _ in evidence.runs]
    return near(periods, 2.6, "the run"), {"periods": periods}


def _judge_readings(evidence: Evidence, paper: float, unit: str, measure: Callable[[Array], float]) -> Judgement:
    """Judges a number by every reading of it, of each of the six springs and of their mean, in every run.

    Args:
        evidence: The runs.
        paper: The paper's number, m or a fraction.
        unit: What it is printed in, cm or %.
        measure: From the elongations by one reading, m, ``(n_segments,)``, to the number.
    """
    ours = np.array([[measure(of_reading) for of_reading in readings_m(run).T] for _, run in evidence.runs])
    digits = 2 if unit == "cm" else 1
    # Of the first run, and the range over all runs.
    *springs, mean = (in_unit(value, 100, digits) for value in ours[0])
    text = f"{', '.join(springs)} {unit} by the six springs, {mean} {unit} in the mean"
    if len(ours) > 1:
        text += f"; {span(ours.ravel(), 100, digits)} {unit} over all runs"
    return near(ours.ravel(), paper, "how the elongation is read"), {"readings": text}


for _i, _paper_m in enumerate(PAPER_ELONGATION_M):
    JUDGES[f"elongation_{_i + 1}"] = partial(
        _judge_readings, paper=_paper_m, unit="cm", measure=lambda elongations, i=_i: elongations[i]
    )
JUDGES["middle_deficit"] = partial(_judge_readings, paper=PAPER_MIDDLE_DEFICIT, unit="%", measure=middle_deficit)
JUDGES["end_difference"] = partial(_judge_readings, paper=PAPER_END_DIFFERENCE, unit="%", measure=end_difference)


@judges
def cost(evidence: Evidence) -> Judgement:
    """Never judged, by decision."""
    spent_s = evidence.runs[0][0].cpu_time_s
    return ("not testable here", ""), {
        "steps": PAPER_STEPS,
        "papers_ms": 1e3 * PAPER_WALL_S / PAPER_STEPS,
        "ms": 1e3 * spent_s / PAPER_STEPS,
        "spent_s": spent_s,
        "fast_s": evidence.store[Case(FAST)].cpu_time_s,
    }

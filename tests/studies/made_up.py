"""Outcomes that are made up, for what examinations and claims say of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from annelid.analysis import RhythmScore
from annelid.experiment.case import Case
from annelid.experiment.outcome import Hold, Outcome
from annelid.experiment.store import Store, case_key
from annelid_studies.papers.report_parts import Examination
from annelid_studies.standard_cases import Effort

WAVE = RhythmScore("ordered", "a wave", (1, 2, 3, 1, 2, 3), 2.63, 0.01, 1.0, 1, 1, 1.0, 4.2)
SILENT = replace(WAVE, verdict="silent", direction=0, wave_fronts=None, period_s=None, last_onset_s=0.7)


def synthetic(short: Outcome, case: Case, deficit: float, score: RhythmScore) -> Outcome:
    """An outcome whose segments elongate by 5, 5 (1 - deficit), 5 cm."""
    values = [0.05, 0.05 * (1.0 - deficit), 0.05]
    summary = replace(
        short.summary,
        elongation_first_helix_pp_m=values,
        elongation_mean_max_m=values,
        middle_deficit=deficit,
        travel_m=0.02,
        contraction_force_median_N=2.5,
    )
    opened = case.config.controller.kind == "program"
    holds = tuple(Hold(k, tuple(values), tuple(values), 0.35, 0.01, 2.0) for k in (1, 2, 3)) if opened else ()
    return Outcome(short.path, summary, score, holds, "")


class Made(Store):
    """A store whose outcomes are made up."""

    def __init__(self, outcomes: Mapping[str, Outcome]) -> None:
        super().__init__(Path("unused"))
        self.outcomes = outcomes

    def __getitem__(self, case: Case) -> Outcome:
        return self.outcomes[case_key(case)]


def results(examination: Examination, effort: Effort, make: Callable[[Case], Outcome]) -> Made:
    return Made({case_key(case): make(case) for case in examination.cases(effort)})

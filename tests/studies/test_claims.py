"""Claims are judged by one rule; what they rest on is read by names that must be there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import nan

import pytest
from made_up import WAVE, Made, results, synthetic

from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome, outcome
from annelid.experiment.store import case_key
from annelid.simulation.runfile import Run
from annelid_studies.papers.judging import judged, near
from annelid_studies.papers.report_parts import Examination, Findings
from annelid_studies.papers.words import filled, texts
from annelid_studies.riddle2023.claims import Evidence, judge
from annelid_studies.riddle2023.claims.evidence import CLAIMS_TOML, JUDGES
from annelid_studies.riddle2023.examinations import EXAMINATIONS
from annelid_studies.standard_cases import FAST, Effort

SIX_SPRINGS = (0.392, 0.302, 0.284, 0.334, 0.285, 0.322)
"""How far segment 2 stays below segment 1 by each of the springs; the paper says 39.4 %."""
READERS = ("pins", "elements", "velocity", "cause", "noise", "friction")
"""The claims that rest on numbers of examinations."""
READ = ("pins", "discretization", "timestep", "ranges", "noise", "friction")


class OneRun(Evidence):
    """Evidence of one run that stands for all."""

    def __init__(
        self, findings: Mapping[str, Findings], effort: Effort, made: Outcome, store: Made | None = None
    ) -> None:
        super().__init__(store or Made({}), effort, dict(findings))
        self.__dict__["runs"] = [(made, None)]


def test_a_number_is_judged_by_all_of_its_readings(subtests: pytest.Subtests) -> None:
    for ours, paper, expected in (
        ((2.5,), 2.5, ("holds", "")),
        ((2.51, 2.49), 2.5, ("holds", "")),
        ((2.6, 2.5), 2.5, ("holds within", "4.0 %")),
        ((2.5, 2.8), 2.5, ("rests on", "the spring")),
        ((2.8, 2.1), 2.5, ("does not hold", "")),
        ((2.5, nan), 2.5, ("rests on", "the spring")),
        ((nan,), 2.5, ("does not hold", "")),
        (SIX_SPRINGS, 0.394, ("rests on", "the spring")),
    ):
        with subtests.test(f"{ours!r:.60}"):
            assert near(ours, paper, "the spring") == expected


def test_a_property_holds_where_all_have_it() -> None:
    assert judged([True, True], "the run") == ("holds", "")
    assert judged([True, False], "the run") == ("rests on", "the run")
    assert judged([False, False], "the run") == ("does not hold", "")


def test_every_claim_is_decided_in_its_words_or_by_a_function() -> None:
    claims = texts(CLAIMS_TOML)["claims"]
    assert {name for name, words in claims.items() if "verdict" not in words} == JUDGES.keys()


def test_numbers_stand_in_words_in_their_unit() -> None:
    values = {"one": 0.0213, "many": [0.0213, 0.0391], "nothing": None}
    assert filled("{one:cm} {one:mm.0} {one:%}\n{many:cm.1}  {nothing:n} {one:.3f}", values) == (
        "2.13 21 2 2.1 to 3.9 – 0.021"
    )


def test_no_time_of_computing_enters_a_verdict(made: Outcome) -> None:
    for seconds in (0.0, 1.0, 1e5):
        timed = replace(made, cpu_time_s=seconds)
        fast = Made({case_key(Case(FAST)): timed})
        assert judge("cost", OneRun({}, "quick", timed, fast)).verdict == "not testable here"


def test_claims_find_their_numbers_and_miss_none_silently(made: Outcome) -> None:
    findings = {each.name: found(each, made) for each in EXAMINATIONS if each.name in READ}
    renamed = {
        name: replace(each, numbers={f"{number}_new": value for number, value in each.numbers.items()})
        for name, each in findings.items()
    }
    for claim in READERS:
        assert judge(claim, OneRun(findings, "quick", made)).verdict != "not testable here"
        with pytest.raises(KeyError, match=r"has no number '.*did you mean .*_new'.* The valid ones are "):
            judge(claim, OneRun(renamed, "quick", made))


@pytest.fixture(scope="module")
def made(rods_run: Run) -> Outcome:
    """The outcome of a real run of a moment."""
    return outcome(rods_run)


def found(examination: Examination, made: Outcome) -> Findings:
    """What an examination says of runs that all end alike."""
    runs = results(examination, "quick", lambda case: synthetic(made, case, 0.4, WAVE))
    return examination.examine(runs, "quick")

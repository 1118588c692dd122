"""Claims are judged by one rule; what they rest on is read by names that must be there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import nan
from pathlib import Path

import pytest
from test_examinations_a import WAVE, Made, results, synthetic

from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome, outcome
from annelid.experiment.store import case_key
from annelid.simulation.loop import simulate
from annelid_studies.riddle2023.claims.discussion import cause_claim, cost_claim, friction_claim, noise_claim
from annelid_studies.riddle2023.claims.evidence import Evidence, judged, near
from annelid_studies.riddle2023.claims.model import elements_claim, pins_claim, velocity_claim
from annelid_studies.riddle2023.contents import Examination, Findings, Table
from annelid_studies.riddle2023.examinations import EXAMINATIONS
from annelid_studies.worms import FAST, Effort, rods

SIX_SPRINGS = (0.392, 0.302, 0.284, 0.334, 0.285, 0.322)
"""How far segment 2 stays below segment 1 by each of the springs; the paper says 39.4 %."""
READERS = (pins_claim, elements_claim, velocity_claim, cause_claim, noise_claim, friction_claim)
"""The claims that rest on numbers of examinations."""


READ = ("pins", "discretization", "timestep", "ranges", "noise", "friction")


class Told(Evidence):
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
        ((2.4, 2.55), 2.5, ("holds within", "4.0 %")),
        ((2.5, 2.8), 2.5, ("rests on", "the spring")),
        ((2.8, 2.1), 2.5, ("does not hold", "")),
        ((2.5, nan), 2.5, ("rests on", "the spring")),
        ((nan,), 2.5, ("does not hold", "")),
        (SIX_SPRINGS, 0.394, ("rests on", "the spring")),
        (SIX_SPRINGS[:1], 0.394, ("holds within", "0.5 %")),
    ):
        with subtests.test(f"{ours!r:.60}"):
            assert near(ours, paper, "the spring") == expected


def test_a_property_holds_where_all_have_it() -> None:
    assert judged([True, True], "the run") == ("holds", "")
    assert judged([True, False], "the run") == ("rests on", "the run")
    assert judged([False, False], "the run") == ("does not hold", "")


def test_no_time_of_computing_enters_a_verdict(made: Outcome) -> None:
    for seconds in (0.0, 1.0, 1e5):
        timed = replace(made, cpu_time_s=seconds)
        fast = Made({case_key(Case(FAST)): timed})
        assert cost_claim(Told({}, "quick", timed, fast)).verdict == "not testable here"


def test_claims_find_their_numbers_and_miss_none_silently(
    made: Outcome, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    findings = {each.name: found(each, made, tmp_path, monkeypatch) for each in EXAMINATIONS if each.name in READ}
    renamed = {
        name: replace(each, numbers={f"{number}_new": value for number, value in each.numbers.items()})
        for name, each in findings.items()
    }
    for claim in READERS:
        assert claim(Told(findings, "quick", made)).verdict != "not testable here"
        with pytest.raises(KeyError, match=r"has no number '.*did you mean .*_new'.* Valid: "):
            claim(Told(renamed, "quick", made))


def test_numbers_stay_complete_when_they_are_kept_and_read_back() -> None:
    findings = Findings("Answer.", "Caption.", Table(["a"], [["1"]]), numbers={"period_s": 2.6})
    with pytest.raises(KeyError, match=r"no number 'periods'.*did you mean 'period_s'"):
        findings.numbers["periods"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """The outcome of a real run of a few steps."""
    folder = tmp_path_factory.mktemp("run") / "short"
    return outcome(simulate(rods({"duration_s": 0.02}).config, folder, progress=False))


def found(examination: Examination, made: Outcome, folder: Path, monkeypatch: pytest.MonkeyPatch) -> Findings:
    """What an examination says of runs that all end alike, without its figure."""
    monkeypatch.setattr(f"annelid_studies.riddle2023.examinations.{examination.name}._draw", lambda *_: None)
    runs = results(examination, "quick", lambda case: synthetic(made, case, 0.4, WAVE))
    return examination.examine(runs, "quick", folder / examination.name)

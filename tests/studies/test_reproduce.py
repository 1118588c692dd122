"""The report as a whole: what is run, what is drawn, what is kept; and the judgement of numbers."""

from __future__ import annotations

from pathlib import Path

import pytest

from annelid.errors import ConfigError
from annelid.experiment.case import Case
from annelid.experiment.store import Store
from annelid_studies.papers.report_parts import Examination, Findings, Table
from annelid_studies.riddle2023 import paper
from annelid_studies.riddle2023.claims import claim_cases
from annelid_studies.riddle2023.examinations import EXAMINATIONS
from annelid_studies.standard_cases import PLANAR, RODS, Effort, one_after_the_other

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

SHORT = Case(PLANAR, {"duration_s": 0.2})
SLOWER = Case(PLANAR, {"duration_s": 0.2, "controller.gate_time_constant_ms": 250})


def examine(store: Store, effort: Effort) -> Findings:
    names = [store[case].summary.name for case in (SHORT, SLOWER)]
    return Findings(f"Two runs of {names[0]}.", Table(["run"], [[name] for name in names]))


TINY = Examination("tiny", "Tiny", "Does it run?", lambda effort: [SHORT, SLOWER], examine)


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, "EXAMINATIONS", (TINY,))
    monkeypatch.setattr(paper, "MAIN", SHORT)
    monkeypatch.setattr(paper, "VARIANTS", {PLANAR: SHORT})
    monkeypatch.setattr(paper, "_QUICK", (PLANAR,))


@pytest.mark.usefixtures("tiny")
def test_one_examination_alone_makes_a_report_of_its_own(tmp_path: Path) -> None:
    report = paper.reproduce(tmp_path, "quick", only=["tiny"])
    assert [each.examination.name for each in report.examinations] == ["tiny"]
    assert report.claims == []
    assert report.figures == []
    assert report.provenance["runs"] == "2"
    assert report.examinations[0].findings.answer == "Two runs of riddle2022-planar."
    assert "Three worms stand side by side" in report.summary[-1]


@pytest.mark.usefixtures("tiny")
def test_a_second_call_runs_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = paper.reproduce(tmp_path, "quick", only=["tiny"])
    monkeypatch.setattr("annelid.experiment.store.attempt", None)
    assert paper.reproduce(tmp_path, "quick", only=["tiny"]).main_table == first.main_table


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A whole report of two figures and no claims."""
    monkeypatch.setattr(paper, "FIGURES", dict.fromkeys((4, 5), lambda run, series, stem: "a caption"))
    monkeypatch.setattr(paper, "claim_cases", lambda effort: [])
    monkeypatch.setattr(paper, "paper_claims", lambda evidence: [])
    monkeypatch.setattr(paper, "rule", lambda evidence: [])


@pytest.mark.usefixtures("tiny", "drawn")
def test_progress_tells_stage_and_ends_at_the_whole(tmp_path: Path) -> None:
    told: list[tuple[str, int, int, float]] = []
    paper.reproduce(tmp_path, "quick", progress=lambda *step: told.append(step))
    assert told[0][0] == "running worms"
    assert [step for step in told if step[0] == "drawing"] == [
        ("drawing", 0, 2, 0.0),
        ("drawing", 1, 2, 0.5),
        ("drawing", 2, 2, 1.0),
    ]
    assert told[-1][3] == 1.0
    assert all(0 <= share <= 1 for *_, share in told)


def test_an_unknown_examination_is_named_with_the_valid_ones(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no examination 'frictoin': did you mean 'friction'\? .*noise"):
        paper.reproduce(tmp_path, only=["frictoin"])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("effort", ["quick", "full"])
def test_every_case_of_the_report_is_a_valid_configuration(effort: Effort) -> None:
    cases = [*claim_cases(effort), *(case for examination in EXAMINATIONS for case in examination.cases(effort))]
    assert all(case.config.duration_s > 0 for case in cases)
    if effort == "quick":
        assert sum(case.cost_s for case in cases) < 900
    else:
        assert sum(case.cost_s for case in cases) < 7000


def test_the_open_loop_protocol_holds_each_segment_in_turn() -> None:
    config = Case(RODS, one_after_the_other(3, 0.5, 0.25)).config
    assert config.duration_s == 2.0
    spans = [(c.segment, c.start_s, c.stop_s) for c in config.controller.contractions]  # type: ignore[union-attr]
    assert spans == [(1, 0.0, 0.5), (2, 0.75, 1.25), (3, 1.5, 2.0)]

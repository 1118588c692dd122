"""The whole report at quick effort, from nothing: the claims that the paper's numbers stand on must come out."""

from __future__ import annotations

from pathlib import Path

import pytest

from annelid_studies.papers.report import claims_page, write_report
from annelid_studies.riddle2023.paper import FIGURES, reproduce

CLAIMS_THAT_HOLD = (
    "The wave runs from segment 1 to 3",
    "A cycle of the three-segment worm takes about 2.6 s",
    "Half-centre neurons flip",
    "When segment 1 contracts, segment 2 lengthens slightly",
)
CLAIMS_THAT_REST_ON_A_READING = (
    "Segment 1 elongates by at most 4.20 cm",
    "Segment 2 elongates by at most 2.55 cm",
    "Segment 3 elongates by at most 4.02 cm",
    "Segment 2 elongates 39.4 % less than segment 1",
)
NOT_TESTED_BY_DECISION = {
    "The automatic peak force is too small, so that a scaling factor of 550,000 is needed.",
    "5000 steps take 3.5 minutes.",
}


@pytest.mark.slow
def test_the_quick_report_reproduces_the_paper_s_main_numbers(tmp_path: Path) -> None:
    report = reproduce(tmp_path, "quick")
    verdicts = {claim.claim: claim.verdict for claim in report.claims}
    for beginning in CLAIMS_THAT_HOLD:
        (verdict,) = [verdict for claim, verdict in verdicts.items() if claim.startswith(beginning)]
        assert verdict in ("holds", "holds within"), beginning
    for beginning in CLAIMS_THAT_REST_ON_A_READING:
        (verdict,) = [verdict for claim, verdict in verdicts.items() if claim.startswith(beginning)]
        assert verdict == "rests on", beginning
    assert {claim for claim, verdict in verdicts.items() if verdict == "not testable here"} == NOT_TESTED_BY_DECISION
    assert len(verdicts) == 36
    assert verdicts["Activation is 1/(1 + exp(-0.35 (U_exp - U_con))) (Eq. 2)."] == "does not hold"
    assert [figure.number for figure in report.figures] == list(FIGURES)
    pictures = [figure.picture for figure in report.figures]
    assert all(picture.exists() and picture.with_suffix(".svg").exists() for picture in pictures)
    assert all(claim.command and claim.evidence and claim.ours for claim in report.claims)
    html = write_report(report, tmp_path).read_text(encoding="utf-8")
    assert html.count("<figure") == len(pictures)
    assert all(claim.verdict in claims_page(report) for claim in report.claims)
    assert "nan" not in claims_page(report).lower().split()

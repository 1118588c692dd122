"""What the report consists of."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from annelid.markdown import Table
from annelid_studies.riddle2023.examination import Effort, Examination, Findings

Verdict = Literal["holds", "holds within", "rests on", "does not hold", "not testable here"]


@dataclass(frozen=True)
class Claim:
    """One claim of the paper and what became of it.

    Attributes:
        topic: Structure, sensing, actuation, results, discussion, future work.
        claim: What the paper says, in our words.
        place: Where it says so.
        paper: The paper's number or words.
        ours: Our number or words.
        evidence: Why we say so, in one to three sentences; for a claim that fails, its cause as far as we found it.
        command: The command that makes our number.
        verdict: Whether it holds.
        within: How nearly, for example "4.5 %", where it holds within something; what it rests on.
    """

    topic: str
    claim: str
    place: str
    paper: str
    ours: str
    evidence: str
    command: str
    verdict: Verdict
    within: str = ""


@dataclass(frozen=True)
class Figure:
    """A figure of the report.

    Attributes:
        number: The paper's number of the figure.
        title: A few words.
        picture: The PNG; an SVG of the same stem lies beside it.
        caption: What one sees.
    """

    number: int
    title: str
    picture: Path
    caption: str


@dataclass(frozen=True)
class Examined:
    """An examination with what it found and its figure."""

    examination: Examination
    findings: Findings
    picture: Path


@dataclass(frozen=True)
class Report:
    """The whole report.

    Attributes:
        effort: Quick or full.
        summary: Paragraphs that say what was found, for those who read no further.
        main_table: Our main numbers beside the paper's.
        figures: The paper's figures from our own runs.
        claims: The paper's claims.
        examinations: The examinations in the order of the report.
        provenance: Versions, number of runs, processor time: label and value.
        rule: Paragraphs that say how the claims are judged.
    """

    effort: Effort
    summary: Sequence[str]
    main_table: Table
    figures: Sequence[Figure]
    claims: Sequence[Claim]
    examinations: Sequence[Examined]
    provenance: Mapping[str, str]
    rule: Sequence[str] = ()


def tally(claims: Sequence[Claim]) -> str:
    """Counts the verdicts: ``holds: 18; does not hold: 6``."""
    number = Counter(claim.verdict for claim in claims)
    return "; ".join(f"{verdict}: {number[verdict]}" for verdict in get_args(Verdict) if number[verdict])

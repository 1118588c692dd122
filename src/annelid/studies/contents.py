"""What the report consists of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from annelid.studies.examination import Effort, Examination, Findings, Table

Verdict = Literal["holds", "holds within", "does not hold", "not testable here"]


@dataclass(frozen=True)
class Claim:
    """One claim of the paper and what became of it.

    Attributes:
        topic: Structure, sensing, actuation, results, discussion, future work.
        claim: What the paper says, in our words.
        place: Where it says so.
        verdict: Whether it holds.
        within: How nearly, for example "4.5 %", where it holds within something.
        paper: The paper's number or words.
        ours: Our number or words.
        evidence: Why we say so, in one to three sentences; for a claim that fails, its cause as far as we found it.
        command: The command that makes our number.
    """

    topic: str
    claim: str
    place: str
    verdict: Verdict
    paper: str
    ours: str
    evidence: str
    command: str
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
        provenance: Versions, number of runs, computing time: label and value.
    """

    effort: Effort
    summary: Sequence[str]
    main_table: Table
    figures: Sequence[Figure]
    claims: Sequence[Claim]
    examinations: Sequence[Examined]
    provenance: Mapping[str, str]

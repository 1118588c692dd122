"""What the report consists of: the paper's claims and figures, and examinations with what they found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any, Literal, get_args

from annelid.errors import suggest
from annelid.experiment import Case, Store
from annelid.markdown import Table
from annelid_studies.worms import Effort

Verdict = Literal["holds", "holds within", "rests on", "does not hold", "not testable here"]
Number = float | str | None


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


def tally(claims: Sequence[Claim]) -> str:
    """Counts the verdicts: ``holds: 18; does not hold: 6``."""
    number = Counter(claim.verdict for claim in claims)
    return "; ".join(f"{verdict}: {number[verdict]}" for verdict in get_args(Verdict) if number[verdict])


@dataclass(frozen=True)
class Figure:
    """A figure of the report, with the paper's number; an SVG lies beside its PNG."""

    number: int
    title: str
    picture: Path
    caption: str


class Numbers(dict[str, Number]):
    """Single results of an examination by name; a name that is not there is an error."""

    def __missing__(self, name: str) -> Any:
        raise KeyError(f"the examination has no number {name!r}: {suggest(name, self)}")


@dataclass(frozen=True)
class Findings:
    """What an examination found.

    Attributes:
        answer: The answer to its question in one to four sentences, with numbers; shown in bold at its top.
        caption: What one sees in the figure.
        table: The numbers.
        remarks: Paragraphs for those who want to know more; may be empty.
        numbers: Single results by name, for the claims; NaN and infinities become None, since JSON lacks them.
    """

    answer: str
    caption: str
    table: Table
    remarks: Sequence[str] = ()
    numbers: Mapping[str, Number] = field(default_factory=dict)

    def __post_init__(self) -> None:
        plain = {
            name: value if value is None or isinstance(value, str) else float(value) if isfinite(value) else None
            for name, value in self.numbers.items()
        }
        object.__setattr__(self, "numbers", Numbers(plain))


@dataclass(frozen=True)
class Examination:
    """A small reproducible study.

    Attributes:
        name: One word, for file names and ``annelid paper --only``.
        title: Its heading.
        question: What it asks, in one or two sentences.
        cases: The runs that it needs at an effort.
        examine: Draws its figure as ``<stem>.svg`` and ``<stem>.png`` and returns what it found in a store of its runs.
    """

    name: str
    title: str
    question: str
    cases: Callable[[Effort], Sequence[Case]]
    examine: Callable[[Store, Effort, Path], Findings]


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

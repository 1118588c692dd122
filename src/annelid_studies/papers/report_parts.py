"""What the report consists of: the paper's claims and figures, and examinations with what they found."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, get_args

from annelid.errors import suggest
from annelid.experiment import Case, Outcome, Store
from annelid.markdown import Table
from annelid_studies.standard_cases import Effort

Verdict = Literal["holds", "holds within", "rests on", "does not hold", "not testable here"]
Number = float | str | None


@dataclass(frozen=True)
class Claim:
    """One claim of the paper and what became of it; ``claims/claims.toml`` explains the words."""

    topic: str
    claim: str
    place: str
    paper: str
    ours: str
    evidence: str
    command: str
    verdict: Verdict  # Whether it holds
    within: str = ""  # How nearly, for example "4.5 %", where it holds within something; what it rests on


def provenance(outcomes: Collection[Outcome]) -> dict[str, str]:
    """Returns what a report says of its making: versions, number of runs, and their processor time."""
    return {
        "annelid": version("annelid"),
        "MuJoCo (mujoco-core)": version("mujoco-core"),
        "numpy": version("numpy"),
        "Python": platform.python_version(),
        "runs": str(len(outcomes)),
        "processor time of the runs": f"{sum(one.cpu_time_s for one in outcomes) / 60:.0f} min",
    }


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
    """What an examination found; ``examinations/examinations.toml`` explains the words."""

    answer: str
    table: Table
    remarks: Sequence[str] = ()
    numbers: Mapping[str, Number] = field(default_factory=dict)  # Single results that claims are judged by

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", Numbers(self.numbers))


@dataclass(frozen=True)
class Examination:
    """A small reproducible study."""

    name: str  # One word, for file names and ``annelid study paper --only``
    title: str
    question: str
    cases: Callable[[Effort], Sequence[Case]]  # The runs that it needs at an effort
    examine: Callable[[Store, Effort], Findings]  # Returns what it found in a store of its runs


@dataclass(frozen=True)
class Examined:
    """An examination with what it found."""

    examination: Examination
    findings: Findings


@dataclass(frozen=True)
class Paper:
    """The paper that a report is about."""

    name: str  # Its title
    authors: str  # And the year
    title: str  # Title of the report
    heading: str  # Title of the repository's page of claims
    command: str  # The command that writes that page
    leading: Sequence[int]  # Numbers of the figures that stand first in the report


@dataclass(frozen=True)
class Report:
    """The whole report."""

    paper: Paper  # What it is about
    effort: Effort  # Quick or full
    summary: Sequence[str]  # Paragraphs that say how to read the numbers
    main_table: Table  # Our main numbers beside the paper's, with the deviation
    variants: Table  # More numbers, of several worms
    figures: Sequence[Figure]  # The paper's figures from our own runs
    claims: Sequence[Claim]  # The paper's claims
    examinations: Sequence[Examined]  # The examinations in the order of the report
    provenance: Mapping[str, str]  # Versions, number of runs, processor time: label and value
    rule: Sequence[str] = ()  # Paragraphs that say how the claims are judged
    files: Sequence[Path] = ()  # Further files that were written

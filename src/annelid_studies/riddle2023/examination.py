"""An examination: a small reproducible study with its question, its runs, its figure and what it found."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any, Literal

from annelid.errors import suggest
from annelid.experiment import Case, Outcome
from annelid.markdown import Table

Effort = Literal["quick", "full"]
"""Coarse and within minutes, or the whole."""


class Results:
    """The outcomes of an examination's cases."""

    def __init__(self, outcomes: Mapping[str, Outcome], key: Callable[[Case], str]) -> None:
        """Wraps outcomes that are kept under the key of their case."""
        self._outcomes = outcomes
        self._key = key

    def __getitem__(self, case: Case) -> Outcome:
        return self._outcomes[self._key(case)]


class Numbers(dict[str, Any]):
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
    numbers: Mapping[str, float | str | None] = field(default_factory=Numbers)

    def __post_init__(self) -> None:
        plain = {name: _plain(value) for name, value in self.numbers.items()}
        object.__setattr__(self, "numbers", Numbers(plain))


def _plain(value: float | str | None) -> float | str | None:
    if value is None or isinstance(value, str):
        return value
    return float(value) if isfinite(value) else None


@dataclass(frozen=True)
class Examination:
    """A small study.

    Attributes:
        name: One word, for file names and ``annelid paper --only``.
        title: Its heading.
        question: What it asks, in one or two sentences.
        cases: The runs that it needs at an effort.
        examine: Draws its figure as ``<stem>.svg`` and ``<stem>.png`` and returns what it found.
    """

    name: str
    title: str
    question: str
    cases: Callable[[Effort], Sequence[Case]]
    examine: Callable[[Results, Effort, Path], Findings]

"""How claims are judged: a number against the paper's, and a property over all runs or readings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from annelid_studies.papers.report_parts import Claim, Verdict
from annelid_studies.papers.words import filled

EXACT, NEAR = 0.005, 0.1
"""Relative differences from a number of the paper up to which a claim holds, and holds within the margin given."""
Judgement = tuple[tuple[Verdict, str], Mapping[str, Any]]
"""The verdict with what it holds within or rests on, and what fills the claim's words."""
E = TypeVar("E")


class Judges(dict[str, Callable[[E], Judgement]]):
    """What judges a claim, by its name in a file of words."""

    def judge(self, function: Callable[[E], Judgement]) -> Callable[[E], Judgement]:
        """Marks the function that judges the claim of its name."""
        self[function.__name__] = function
        return function


def claim_of(
    text: Mapping[str, Any], judge: Callable[[E], Judgement] | None, evidence: E, commands: Mapping[str, str]
) -> Claim:
    """Judges one claim of a file of words.

    Args:
        text: Its words.
        judge: Measures what the words leave open and judges it; None for a claim whose words have the verdict.
        evidence: What it is judged by.
        commands: Command lines that the words name.
    """
    words = dict(text)
    decided = words.pop("verdict", None), ""
    verdict, found = (decided, {}) if judge is None else judge(evidence)
    said = {part: filled(one, {**commands, **found}) for part, one in words.items()}
    return Claim(**said, verdict=verdict[0], within=verdict[1])


def near(ours: Iterable[float], paper: float, on: str) -> tuple[Verdict, str]:
    """Judges all of our readings, of which some may be NaN, by a number of the paper's; see `judged`."""
    apart = [abs(one / paper - 1.0) for one in ours]
    if all(one <= EXACT for one in apart):
        return "holds", ""
    if all(one <= NEAR for one in apart):
        return "holds within", f"{100 * max(apart):.1f} %"
    return judged((one <= NEAR for one in apart), on)


def judged(has: Iterable[bool], on: str = "") -> tuple[Verdict, str]:
    """Judges whether runs or readings have a property. Those that do and others differ in what is named."""
    found = [bool(one) for one in has]
    if all(found):
        return "holds", ""
    return ("rests on", on) if any(found) else ("does not hold", "")

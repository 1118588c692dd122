"""What the claims are judged by: the runs that they need, and how near is near."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from annelid.studies.case import CHAIN, FAST, PLANAR, Case, chain, fast, one_after_the_other, rods
from annelid.studies.contents import Verdict
from annelid.studies.examination import Effort, Findings, Results
from annelid.studies.examinations.side_by_side import WORMS
from annelid.studies.outcome import Outcome
from annelid.studies.store import Store

MAIN = Case(CHAIN)
EQUAL_RANGES = {"body.rings.length_range_m": [0.566, 1.067]}
SHORT_MINIMUM = rods({"body.rings.minimum_length": 0.5, **one_after_the_other()})
PLANAR_CASES = {
    300: Case(PLANAR),
    200: Case(PLANAR, {"controller.gate_time_constant_ms": 200, "body.gain": 1.9}),
    100: Case(PLANAR, {"controller.gate_time_constant_ms": 100, "body.gain": 3.6}),
}
"""The planar worm with the gate time constants (ms) and gains that go together."""
LABELS = {worm.name: worm.label for worm in WORMS}
"""What the worms are called, nearest to the paper's first."""
NEGLIGIBLE = 0.01
"""Travel in a cycle, in lengths of the body, below which we call it negligible."""
PAPER_STEPS, PAPER_WALL_S = 5000, 210.0
TUBE_AREA_M2, POLYETHYLENE_KG_PER_M3 = 1.7e-5, 940.0


@dataclass(frozen=True)
class Evidence:
    """What the claims are judged by.

    Attributes:
        store: The runs.
        results: Their outcomes.
        effort: Quick or full.
        findings: What each examination found, by its name.
    """

    store: Store
    results: Results
    effort: Effort
    findings: dict[str, Findings]

    def number(self, examination: str, name: str) -> Any:
        """A single result of an examination; None where this effort did not measure it."""
        return self.findings[examination].numbers.get(name)

    def first_number(self, examination: str, name: str) -> Found:
        """A single result of the worm nearest to the paper's for which an examination has one.

        Args:
            examination: Its name.
            name: The number's name with ``{}`` in the place of the worm's.

        Raises:
            KeyError: It has that number of no worm.
        """
        for worm in LABELS:
            value = self.number(examination, name.format(worm))
            if value is not None:
                return Found(LABELS[worm], value)
        raise KeyError(name)


@dataclass(frozen=True)
class Found:
    """A number of an examination and the worm that it is of."""

    worm: str
    value: Any


def longer_worm(n_segments: int, worm: str) -> Case:
    """A worm of that many segments with equal muscles, each contracted in turn: the test of the interior segments."""
    changes = {"body.mesh.n_segments": n_segments, **EQUAL_RANGES, **one_after_the_other(n_segments)}
    return {"chain": chain, "fast": fast, "rods": rods}[worm](changes)


def longer_worms(effort: Effort) -> list[tuple[int, str]]:
    """Numbers of segments and worms of that test."""
    pairs = [(n, worm) for worm in ("fast", "rods") for n in (4, 5, 6)]
    return [*pairs, (4, "chain")] if effort == "full" else pairs


def claim_cases(effort: Effort) -> Sequence[Case]:
    """The runs that the claims need beside those of the examinations."""
    return [
        MAIN,
        Case(FAST),
        rods(),
        SHORT_MINIMUM,
        rods(one_after_the_other()),
        fast(one_after_the_other()),
        *PLANAR_CASES.values(),
        *(longer_worm(n, worm) for n, worm in longer_worms(effort)),
    ]


def nearness(ours: float, paper: float, exact: float = 0.005) -> tuple[Verdict, str]:
    """Judges a number against the paper's: it holds, holds within a stated margin up to 10 %, or does not hold.

    Args:
        ours: Our number.
        paper: The paper's.
        exact: Relative difference up to which it simply holds.
    """
    difference = abs(ours / paper - 1.0)
    if difference <= exact:
        return "holds", ""
    if difference <= 0.1:
        return "holds within", f"{100 * difference:.1f} %"
    return "does not hold", ""


def holds_if(condition: bool) -> Verdict:
    """The verdict of a condition."""
    return "holds" if condition else "does not hold"


def centimetres(values: Sequence[float | None] | None, digits: int = 2) -> str:
    """Writes lengths given in m as ``1.00 / 2.00 cm``."""
    return " / ".join("-" if value is None else f"{100 * value:.{digits}f}" for value in values or ()) + " cm"


def order_of(outcome: Outcome) -> str:
    """The order of onsets as ``1-2-3``."""
    return "-".join(str(segment) for segment in outcome.rhythm.order)

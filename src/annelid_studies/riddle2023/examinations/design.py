"""Several worms side by side: what varies, and what is read from each run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any, NamedTuple

import numpy as np

from annelid.analysis import RhythmScore, middle_deficit
from annelid.experiment import Case, Hold, Outcome, Store
from annelid.markdown import Table
from annelid.morphology import Array
from annelid_studies.papers.report_parts import Examination, Findings, Number
from annelid_studies.papers.words import filled, number, texts
from annelid_studies.standard_cases import Effort, chain, fast, rods
from annelid_studies.tables import grouped


@dataclass(frozen=True)
class Worm:
    """One of the worms that stand side by side."""

    name: str  # One word, for names of numbers
    label: str  # For legends and tables
    case: Callable[[Mapping[str, Any] | None], Case]  # Makes its case from changed fields

    @property
    def tolerance_m(self) -> float:
        """Tolerance of its sensors, m."""
        return self.case(None).config.sensor.tolerance_m


PAPERS = Worm("chain", "the paper's chain", chain)
SOFT = Worm("fast", "rods with soft crossings", fast)
RIGID = Worm("rods", "rods with rigid crossings", rods)
WORMS = (PAPERS, SOFT, RIGID)


class Point(NamedTuple):
    """One worm at one value of what an examination varies, with the runs that are made of it."""

    worm: Worm
    value: float
    walk: Case | None = None  # Its closed-loop run
    hold: Case | None = None  # Its open-loop run, in which each segment is held contracted in turn


def cases_of(points: Iterable[Point]) -> list[Case]:
    """Returns the runs of points, those in closed loop first."""
    points = list(points)
    return [case for case in (*(one.walk for one in points), *(one.hold for one in points)) if case is not None]


@dataclass(frozen=True, eq=False)
class Reading:
    """What was found at a point; numbers are NaN where there is no run, or it ended before."""

    worm: Worm
    value: float  # The value of what is varied
    walk: Outcome | None = None  # Outcome in closed loop
    hold: Outcome | None = None  # Outcome in open loop

    @property
    def closed(self) -> Outcome:
        """Outcome in closed loop, which must have been run."""
        assert self.walk is not None
        return self.walk

    @property
    def rhythm(self) -> RhythmScore | None:
        """The score in closed loop."""
        return self.walk and self.walk.rhythm

    @property
    def walks(self) -> bool:
        """Whether it walks in one wave 1-2-3."""
        return self.walk is not None and self.walk.rhythm.is_one_wave

    @property
    def walked_m(self) -> Array:
        """Largest mean elongation of each segment's springs in closed loop, m, ``(n_segments,)``."""
        return walked_elongation(self.walk)

    @property
    def walked_helix_m(self) -> Array:
        """The same of the spring on the first helix, peak to peak, as the paper seems to read it."""
        return walked_elongation(self.walk, first_helix=True)

    @property
    def held_m(self) -> Array:
        """Mean elongation of each segment's springs at the end of its own contraction, m, ``(n_segments,)``."""
        return held_elongation(self.hold)

    @property
    def travel_m(self) -> float:
        """Travel forwards in closed loop, m."""
        return number(self.closed.summary.travel_m)

    @property
    def force_N(self) -> float | None:
        """Median force of the contracted muscles in closed loop, N."""
        return self.closed.summary.contraction_force_median_N

    @property
    def deficit(self) -> float:
        """Deficit of segment 2 over all springs in closed loop, a fraction."""
        return middle_deficit(self.walked_m)

    @property
    def held_deficit(self) -> float:
        """Deficit of segment 2 over all springs in open loop, a fraction."""
        return middle_deficit(self.held_m)

    def at_holds(self, name: str) -> Array:
        """A reading at the end of each segment's own contraction, by its name in `Hold`, ``(n_segments,)``."""
        return _of_holds(self.hold, lambda hold: number(getattr(hold, name)))


Columns = Mapping[str, Callable[[Reading], str]]
"""What the columns of a table write of a reading, by their heads."""


def read(points: Iterable[Point], store: Store) -> list[Reading]:
    """Looks the outcomes of points up."""
    return [Reading(worm, value, *(case and store[case] for case in runs)) for worm, value, *runs in points]


def by_worm(readings: Iterable[Reading]) -> dict[Worm, list[Reading]]:
    """Groups readings by their worm, in the order in which they come."""
    return grouped(readings, lambda one: one.worm)


def held_elongation(outcome: Outcome | None, *, first_helix: bool = False) -> Array:
    """Elongation of each segment at the end of its own open-loop contraction, m, ``(n_segments,)``.

    It is that of the mean of its springs, or of the one on the first helix; NaN where a run ended before.
    """
    name = "elongation_first_helix_m" if first_helix else "elongation_mean_m"
    return _of_holds(outcome, lambda hold: getattr(hold, name)[hold.segment - 1])


def _of_holds(outcome: Outcome | None, of_hold: Callable[[Hold], float]) -> Array:
    values = np.full(3 if outcome is None else outcome.summary.n_segments, nan)
    for hold in outcome.holds if outcome else ():
        values[hold.segment - 1] = of_hold(hold)
    return values


def walked_elongation(outcome: Outcome | None, *, first_helix: bool = False) -> Array:
    """Largest elongation of each segment in closed loop, m, ``(n_segments,)``; NaN where a run has no samples.

    It is that of the mean of its springs, or of the one on the first helix, peak to peak.
    """
    if outcome is None:
        return np.full(3, nan)
    summary = outcome.summary
    values = summary.elongation_first_helix_pp_m if first_helix else summary.elongation_mean_max_m
    return np.full(summary.n_segments, nan) if values is None else np.array(values, dtype=float)


def numbered(readings: Iterable[Reading], readers: Mapping[str, Callable[[Reading], Number]]) -> dict[str, Number]:
    """Names numbers of readings: ``{worm}`` and ``{value}`` in a name are filled in."""
    return {
        name.format(worm=one.worm.name, value=one.value): reader(one)
        for one in readings
        for name, reader in readers.items()
    }


EXAMINATIONS_TOML = "riddle2023/examinations/examinations.toml"


def examination(
    name: str, cases: Callable[[Effort], Sequence[Case]], examine: Callable[[Store, Effort], Findings]
) -> Examination:
    """Makes an examination whose words stand in ``examinations.toml``."""
    words = texts(EXAMINATIONS_TOML)[name]
    return Examination(name, filled(words["title"], {}), filled(words["question"], {}), cases, examine)


def findings(
    name: str,
    values: Mapping[str, Any],
    table: Table,
    remarks: Iterable[str] = (),
    numbers: Mapping[str, Number] | None = None,
) -> Findings:
    """Says what an examination found.

    Args:
        name: Its name in ``examinations.toml``.
        values: What fills its words.
        table: Its table.
        remarks: Names of the remarks that apply.
        numbers: Single results that claims are judged by.
    """
    words = texts(EXAMINATIONS_TOML)[name]
    said = [filled(words["remarks"][one], values) for one in remarks]
    return Findings(filled(words["answer"], values), table, said, numbers or {})

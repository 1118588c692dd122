"""Several worms side by side: what is varied, and what is read from each run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np

from annelid.analysis import RhythmScore, middle_deficit
from annelid.experiment import Case, Outcome
from annelid.morphology import Array
from annelid_studies.riddle2023.examination import Results
from annelid_studies.worms import chain, fast, rods


@dataclass(frozen=True)
class Worm:
    """One of the worms that stand side by side.

    Attributes:
        name: One word, for names of numbers.
        label: For legends and tables.
        short: For narrow places.
        case: Makes its case from changed fields.
        marker: Its marker in figures.
        line: Its line style.
        color: Its colour where colours do not tell segments.
    """

    name: str
    label: str
    short: str
    case: Callable[[Mapping[str, Any] | None], Case]
    marker: str
    line: str
    color: str

    @property
    def look(self) -> dict[str, Any]:
        """Marker, line and colour as matplotlib takes them."""
        return {"marker": self.marker, "linestyle": self.line, "color": self.color, "label": self.label}

    @property
    def tolerance_m(self) -> float:
        """Tolerance of its sensors, m."""
        return self.case(None).config.sensor.tolerance_m


PAPERS = Worm("chain", "the paper's chain", "chain", chain, "o", "-", "#1b2a6b")
SOFT = Worm("fast", "rods with soft crossings", "soft", fast, "s", "--", "#6b7280")
RIGID = Worm("rods", "rods with rigid crossings", "rigid", rods, "^", ":", "#e07b39")
WORMS = (PAPERS, SOFT, RIGID)


@dataclass(frozen=True)
class Point:
    """One worm at one value of what an examination varies.

    Attributes:
        worm: The worm.
        value: The value.
        walk: Its closed-loop run, if one is made.
        hold: Its open-loop run, in which each segment is held contracted in turn, if one is made.
    """

    worm: Worm
    value: float
    walk: Case | None = None
    hold: Case | None = None


def cases_of(points: Iterable[Point]) -> list[Case]:
    """Returns the runs of points, those in closed loop first."""
    points = list(points)
    return [case for case in (*(one.walk for one in points), *(one.hold for one in points)) if case is not None]


@dataclass(frozen=True, eq=False)
class Reading:
    """What was found at a point; numbers are NaN where there is no run, or it ended before.

    Attributes:
        worm: The worm.
        value: The value of what is varied.
        walk: Outcome in closed loop.
        hold: Outcome in open loop.
    """

    worm: Worm
    value: float
    walk: Outcome | None = None
    hold: Outcome | None = None

    @property
    def closed(self) -> Outcome:
        """Outcome in closed loop, which must have been run."""
        assert self.walk is not None
        return self.walk

    @property
    def rhythm(self) -> RhythmScore | None:
        """The score in closed loop."""
        return None if self.walk is None else self.walk.rhythm

    @property
    def walks(self) -> bool:
        """Whether it walks in one wave 1-2-3."""
        return self.walk is not None and self.walk.rhythm.is_one_wave

    @property
    def period_s(self) -> float | None:
        """Mean period in closed loop, s."""
        return None if self.walk is None else self.walk.rhythm.period_s

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
        return nan if self.walk is None else number(self.walk.summary.travel_m)

    @property
    def force_N(self) -> float:
        """Median force of the contracted muscles in closed loop, N."""
        return nan if self.walk is None else number(self.walk.summary.contraction_force_median_N)

    @property
    def helix_deficit(self) -> float | None:
        """Deficit of segment 2 on the first helix in closed loop, a fraction."""
        return None if self.walk is None else self.walk.summary.middle_deficit

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


def read(points: Iterable[Point], results: Results) -> list[Reading]:
    """Looks the outcomes of points up."""
    return [
        Reading(one.worm, one.value, *(None if case is None else results[case] for case in (one.walk, one.hold)))
        for one in points
    ]


def by_worm(readings: Iterable[Reading]) -> dict[Worm, list[Reading]]:
    """Groups readings by their worm, in the order in which they come."""
    found: dict[Worm, list[Reading]] = {}
    for one in readings:
        found.setdefault(one.worm, []).append(one)
    return found


def held_elongation(outcome: Outcome | None, *, first_helix: bool = False) -> Array:
    """Elongation of each segment at the end of its own open-loop contraction, m; NaN where a run ended before.

    Args:
        outcome: Outcome of a run of `annelid_studies.worms.one_after_the_other`.
        first_helix: Reads the spring on the first helix in place of the mean of all.

    Returns:
        Shape ``(n_segments,)``.
    """
    name = "elongation_first_helix_m" if first_helix else "elongation_mean_m"
    return _of_holds(outcome, lambda hold: getattr(hold, name)[hold.segment - 1])


def _of_holds(outcome: Outcome | None, of_hold: Callable[[Any], float]) -> Array:
    values = np.full(3 if outcome is None else outcome.summary.n_segments, nan)
    for hold in outcome.holds if outcome else ():
        values[hold.segment - 1] = of_hold(hold)
    return values


def walked_elongation(outcome: Outcome | None, *, first_helix: bool = False) -> Array:
    """Largest elongation of each segment in closed loop, m: the mean of its springs, or the first helix peak to peak.

    Args:
        outcome: Outcome of a closed-loop run.
        first_helix: Reads the first helix, as the paper seems to.

    Returns:
        Shape ``(n_segments,)``; NaN where a run has no samples.
    """
    if outcome is None:
        return np.full(3, nan)
    summary = outcome.summary
    values = summary.elongation_first_helix_pp_m if first_helix else summary.elongation_mean_max_m
    return np.full(summary.n_segments, nan) if values is None else np.array([number(v) for v in values])


def numbered(
    readings: Iterable[Reading], readers: Mapping[str, Callable[[Reading], float | str | None]]
) -> dict[str, float | str | None]:
    """Names numbers of readings: ``{worm}`` and ``{value}`` in a name are filled in."""
    return {
        name.format(worm=one.worm.name, value=one.value): reader(one)
        for one in readings
        for name, reader in readers.items()
    }


def number(value: float | None) -> float:
    """Returns NaN for None."""
    return nan if value is None else value

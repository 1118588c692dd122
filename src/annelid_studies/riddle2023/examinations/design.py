"""Several worms side by side: what varies, what is read from each run, and one look for all of their figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from annelid.analysis import RhythmScore, middle_deficit
from annelid.draw import panel_title, segment_colors
from annelid.experiment import Case, Hold, Outcome, Store
from annelid.morphology import Array
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Number
from annelid_studies.riddle2023.words import number
from annelid_studies.tables import grouped
from annelid_studies.worms import chain, fast, rods


@dataclass(frozen=True)
class Worm:
    """One of the worms that stand side by side."""

    name: str  # One word, for names of numbers
    label: str  # For legends and tables
    short: str  # For narrow places
    case: Callable[[Mapping[str, Any] | None], Case]  # Makes its case from changed fields
    marker: str  # Its marker in figures
    line: str  # Its line style
    color: str  # Its colour where colours do not tell segments

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


def draw_over(
    axes: Axes, readings: Iterable[Reading], numbers: Callable[[Reading], Any], *, hollow: bool = False, **style: Any
) -> None:
    """Draws numbers of readings over what is varied, a line a worm; one number a segment makes a line a segment.

    Markers may be hollow, and lines have further properties as matplotlib takes them.
    """
    for worm, own in by_worm(readings).items():
        x, y = [one.value for one in own], np.array([numbers(one) for one in own], dtype=float)
        columns = [(y, worm.color)] if y.ndim == 1 else list(zip(y.T, segment_colors(y.shape[1]), strict=True))
        for column, color in columns:
            look = {**worm.look, "color": color, "markersize": 5.0, "markerfacecolor": "white" if hollow else color}
            axes.plot(x, column, **{**look, **style})


_DARK, _LIGHT = "#1b2a6b", "white"
_RHYTHMS: dict[str, dict[str, Any]] = {
    "1-2-3": {"marker": "o", "markerfacecolor": _DARK},
    "other order": {"marker": "D", "markerfacecolor": "#9aa3c7"},
    "disordered": {"marker": "s", "markerfacecolor": _LIGHT},
    "silent": {"marker": "x", "markerfacecolor": _DARK},
    "too short": {"marker": "_", "markerfacecolor": _DARK},
}


def draw_rhythms(axes: Axes, readings: Iterable[Reading]) -> list[Line2D]:
    """Draws the kind of rhythm of closed loops, a row a worm; returns handles for a legend of the kinds that occur."""

    def look(kind: str) -> dict[str, Any]:
        return {"linestyle": "none", "color": _DARK, "markersize": 6.5, **_RHYTHMS[kind]}

    rows = by_worm(one for one in readings if one.walk is not None)
    seen = set()
    for i, row in enumerate(rows.values()):
        for one in row:
            seen.add(kind := words.kind(one.closed.rhythm))
            axes.plot([one.value], [-i], **look(kind))
    axes.set_yticks([-i for i in range(len(rows))], [worm.short for worm in rows])
    axes.set_ylim(0.6 - len(rows), 0.6)
    axes.grid(visible=False, axis="x")
    return [Line2D([], [], label=kind, **look(kind)) for kind in _RHYTHMS if kind in seen]


def cross_out(axes: Axes, readings: Iterable[Reading], numbers: Callable[[Reading], Any], size: float = 9.0) -> None:
    """Draws black crosses over the numbers of runs that do not walk 1-2-3."""
    for one in readings:
        if not one.walks:
            y = np.ravel(numbers(one))
            axes.plot([one.value] * len(y), y, linestyle="none", marker="x", color="black", markersize=size)


def label_panel(
    axes: Axes, title: str, x_label: str, y_label: str, ticks: Iterable[float] = (), *, logarithmic: bool = False
) -> None:
    """Names a panel and its axes, and labels the abscissa with values of what is varied."""
    panel_title(axes, title)
    axes.set(xlabel=x_label, ylabel=y_label)
    if logarithmic:
        axes.set_xscale("log")
    if places := list(ticks):
        axes.set_xticks(places, [f"{place:g}" for place in places])
        axes.minorticks_off()


def segment_handles(n_segments: int = 3) -> list[Line2D]:
    """Returns handles for a legend of the segments' colours."""
    colors = enumerate(segment_colors(n_segments), start=1)
    return [look_handle(f"segment {i}", color=color, linewidth=3.0) for i, color in colors]


def look_handle(label: str, *, hollow: bool = False, color: Any = "0.25", **look: Any) -> Line2D:
    """Returns a handle for a legend of markers and line styles."""
    face = "white" if hollow else color
    return Line2D([], [], label=label, color=color, **{"markersize": 5.0, "markerfacecolor": face, **look})


def worm_handles() -> list[Line2D]:
    """Returns handles for a legend of the worms' looks."""
    return [look_handle(**worm.look) for worm in WORMS]


def legend_below(figure: Figure, handles: Sequence[Line2D], columns: int | None = None) -> None:
    """Puts a legend under all panels, where it covers nothing."""
    figure.legend(handles=handles, loc="outside lower center", ncols=columns or len(handles), columnspacing=1.4)

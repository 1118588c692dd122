"""Several worms side by side: their looks in figures, and their numbers as words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.analysis import RhythmScore
from annelid.draw.style import segment_colors
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid_studies.worms import chain, fast, rods

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

CM = 100.0
NOTHING = "–"
"""Printed where there is no number."""


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
        return {
            "marker": self.marker,
            "linestyle": self.line,
            "color": self.color,
            "markersize": 5.0,
            "label": self.label,
        }


PAPERS = Worm("chain", "the paper's chain", "chain", chain, "o", "-", "#1b2a6b")
SPRUNG = Worm("fast", "sprung rods", "sprung", fast, "s", "--", "#6b7280")
TIGHT = Worm("rods", "tight rods", "tight", rods, "^", ":", "#e07b39")
WORMS = (PAPERS, SPRUNG, TIGHT)


def held_elongation(outcome: Outcome, *, first_helix: bool = False) -> NDArray[np.float64]:
    """Elongation of each segment at the end of its own open-loop contraction, m; NaN where a run ended before.

    Args:
        outcome: Outcome of a run of `annelid_studies.worms.one_after_the_other`.
        first_helix: Reads the spring on the first helix in place of the mean of all.

    Returns:
        Shape ``(n_segments,)``.
    """
    values = np.full(outcome.summary.n_segments, nan)
    for hold in outcome.holds:
        of_all = hold.elongation_first_helix_m if first_helix else hold.elongation_mean_m
        values[hold.segment - 1] = of_all[hold.segment - 1]
    return values


def walked_elongation(outcome: Outcome, *, first_helix: bool = False) -> NDArray[np.float64]:
    """Largest elongation of each segment in closed loop, m: the mean of its springs, or the first helix peak to peak.

    Args:
        outcome: Outcome of a closed-loop run.
        first_helix: Reads the first helix, as the paper seems to.

    Returns:
        Shape ``(n_segments,)``; NaN where a run has no samples.
    """
    summary = outcome.summary
    values = summary.elongation_first_helix_pp_m if first_helix else summary.elongation_mean_max_m
    return np.full(summary.n_segments, nan) if values is None else np.array([number(v) for v in values])


def number(value: float | None) -> float:
    """Returns NaN for None."""
    return nan if value is None else value


def kept(value: float) -> float | None:
    """Returns None for NaN and infinities, which JSON lacks."""
    return float(value) if isfinite(value) else None


def capitalised(text: str) -> str:
    """Begins a text with a capital and leaves the rest as it is."""
    return text[:1].upper() + text[1:]


def in_unit(value: float | None, scale: float = 1.0, digits: int = 2) -> str:
    """Formats a number after scaling it; a dash for None and NaN."""
    scaled = number(value) * scale
    if not isfinite(scaled):
        return NOTHING
    text = f"{scaled:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text.replace("-", "−")


def in_cm(value_m: float | None, digits: int = 2) -> str:
    """Formats a length in cm, without the unit."""
    return in_unit(value_m, CM, digits)


def in_percent(fraction: float | None, digits: int = 0) -> str:
    """Formats a fraction in percent, without the sign."""
    return in_unit(fraction, 100.0, digits)


def all_in_cm(values_m: Sequence[float] | NDArray[np.float64], digits: int = 2) -> str:
    """Formats one length a segment in cm, for example ``4.24 / 2.58 / 3.84``."""
    return " / ".join(in_cm(float(value), digits) for value in values_m)


def listed(words: Sequence[str]) -> str:
    """Joins words as English does: ``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}" if words else "none"


def span(values: Sequence[float], scale: float = 1.0, digits: int = 0) -> str:
    """Formats the range of some numbers, ``12 to 40``, or the number if all are printed alike."""
    finite = [value for value in values if isfinite(value)]
    if not finite:
        return NOTHING
    low, high = in_unit(min(finite), scale, digits), in_unit(max(finite), scale, digits)
    return low if low == high else f"{low} to {high}"


def rhythm_words(score: RhythmScore) -> str:
    """Says what a rhythm is, for a table: ``1-2-3, 2.63 s``, ``disordered``, ``silent after 0.74 s``."""
    if score.verdict == "ordered":
        period = NOTHING if score.period_s is None else f"{score.period_s:.2f} s"
        if score.direction == 0:
            return f"{score.wave_fronts} fronts, {period}"
        n = max(score.order)
        segments = range(1, n + 1) if score.direction == 1 else range(n, 0, -1)
        fronts = "" if score.wave_fronts == 1 else f", {score.wave_fronts} fronts"
        return f"{'-'.join(map(str, segments))}{fronts}, {period}"
    if score.verdict == "silent":
        return "silent" if score.last_onset_s is None else f"silent after {score.last_onset_s:.2f} s"
    return score.verdict or "too short to tell"


_DARK, _LIGHT = "#1b2a6b", "white"
_RHYTHMS: dict[str, dict[str, Any]] = {
    "1-2-3": {"marker": "o", "markerfacecolor": _DARK},
    "other order": {"marker": "D", "markerfacecolor": "#9aa3c7"},
    "disordered": {"marker": "s", "markerfacecolor": _LIGHT},
    "silent": {"marker": "x", "markerfacecolor": _DARK},
    "too short": {"marker": "_", "markerfacecolor": _DARK},
}


def rhythm_kind(score: RhythmScore) -> str:
    """Names the kind of a rhythm, as the legend of `draw_rhythms` does."""
    if score.verdict == "ordered":
        return "1-2-3" if score.is_one_wave else "other order"
    return score.verdict or "too short"


def draw_rhythms(axes: Axes, rows: Sequence[tuple[str, Sequence[tuple[float, RhythmScore]]]]) -> list[Line2D]:
    """Draws the kind of rhythm over a parameter, one row a worm.

    Args:
        axes: The panel; its abscissa is the parameter.
        rows: Label and (parameter, score) pairs, from top to bottom.

    Returns:
        Handles for a legend of the kinds that occur.
    """
    seen = {rhythm_kind(score) for _, row in rows for _, score in row}
    for i, (_, row) in enumerate(rows):
        for x, score in row:
            axes.plot([x], [-i], **_rhythm_look(rhythm_kind(score)))
    axes.set_yticks([-i for i in range(len(rows))], [label for label, _ in rows])
    axes.set_ylim(0.6 - len(rows), 0.6)
    axes.grid(visible=False, axis="x")
    from matplotlib.lines import Line2D

    return [Line2D([], [], label=kind, **_rhythm_look(kind)) for kind in _RHYTHMS if kind in seen]


def _rhythm_look(kind: str) -> dict[str, Any]:
    return {"linestyle": "none", "color": _DARK, "markersize": 6.5, **_RHYTHMS[kind]}


def draw_segments(
    axes: Axes, parameter: Sequence[float], values: NDArray[np.float64], *, hollow: bool = False, **look: Any
) -> None:
    """Draws one line a segment over a parameter, in the segments' colours.

    Args:
        axes: The panel.
        parameter: Abscissae, shape ``(n,)``.
        values: Ordinates, shape ``(n, n_segments)``.
        hollow: Leaves the markers empty.
        **look: Marker and line style.
    """
    for column, color in zip(values.T, segment_colors(values.shape[1]), strict=True):
        style = {"markersize": 5.0, "markerfacecolor": "white" if hollow else color, **look}
        axes.plot(parameter, column, color=color, **style)


def segment_handles(n_segments: int) -> list[Line2D]:
    """Returns handles for a legend of the segments' colours."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=color, linewidth=3.0, label=f"segment {i + 1}")
        for i, color in enumerate(segment_colors(n_segments))
    ]


def look_handle(label: str, *, hollow: bool = False, color: str = "0.25", **look: Any) -> Line2D:
    """Returns a handle for a legend of markers and line styles."""
    from matplotlib.lines import Line2D

    return Line2D(
        [], [], color=color, markersize=5.0, markerfacecolor="white" if hollow else color, label=label, **look
    )


def legend_below(figure: Figure, handles: Sequence[Line2D], columns: int | None = None) -> None:
    """Puts a legend under all panels, where it covers nothing."""
    figure.legend(handles=handles, loc="outside lower center", ncols=columns or len(handles), columnspacing=1.4)


def parameter_ticks(axes: Axes, values: Sequence[float]) -> None:
    """Labels a logarithmic abscissa with the values themselves."""
    axes.set_xscale("log")
    axes.set_xticks(list(values), [f"{value:g}" for value in values])
    axes.minorticks_off()

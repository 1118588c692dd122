"""Plots of numbers and rhythms over what is varied, one look for all examinations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.draw import panel_title, segment_colors
from annelid_studies.riddle2023.examinations import words
from annelid_studies.riddle2023.examinations.design import WORMS, Reading, by_worm

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


def draw_over(
    axes: Axes,
    readings: Iterable[Reading],
    numbers: Callable[[Reading], Any],
    *,
    at: Callable[[Reading], float] = lambda one: one.value,
    hollow: bool = False,
    **style: Any,
) -> None:
    """Draws numbers of readings over what is varied, a line a worm; one number a segment makes a line a segment.

    Args:
        axes: The panel.
        readings: What was found.
        numbers: Reads a number, or one a segment, ``(n_segments,)``.
        at: Reads the abscissa.
        hollow: Leaves the markers empty.
        **style: Further properties of the lines, as matplotlib takes them.
    """
    for worm, own in by_worm(readings).items():
        x, y = [at(one) for one in own], np.array([numbers(one) for one in own], dtype=float)
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


def draw_rhythms(
    axes: Axes, readings: Iterable[Reading], *, at: Callable[[Reading], float] = lambda one: one.value
) -> list[Line2D]:
    """Draws the kind of rhythm over what is varied, one row a worm.

    Args:
        axes: The panel.
        readings: What was found; those without a closed loop are left out.
        at: Reads the abscissa.

    Returns:
        Handles for a legend of the kinds that occur.
    """
    rows = by_worm(one for one in readings if one.walk is not None)
    seen = set()
    for i, row in enumerate(rows.values()):
        for one in row:
            assert one.rhythm is not None
            seen.add(kind := words.kind(one.rhythm))
            axes.plot([at(one)], [-i], **_rhythm_look(kind))
    axes.set_yticks([-i for i in range(len(rows))], [worm.short for worm in rows])
    axes.set_ylim(0.6 - len(rows), 0.6)
    axes.grid(visible=False, axis="x")
    from matplotlib.lines import Line2D

    return [Line2D([], [], label=kind, **_rhythm_look(kind)) for kind in _RHYTHMS if kind in seen]


def _rhythm_look(kind: str) -> dict[str, Any]:
    return {"linestyle": "none", "color": _DARK, "markersize": 6.5, **_RHYTHMS[kind]}


def cross_out(axes: Axes, x: float, y: Any, size: float = 9.0) -> None:
    """Draws black crosses over the numbers of a run that does not walk 1-2-3."""
    axes.plot([x] * np.size(y), np.ravel(y), linestyle="none", marker="x", color="black", markersize=size)


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


def worm_handles() -> list[Line2D]:
    """Returns handles for a legend of the worms' looks."""
    return [look_handle(**worm.look) for worm in WORMS]


def look_handle(label: str, *, hollow: bool = False, color: Any = "0.25", **look: Any) -> Line2D:
    """Returns a handle for a legend of markers and line styles."""
    from matplotlib.lines import Line2D

    face = "white" if hollow else color
    return Line2D([], [], label=label, color=color, **{"markersize": 5.0, "markerfacecolor": face, **look})


def legend_below(figure: Figure, handles: Sequence[Line2D], columns: int | None = None) -> None:
    """Puts a legend under all panels, where it covers nothing."""
    figure.legend(handles=handles, loc="outside lower center", ncols=columns or len(handles), columnspacing=1.4)

"""Figures of experiments: loops of a load frame, a search for a gait, and values with error bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.draw.canvas import canvas, draw_lines, panel_title, save, save_both, segment_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MM = 1e3
_DOT, _BEST, _START, _ = segment_colors(4)
_WIDTHS_PT = (9.0, 5.0, 2.0)
_LEAST_SHARE = 0.02


def load_frame_figure(loops: Mapping[str, tuple[ArrayLike, ArrayLike]], stem: str | Path) -> Path:
    """Draws loops of a ring cable's force, N, over its displacement, m, ``(n,)`` each, the first in front.

    Writes ``<stem>.svg`` and ``.png``, as the two below, and returns the latter's path.

    Args:
        loops: Displacements and forces of each loop by its name.
        stem: Path of both files without a suffix.
    """
    with canvas(3.6) as figure:
        axes = figure.subplots()
        draw_lines(axes, {name: (_MM * np.asarray(x), y) for name, (x, y) in loops.items()}, markers=False)
        for order, line in enumerate(axes.lines):
            line.set(zorder=3 - order, linewidth=0.9 if order else 1.6)
        displacement = "displacement of the cable (mm); a third of it is the change of diameter"
        axes.set(xlabel=displacement, ylabel="force of the cable (N)")
        axes.legend(loc="upper left")
        return save_both(figure, stem)


def progress_figure(values: ArrayLike, label: str, more_is_better: bool, stem: str | Path) -> Path:
    """Draws the value of every trial of a search and the best so far over the trials' numbers.

    Args:
        values: The value of what the search starts from, then those of the trials, ``(1 + n,)``; NaN, a tick below, for
            what does not walk.
        label: Of the axis, with its unit.
        more_is_better: Whether the best value is the largest.
        stem: Path of both files without a suffix.
    """
    start, trials = np.split(np.asarray(values, dtype=float), [1])
    numbers, walks = np.arange(len(trials)), np.isfinite(trials)
    best = (np.fmax if more_is_better else np.fmin).accumulate(trials)
    with canvas(3.0) as figure:
        axes = figure.subplots()
        axes.plot(numbers, trials, "o", color=_DOT, markersize=3.5, label="a gait")
        axes.step(numbers, best, where="post", color=_BEST, label="best so far")
        if np.isfinite(start[0]):
            axes.axhline(start[0], color=_START, linestyle=(0, (4, 3)), label="start")
        if not walks.all():
            floor: Any = {"transform": axes.get_xaxis_transform(), "clip_on": False}
            axes.plot(numbers[~walks], 0.0 * numbers[~walks], "|", color="0.5", label="no gait", **floor)
        axes.set(xlabel="trial", ylabel=label)
        figure.legend(loc="outside upper center", ncols=4)
        return save_both(figure, stem)


def pareto_figure(
    values: ArrayLike, front: Mapping[str, Sequence[float]], labels: Sequence[str], more_is_better: bool, stem: Path
) -> Path:
    """Draws one objective against the other, with the front that no trial beats in both: steps over what was reached.

    Args:
        values: Both values of what the search starts from, then those of the trials, ``(1 + n, 2)``; NaN for what does
            not walk.
        front: Both values of the trials on the front by name.
        labels: Of both axes, with their units.
        more_is_better: Whether more of the first objective is better.
        stem: Path of both files without a suffix.
    """
    start, *trials = np.asarray(values, dtype=float)
    reached = sorted((*pair, name) for name, pair in front.items())
    with canvas(3.6) as figure:
        axes = figure.subplots()
        axes.plot(*np.reshape(trials, (-1, 2)).T, "o", color="0.65", markersize=3.5, label="a gait")
        steps = "steps-pre" if more_is_better else "steps-post"
        looks: Any = {"drawstyle": steps, "color": _BEST, "markersize": 4.5}
        x, y = ([point[i] for point in reached] for i in (0, 1))
        axes.plot(x, y, "o-", label="front, with numbers of trials", **looks)
        for at_x, at_y, name in reached:
            axes.annotate(name, (at_x, at_y), (5, -9), textcoords="offset points", fontsize=7, color=_BEST)
        axes.margins(0.08)
        axes.plot(*start, "D", color=_START, markersize=7, label="start")
        axes.set(xlabel=labels[0], ylabel=labels[1])
        figure.legend(loc="outside upper center", ncols=3)
        return save_both(figure, stem)


@dataclass(frozen=True, slots=True)
class Panel:
    """One panel of values side by side, ``(k,)``; None where there is none or where an error is not known."""

    title: str  # what they are, with their unit
    ticks: Sequence[str]  # the segment of each, empty if it is of the whole worm
    values: Sequence[float | None]
    errors: Mapping[str, Sequence[float | None]]  # by kind, innermost first, at most three


def uncertainty_figure(panels: Sequence[Panel], path: str | Path) -> Path:
    """Draws panels side by side, as wide as they have values.

    The bars of a value are nested: each ends at the root of the sum of the squares of its own error and of those inside
    of it, so the outermost end is the total.

    Args:
        panels: The panels.
        path: Path of the files without a suffix.
    """
    with canvas(3.4) as figure:
        widths = [1.0 + len(panel.values) for panel in panels]
        row = figure.subplots(1, len(panels), width_ratios=widths, squeeze=False)[0]
        for axes, panel in zip(row, panels, strict=True):
            _draw(axes, panel)
        handles, labels = row[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        return save(figure, path)


def _draw(axes: Axes, panel: Panel) -> None:
    places = np.arange(len(panel.values))
    values = np.array(panel.values, dtype=float)
    square, below = np.zeros(len(values)), np.zeros(len(values))
    styles = zip(_WIDTHS_PT, segment_colors(len(_WIDTHS_PT)), strict=True)
    for (kind, errors), (width, color) in zip(panel.errors.items(), styles, strict=False):
        square += np.nan_to_num(np.array(errors, dtype=float)) ** 2
        end = np.sqrt(square)
        axes.vlines(places, values - end, values - below, color=color, linewidth=width)
        axes.vlines(places, values + below, values + end, color=color, linewidth=width, label=kind)
        below = end
    axes.plot(places, values, "_", color="0.1", markersize=16.0, markeredgewidth=1.6, label="this run")
    panel_title(axes, panel.title)
    axes.set_xticks(places, [f"segment {tick}" if tick else "" for tick in panel.ticks])
    axes.set_xlim(-0.6, len(values) - 0.4)
    axes.grid(axis="x", visible=False)
    # Differences far below the values stay small.
    if np.isfinite(values).any():
        low, high = axes.get_ylim()
        lacking = _LEAST_SHARE * np.nanmax(np.abs(values)) - (high - low)
        if lacking > 0.0:
            axes.set_ylim(low - lacking / 2.0, high + lacking / 2.0)

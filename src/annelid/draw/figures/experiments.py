"""Figures of experiments: a search for a gait, and values with error bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.draw.canvas import canvas, panel_title, save, save_both, segment_colors
from annelid.protocols import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DOT, _BEST, _START, _ = segment_colors(4)
_WIDTHS_PT = (9.0, 5.0, 2.0)
_LEAST_SHARE = 0.02
_UNCERTAIN = {
    "elongation of each segment, mean of its sensors (cm)": ("elongation_mean_max_m.", 100.0),
    "period (s)": ("period_s", 1.0),
}
"""Panels of error bars: how the names of their quantities begin, and what a value is multiplied by."""
_NESTED = ("parameters", "time_step", "elements")


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


def uncertainty_figure(rows: Mapping[str, Mapping[str, Any]], path: str | Path) -> Path:
    """Draws elongations and period with their error bars side by side.

    The bars of a value are nested: each ends at the root of the sum of the squares of its own error and of those inside
    of it, so the outermost end is the total.

    Args:
        rows: Values and errors by quantity, as ``uncertainty.csv`` has them; None for what is not known.
        path: Path of the file.
    """
    panels = {title: [name for name in rows if name.startswith(start)] for title, (start, _) in _UNCERTAIN.items()}
    with canvas(3.4) as figure:
        widths = [1.0 + len(names) for names in panels.values()]
        row = figure.subplots(1, len(panels), width_ratios=widths, squeeze=False)[0]
        for axes, (title, names) in zip(row, panels.items(), strict=True):
            factor = _UNCERTAIN[title][1]
            columns = {
                column: factor * np.array([rows[name][column] for name in names], dtype=float)
                for column in ("value", *_NESTED)
            }
            _draw_nested(axes, columns.pop("value"), columns)
            panel_title(axes, title)
            segments = [name.partition(".")[2] for name in names]
            axes.set_xticks(range(len(names)), [f"segment {one}" if one else "" for one in segments])
        handles, labels = row[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        return save(figure, path)


def _draw_nested(axes: Axes, values: Array, errors: Mapping[str, Array]) -> None:
    """Draws values, ``(k,)``, and their errors by kind, the innermost first; NaN for what is not known."""
    places = np.arange(len(values))
    square = np.zeros(len(values))
    styles = zip(_WIDTHS_PT, segment_colors(len(_WIDTHS_PT)), strict=True)
    for (kind, error), (width, color) in zip(errors.items(), styles, strict=True):
        square += np.nan_to_num(error) ** 2
        end, look = np.sqrt(square), {"color": color, "linewidth": width, "zorder": 2.0 + 0.1 * width}
        axes.vlines(places, values - end, values + end, label=kind.replace("_", " "), **look)
    axes.plot(places, values, "_", color="0.1", markersize=16.0, markeredgewidth=1.6, label="this run", zorder=4.0)
    axes.set_xlim(-0.6, len(values) - 0.4)
    axes.grid(axis="x", visible=False)
    # Differences far below the values stay small.
    if np.isfinite(values).any():
        low, high = axes.get_ylim()
        lacking = _LEAST_SHARE * np.nanmax(np.abs(values)) - (high - low)
        if lacking > 0.0:
            axes.set_ylim(low - lacking / 2.0, high + lacking / 2.0)

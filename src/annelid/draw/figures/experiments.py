"""Figures of experiments: loops of a load frame, a search for a gait, and values with error bars."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from annelid.draw.canvas import canvas, draw_lines, panel_title, save, save_both, segment_colors
from annelid.protocols import Array

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


@dataclass(frozen=True)
class Mark:
    """One trial of a search for a gait."""

    number: int  # negative for the gait that the search starts from
    values: tuple[float, ...]  # of each objective
    walks: bool


def progress_figure(marks: Sequence[Mark], label: str, more_is_better: bool, stem: str | Path) -> Path:
    """Draws every trial's value and the best so far over the trials' numbers; what does not walk is a tick below.

    Args:
        marks: The trials, in their order.
        label: Of the axis, with its unit.
        more_is_better: Whether the best value is the largest.
        stem: Path of both files without a suffix.
    """
    walking = [mark for mark in marks if mark.walks and mark.number >= 0]
    failed = [mark.number for mark in marks if not mark.walks and mark.number >= 0]
    numbers = np.array([mark.number for mark in walking])
    values = np.array([mark.values[0] for mark in walking])
    with canvas(3.0) as figure:
        axes = figure.subplots()
        axes.plot(numbers, values, "o", color=_DOT, markersize=3.5, label="a gait")
        if walking:
            best = np.maximum.accumulate(values) if more_is_better else np.minimum.accumulate(values)
            axes.step(numbers, best, where="post", color=_BEST, label="best so far")
        for mark in marks:
            if mark.number < 0 and mark.walks:
                axes.axhline(mark.values[0], color=_START, linestyle=(0, (4, 3)), label="start")
        if failed:
            floor = axes.get_xaxis_transform()
            axes.plot(failed, np.zeros(len(failed)), "|", color="0.5", transform=floor, clip_on=False, label="no gait")
        axes.set(xlabel="trial", ylabel=label)
        figure.legend(loc="outside upper center", ncols=4)
        return save_both(figure, stem)


def pareto_figure(
    marks: Sequence[Mark], front: Collection[int], labels: tuple[str, str], more_is_better: bool, stem: str | Path
) -> Path:
    """Draws one objective against the other, with the front that no trial beats in both: steps over what was reached.

    ``front`` has the numbers of the trials on it; of the first objective more or less is better.
    """
    walking = [mark for mark in marks if mark.walks]
    on_front = sorted((mark for mark in walking if mark.number in front), key=lambda mark: mark.values)
    with canvas(3.6) as figure:
        axes = figure.subplots()
        tuned, begun = (_columns(m for m in walking if (m.number >= 0) is known) for known in (True, False))
        axes.plot(*tuned, "o", color="0.65", markersize=3.5, label="a gait")
        steps = "steps-pre" if more_is_better else "steps-post"
        reached = _columns(on_front)
        axes.plot(*reached, "o-", drawstyle=steps, color=_BEST, markersize=4.5, label="front, with numbers of trials")
        for mark, x, y in zip(on_front, *reached, strict=True):
            axes.annotate(str(mark.number), (x, y), (5, -9), textcoords="offset points", fontsize=7, color=_BEST)
        axes.margins(0.08)
        axes.plot(*begun, "D", color=_START, markersize=7, label="start")
        axes.set(xlabel=labels[0], ylabel=labels[1])
        figure.legend(loc="outside upper center", ncols=3)
        return save_both(figure, stem)


def _columns(marks: Iterable[Mark]) -> Array:
    return np.reshape([mark.values[:2] for mark in marks], (-1, 2)).T


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

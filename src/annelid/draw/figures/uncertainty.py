"""Values with error bars that are nested by their origin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.draw.canvas import canvas, save
from annelid.draw.style import panel_title, segment_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTHS_PT = (9.0, 5.0, 2.0)
_LEAST_SHARE = 0.02


@dataclass(frozen=True, slots=True)
class Panel:
    """One panel: a few values side by side.

    Attributes:
        title: What they are, with their unit.
        ticks: What stands below each, ``(k,)``.
        values: ``(k,)``; None where there is none.
        errors: By kind, innermost first, at most three: ``(k,)`` each; None where one is not known.
    """

    title: str
    ticks: Sequence[str]
    values: Sequence[float | None]
    errors: Mapping[str, Sequence[float | None]]


def uncertainty_figure(panels: Sequence[Panel], path: str | Path) -> Path:
    """Draws panels side by side, as wide as they have values.

    The bars of a value are nested: each ends at the root of the sum of the squares of its own error and of those inside
    of it, so the outermost end is the total.

    Args:
        panels: The panels.
        path: The picture.

    Returns:
        Its path.

    Raises:
        RunFileError: The file cannot be written.
    """
    with canvas(3.4) as figure:
        widths = [1.0 + len(panel.values) for panel in panels]
        row = np.atleast_1d(figure.subplots(1, len(panels), width_ratios=widths)).tolist()
        for axes, panel in zip(row, panels, strict=True):
            _draw(axes, panel)
        handles, labels = row[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        return save(figure, path)


def _draw(axes: Axes, panel: Panel) -> None:
    places = np.arange(len(panel.values))
    values = np.array(panel.values, dtype=float)
    square = np.zeros(len(values))
    colors = segment_colors(len(_WIDTHS_PT))
    below = np.zeros(len(values))
    for (kind, errors), width, color in zip(panel.errors.items(), _WIDTHS_PT, colors, strict=False):
        square += np.nan_to_num(np.array(errors, dtype=float)) ** 2
        end = np.sqrt(square)
        axes.vlines(places, values - end, values - below, color=color, linewidth=width)
        axes.vlines(places, values + below, values + end, color=color, linewidth=width, label=kind)
        below = end
    axes.plot(places, values, "_", color="0.1", markersize=16.0, markeredgewidth=1.6, label="this run")
    panel_title(axes, panel.title)
    axes.set_xticks(places, panel.ticks)
    axes.set_xlim(-0.6, len(values) - 0.4)
    axes.grid(axis="x", visible=False)
    _keep_narrow_bars_narrow(axes, values)


def _keep_narrow_bars_narrow(axes: Axes, values: np.ndarray) -> None:
    """Keeps the axis from blowing up differences far below the values."""
    if not np.isfinite(values).any():
        return
    low, high = axes.get_ylim()
    lacking = _LEAST_SHARE * np.nanmax(np.abs(values)) - (high - low)
    if lacking > 0.0:
        axes.set_ylim(low - lacking / 2.0, high + lacking / 2.0)

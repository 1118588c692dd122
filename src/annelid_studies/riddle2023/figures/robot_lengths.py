"""Figure 9: how far each segment of the robot elongates, and of the models of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from annelid.analysis import PAPER_ELONGATION_M, ROBOT_ELONGATION_M
from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid_studies.riddle2023.figures import caption

_CM = 100.0
_BAR = 0.8
_LABELS_WIDTH = 84
"""Characters of all labels side by side."""


def figure_9_robot_lengths(series: Mapping[str, Sequence[float]], stem: Path) -> str:
    """Draws the elongations, m, of the robot, of the paper's model and of simulations as groups of bars.

    Returns the caption.
    """
    groups = {"robot (Wang)": ROBOT_ELONGATION_M, "the paper's model": PAPER_ELONGATION_M, **series}
    most = max(groups.values(), key=len)
    with canvas(4.6) as figure:
        absolute, relative = figure.subplots(2, 1, sharex=True)
        _draw_bars(absolute, [_CM * np.asarray(values) for values in groups.values()], len(most))
        _draw_bars(relative, [np.divide(values, values[0]) for values in groups.values()], len(most))
        panel_title(absolute, "a) largest elongation")
        absolute.set_ylabel("elongation (cm)")
        panel_title(relative, "b) the same relative to segment 1")
        relative.set_ylabel("relative elongation (1)")
        relative.set_xticks(range(len(groups)), [fill(label, _LABELS_WIDTH // len(groups)) for label in groups])
        handles = absolute.containers[list(groups.values()).index(most)]
        names = [f"segment {segment}" for segment in range(1, len(most) + 1)]
        room = {"columnspacing": 1.2, "handlelength": 1.2, "borderaxespad": 0.1}
        absolute.legend(list(handles), names, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(most), **room)
        save_both(figure, stem)
    return caption(9)


def _draw_bars(axes: Axes, groups: Sequence[ArrayLike], n_segments: int) -> None:
    """Draws one group of bars a label, one bar a segment, with its number above."""
    width, colors = _BAR / n_segments, segment_colors(n_segments)
    for center, values in enumerate(map(np.asarray, groups)):
        places = center + width * (np.arange(len(values)) - (len(values) - 1) / 2)
        bars = axes.bar(places, values, 0.92 * width, color=colors[: len(values)], edgecolor="0.1", linewidth=0.6)
        for label in axes.bar_label(bars, labels=[f"{value:.2f}" for value in values], padding=2, fontsize=6.5):
            label.set_bbox({"facecolor": "w", "edgecolor": "none", "pad": 0.2})
    axes.grid(axis="x", visible=False)
    axes.tick_params(axis="x", length=0)
    axes.margins(y=0.12)

"""The figure of an identification: every experiment beside its fit, and how the parameters' errors hang together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from annelid.draw import canvas, panel_title, plain, save_both, segment_colors
from annelid.protocols import Array


@dataclass(frozen=True)
class Drawn:
    """One experiment.

    Attributes:
        name: Its name.
        labels: Of the two axes.
        series: Which stretch each point belongs to, ``(n,)``.
        at: Where the points were measured, ``(n,)``.
        measured: What was measured, ``(n,)``.
        fitted: What is predicted, ``(n,)``.
        width: Half of the interval of a point, ``(n,)``.
        held: Place, value and prediction of points that were held out, ``(m,)`` each.
    """

    name: str
    labels: tuple[str, str]
    series: np.ndarray
    at: Array
    measured: Array
    fitted: Array
    width: Array
    held: tuple[Array, Array, Array]


def identify_figure(drawn: Sequence[Drawn], names: Sequence[str], correlation: Array, stem: str | Path) -> Path:
    """Draws each experiment with the band that 95 % of its points should lie in, and the correlations.

    Writes ``<stem>.svg`` and ``.png`` and returns the latter's path.
    """
    columns = min(len(drawn) + 1, 3)
    rows = -(-(len(drawn) + 1) // columns)
    dark, light, other, _ = segment_colors(4)
    with canvas(2.9 * rows) as figure:
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, one in zip(panels, drawn, strict=False):
            for series in np.unique(one.series):
                mine = np.flatnonzero(one.series == series)
                mine = mine[np.argsort(one.at[mine])]
                band = one.fitted[mine] - one.width[mine], one.fitted[mine] + one.width[mine]
                axes.fill_between(one.at[mine], *band, color=light, alpha=0.25, linewidth=0)
                axes.plot(one.at[mine], one.fitted[mine], color=dark, linewidth=1.2)
            axes.plot(one.at, one.measured, ".", color="0.3", markersize=3.0)
            if len(one.held[0]):
                axes.plot(one.held[0], one.held[1], "x", color=other, markersize=4.0)
            axes.set(xlabel=one.labels[0], ylabel=one.labels[1])
            panel_title(axes, one.name)
        axes = panels[len(drawn)]
        axes.imshow(correlation, cmap="RdBu_r", vmin=-1, vmax=1)
        for i, row in enumerate(correlation):
            for k, value in enumerate(row):
                color = "w" if abs(value) > 0.6 else "0.1"
                axes.text(k, i, f"{value:+.1f}", ha="center", va="center", fontsize=6, color=color)
        words = [plain(name.replace("_", " ")) for name in names]
        axes.set_xticks(range(len(names)), words, rotation=45, ha="right")
        axes.set_yticks(range(len(names)), words)
        axes.grid(visible=False)
        panel_title(axes, "correlation of the errors")
        for empty in panels[len(drawn) + 1 :]:
            empty.set_axis_off()
        return save_both(figure, stem)

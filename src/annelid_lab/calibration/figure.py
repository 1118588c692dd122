"""The figure of an identification: every experiment beside its fit, and how the parameters' errors hang together."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from annelid.draw import canvas, panel_title, plain, save_both, segment_colors
from annelid_lab.calibration.fit import Fit
from annelid_lab.calibration.intervals import Intervals, band


def identify_figure(fit: Fit, known: Intervals, stem: str | Path) -> Path:
    """Draws each experiment with the band that 95 % of its points should lie in, and the correlations.

    Writes ``<stem>.svg`` and ``.png`` and returns the latter's path.
    """
    n = len(fit.parts)
    columns = min(n + 1, 3)
    rows = -(-(n + 1) // columns)
    dark, light, other, _ = segment_colors(4)
    with canvas(2.9 * rows) as figure:
        panels = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, part in zip(panels, fit.parts, strict=False):
            data, width = part.data, band(fit, part, part.data, part.jacobian, np.diag(part.scatter))
            for series in np.unique(data.series):
                mine = np.flatnonzero(data.series == series)
                mine = mine[np.argsort(data.at[mine])]
                ends = part.fitted[mine] - width[mine], part.fitted[mine] + width[mine]
                axes.fill_between(data.at[mine], *ends, color=light, alpha=0.25, linewidth=0)
                axes.plot(data.at[mine], part.fitted[mine], color=dark, linewidth=1.2)
            axes.plot(data.at, data.values, ".", color="0.3", markersize=3.0)
            if len(part.held.at):
                axes.plot(part.held.at, part.held.values, "x", color=other, markersize=4.0)
            axes.set(xlabel=data.labels[0], ylabel=data.labels[1])
            panel_title(axes, part.experiment.name)
        axes = panels[n]
        axes.imshow(known.correlation, cmap="RdBu_r", vmin=-1, vmax=1)
        for i, row in enumerate(known.correlation):
            for k, value in enumerate(row):
                color = "w" if abs(value) > 0.6 else "0.1"
                axes.text(k, i, f"{value:+.1f}", ha="center", va="center", fontsize=6, color=color)
        words = [plain(name.replace("_", " ")) for name in fit.names]
        axes.set_xticks(range(len(fit.names)), words, rotation=45, ha="right")
        axes.set_yticks(range(len(fit.names)), words)
        axes.grid(visible=False)
        panel_title(axes, "correlation of the errors")
        for empty in panels[n + 1 :]:
            empty.set_axis_off()
        return save_both(figure, stem)

"""The figure of an identification: experiments beside their fits, misfits over parameters, and correlations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.draw import canvas, panel_title, plain, save_both, segment_colors
from annelid_lab.calibration.base import shown_in
from annelid_lab.calibration.fit import Errors, Fit
from annelid_lab.calibration.intervals import Intervals, band

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def identify_figure(fit: Fit, known: Intervals, stem: str | Path) -> Path:
    """Draws each experiment with the band that 95 % of its points should lie in, misfits and correlations.

    Writes ``<stem>.svg`` and ``.png`` and returns the latter's path.
    """
    n = len(fit.parts)
    last = n + len(fit.names)
    columns = min(last + 1, 3)
    rows = -(-(last + 1) // columns)
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
                width = band(fit, part, part.held, part.held_jacobian, part.held_scatter)
                axes.errorbar(part.held.at, part.held_fitted, width, fmt="none", ecolor=other, elinewidth=0.6)
                axes.plot(part.held.at, part.held.values, "x", color=other, markersize=4.0)
            axes.set(xlabel=data.labels[0], ylabel=data.labels[1])
            panel_title(axes, part.experiment.name)
        _draw_misfits(fit, known, list(panels[n:last]))
        axes = panels[last]
        axes.imshow(known.correlation, cmap="RdBu_r", vmin=-1, vmax=1)
        for i, row in enumerate(known.correlation):
            for k, value in enumerate(row):
                color = "w" if abs(value) > 0.6 else "0.1"
                axes.text(k, i, f"{value:+.1f}", ha="center", va="center", fontsize=6, color=color)
        words = [plain(name.replace("_", " ")) for name in fit.names]
        axes.set_xticks(range(len(fit.names)), words, rotation=45, ha="right")
        axes.set_yticks(range(len(fit.names)), words)
        axes.grid(visible=False)
        panel_title(axes, "correlations")
        for empty in panels[last + 1 :]:
            empty.set_axis_off()
        return save_both(figure, stem)


def _draw_misfits(fit: Fit, known: Intervals, panels: Sequence[Axes]) -> None:
    """Draws how far every worm that was computed lies from the data over each parameter, with its interval."""
    model = fit.emulator.model
    errors = Errors(model, [part.noise for part in fit.parts])
    points = sum(len(part.data.at) for part in fit.parts)
    misfits = [float(np.sqrt(errors.misfit(one) / points)) for one in model.tried]
    dark, light = segment_colors(2)
    for i, (name, axes) in enumerate(zip(fit.names, panels, strict=True)):
        factor, unit = shown_in(fit.study.parameters[name].unit, fit.values[name])
        axes.axvspan(*(known.profile[i] / factor), color=light, alpha=0.4, linewidth=0)
        axes.plot([np.exp(one.logs[i]) / factor for one in model.tried], misfits, ".", color=dark, markersize=3.0)
        axes.set(
            xlabel=plain(f"{name.replace('_', ' ')} ({unit.strip() or '1'})"), ylabel="rms over noise", yscale="log"
        )
        panel_title(axes, "misfit of worms")

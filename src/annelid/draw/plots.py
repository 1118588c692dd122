"""Figures of a run, drawn with matplotlib's object interface; no window, no global state."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.analysis.paper import published
from annelid.analysis.rhythm import CONTRACTED, segment_activation
from annelid.body.worm import WormBody
from annelid.draw.canvas import canvas, save
from annelid.draw.figures import RUN_FIGURES
from annelid.draw.style import panel_title, plain, segment_colors
from annelid.errors import RunFileError
from annelid.output import with_suffix

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from annelid.simulation.runfile import Run

_CM = 100.0
PLOT_SUFFIXES = (".png", ".pdf", ".svg")
PUBLISHED = (0, (7.0, 3.0))
"""Dashes of a published level."""


def figure7(run: Run, path: str | Path) -> Path:
    """Draws the counterpart of the paper's Fig. 7: membrane potentials and stretch sensor lengths.

    Three panels over time: potentials of the half-centres (contraction neurons solid, expansion neurons
    dashed), the phases in which each segment contracts, and the stretch sensors' lengths (thick: mean of the
    segment's sensors, thin: the first of them, dotted: rest length, dashed: where the published elongation ends, if
    there is one). One colour a segment.

    Args:
        run: The run.
        path: File to write; its suffix chooses the format (``.png``, ``.pdf``, ``.svg``); a name without
            one becomes a ``.png``.

    Returns:
        The path written.

    Raises:
        RunFileError: The run holds no samples, or none of these signals; or the file has another suffix or cannot
            be written.
    """
    path = plot_path(path)
    data = run.data
    if data.sizes.get("time", 0) < 2 or "stretch_length" not in data:
        raise RunFileError(f"{run.path} holds too little to plot: fewer than two samples of stretch lengths")
    n_segments = run.config.body.n_segments
    colors = segment_colors(n_segments)
    phase_height = 0.35 + 0.13 * n_segments
    with canvas(5.0 + phase_height) as figure:
        neural, phases, lengths = figure.subplots(3, 1, sharex=True, height_ratios=[2.5, phase_height, 2.5])
        _potentials(neural, run, colors)
        _phases(phases, run, colors)
        _lengths(lengths, run, colors)
        lengths.set_xlabel("time (s)")
        lengths.set_xlim(float(data["time"].values[0]), float(data["time"].values[-1]))
        title = plain(f"{run.config.name}: {n_segments} segments")
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, weight="bold")
        figure.align_ylabels()
        return save(figure, path)


RUN_FIGURES.add("figure7", figure7)


def plot_path(path: str | Path) -> Path:
    """Returns the file that `figure7` writes for a name: one without a suffix becomes a ``.png``.

    Raises:
        RunFileError: Another suffix, or a folder.
    """
    return with_suffix(path, PLOT_SUFFIXES, "a figure", default=".png")


def _potentials(axes: Axes, run: Run, colors: list) -> None:
    """Potentials of each segment's half-centre, found by the neurons' names."""
    data = run.data
    panel_title(axes, "Half-centres")
    axes.set_ylabel("membrane potential\nabove rest (mV)")
    if "potential" not in data:
        axes.text(0.5, 0.5, "no neurons recorded", transform=axes.transAxes, ha="center", color="0.4")
        return
    names = [str(name) for name in data["neuron"].values]
    time = data["time"].values
    for i, color in enumerate(colors):
        for kind, style in (("contraction", "-"), ("expansion", "--")):
            if f"{kind}_{i + 1}" in names:
                trace = data["potential"].values[:, names.index(f"{kind}_{i + 1}")]
                axes.plot(time, trace, style, color=color, linewidth=1.5 if style == "-" else 1.0)
    _legend(
        axes,
        [("0.25", "-", 1.5, "contraction"), ("0.25", "--", 1.0, "expansion"), *_segment_entries(colors)],
    )


def _phases(axes: Axes, run: Run, colors: list) -> None:
    """One bar for every stretch of time in which a segment is contracted, one row a segment."""
    data = run.data
    n_segments = len(colors)
    panel_title(axes, "Contraction (activation above 0.5)")
    axes.set_ylabel("segment")
    axes.set_ylim(n_segments + 0.6, 0.4)
    step = max(1, -(-n_segments // 12))
    axes.set_yticks(range(1, n_segments + 1, step))
    axes.grid(visible=False, axis="y")
    if "activation" not in data:
        return
    time = data["time"].values
    activation = segment_activation(data["activation"].values, n_segments)
    for i, color in enumerate(colors):
        contracted = np.concatenate(([False], activation[:, i] > CONTRACTED, [False]))
        edges = np.flatnonzero(np.diff(contracted.astype(int)))
        begins, ends = edges[::2], np.minimum(edges[1::2], len(time) - 1)
        bars = [(float(time[a]), float(time[b] - time[a])) for a, b in zip(begins, ends, strict=True)]
        axes.broken_barh(bars, (i + 0.65, 0.7), facecolors=color)


def _lengths(axes: Axes, run: Run, colors: list) -> None:
    """Lengths of the stretch sensors: thick their mean, thin the first of them, dotted at rest, dashed as published."""
    data = run.data
    panel_title(axes, "Stretch sensors")
    axes.set_ylabel("length (cm)")
    time = data["time"].values
    stretch = _CM * data["stretch_length"].values
    rest = _CM * data["stretch_rest_length"].values
    several = stretch.shape[2] > 1
    for i, color in enumerate(colors):
        if several:
            axes.plot(time, stretch[:, i, 0], "-", color=color, linewidth=0.7, alpha=0.9)
        axes.plot(time, stretch[:, i].mean(axis=1), "-", color=color, linewidth=2.0)
    axes.axhline(float(rest.mean()), color="0.35", linestyle=":", linewidth=1.0)
    entries: list[tuple] = [("0.25", "-", 2.0, "mean of its sensors" if several else "sensor")]
    if several and isinstance(run.config.body, WormBody):
        entries.append(("0.25", "-", 0.7, run.config.body.springs.first_sensor))
    entries.append(("0.35", ":", 1.0, "rest length"))
    levels = _published_levels(run)
    if levels:
        _draw_levels(axes, levels, colors)
        entries.append(("0.25", PUBLISHED, 0.9, "as published"))
    _legend(axes, entries)


def _published_levels(run: Run) -> list[float]:
    """Where each segment's published elongation ends, cm: above the lowest length where it is peak to peak, or rest."""
    beside = published(run.config)
    starts = {
        "elongation_first_helix_pp_m": run.data["stretch_length"].values[:, :, 0].min(axis=0),
        "elongation_mean_max_m": run.data["stretch_rest_length"].values.mean(axis=1),
    }
    for field, start in starts.items():
        if field in beside:
            return (_CM * (start + np.asarray(beside[field].value))).tolist()
    return []


def _draw_levels(axes: Axes, levels: list[float], colors: list) -> None:
    """Draws a line at each level, and names its segment right of the panel, in turn above and below the line."""
    for rank, i in enumerate(np.argsort(levels)[::-1]):
        axes.axhline(levels[i], color=colors[i], linestyle=PUBLISHED, linewidth=0.9)
        axes.annotate(
            f"paper, {i + 1}",
            (1.0, levels[i]),
            xycoords=("axes fraction", "data"),
            xytext=(3, 0),
            textcoords="offset points",
            va="top" if rank % 2 else "bottom",
            fontsize=7.0,
            color="0.25",
        )


def _segment_entries(colors: list) -> list[tuple]:
    """Legend entries of the segments, only the ends and the middle where there are many."""
    n = len(colors)
    shown = range(n) if n <= 3 else (0, n // 2, n - 1)
    return [(colors[i], "-", 3.0, f"segment {i + 1}") for i in shown]


def _legend(axes: Axes, entries: Sequence[tuple]) -> None:
    """Puts a one-line legend above the panel, so that it never covers a curve."""
    from matplotlib.lines import Line2D

    axes.legend(
        handles=[Line2D([], [], color=c, linestyle=s, linewidth=w, label=label) for c, s, w, label in entries],
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(entries),
        columnspacing=1.0,
        handlelength=1.8,
        borderaxespad=0.1,
    )

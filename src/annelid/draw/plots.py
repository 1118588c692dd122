"""Figures of a run, drawn with matplotlib's object interface; no window, no global state."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.analysis.paper import published
from annelid.analysis.rhythm import CONTRACTED, segment_activation, stretches
from annelid.body.worm import WormBody
from annelid.draw.canvas import canvas, line_entries, panel_title, plain, save, segment_colors
from annelid.draw.figures import RUN_FIGURES
from annelid.errors import RunFileError
from annelid.output import with_suffix
from annelid.protocols import Array
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CM = 100.0
PLOT_SUFFIXES = (".png", ".pdf", ".svg")
PUBLISHED = (0, (7.0, 3.0))  # dashes of a published level


def figure7(run: Run, path: str | Path) -> Path:
    """Draws the counterpart of the paper's Fig. 7: membrane potentials and stretch sensor lengths.

    Three panels over time, one colour per segment: potentials of the half-centres (contraction neurons solid, expansion
    neurons dashed), the phases in which each segment contracts, and the stretch sensors' lengths (thick: mean of the
    segment's sensors, thin: the first of them, dotted: rest length, dashed: where the published elongation ends, if
    there is one).

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
        lengths.set(xlabel="time (s)", xlim=data["time"].values[[0, -1]])
        title = plain(f"{run.config.name}: {n_segments} segments")
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, weight="bold")
        figure.align_ylabels()
        return save(figure, path)


RUN_FIGURES.add("figure7", figure7)


def plot_path(path: str | Path) -> Path:
    """Returns the file that `figure7` writes for a name, a ``.png`` without a suffix; refuses other suffixes."""
    return with_suffix(path, PLOT_SUFFIXES, "a figure", default=".png")


def neuron_potentials(run: Run, role: str) -> dict[int, Array]:
    """Returns the potential of each segment's neuron of a role, mV, ``(n_times,)``, by the segment (from 1)."""
    if "potential" not in run.data:
        return {}
    names = [str(name) for name in run.data["neuron"].values]
    traces = dict(zip(names, run.data["potential"].values.T, strict=True))
    segments = range(1, run.config.body.n_segments + 1)
    return {segment: traces[f"{role}_{segment}"] for segment in segments if f"{role}_{segment}" in traces}


def _potentials(axes: Axes, run: Run, colors: list) -> None:
    panel_title(axes, "Half-centres")
    axes.set_ylabel("membrane potential\nabove rest (mV)")
    if "potential" not in run.data:
        axes.text(0.5, 0.5, "no neurons recorded", transform=axes.transAxes, ha="center", color="0.4")
        return
    styles = {"contraction": ("-", 1.5), "expansion": ("--", 1.0)}
    of_roles = {role: neuron_potentials(run, role) for role in styles}
    for segment, color in enumerate(colors, start=1):
        for role, (style, width) in styles.items():
            if segment in of_roles[role]:
                axes.plot(run.data["time"].values, of_roles[role][segment], style, color=color, linewidth=width)
    n = len(colors)
    # Of many segments only the ends and the middle.
    shown = range(n) if n <= 3 else (0, n // 2, n - 1)
    entries = [("0.25", *look, role) for role, look in styles.items()]
    _legend(axes, [*entries, *((colors[i], "-", 3.0, f"segment {i + 1}") for i in shown)])


def _phases(axes: Axes, run: Run, colors: list) -> None:
    """One bar for every stretch of time in which a segment is contracted, one row per segment."""
    data = run.data
    n_segments = len(colors)
    panel_title(axes, "Contraction (activation above 0.5)")
    step = max(1, -(-n_segments // 12))
    axes.set(ylabel="segment", ylim=(n_segments + 0.6, 0.4), yticks=range(1, n_segments + 1, step))
    axes.grid(visible=False, axis="y")
    if "activation" not in data:
        return
    time = data["time"].values
    activation = segment_activation(data["activation"].values, n_segments)
    for i, color in enumerate(colors):
        spans = (time[[a, min(b, len(time) - 1)]].tolist() for a, b in stretches(activation[:, i] > CONTRACTED))
        axes.broken_barh([(a, b - a) for a, b in spans], (i + 0.65, 0.7), facecolors=color)


def _lengths(axes: Axes, run: Run, colors: list) -> None:
    data = run.data
    panel_title(axes, "Stretch sensors")
    axes.set_ylabel("length (cm)")
    time = data["time"].values
    stretch = _CM * data["stretch_length"].values
    several = stretch.shape[2] > 1
    for i, color in enumerate(colors):
        if several:
            axes.plot(time, stretch[:, i, 0], "-", color=color, linewidth=0.7, alpha=0.9)
        axes.plot(time, stretch[:, i].mean(axis=1), "-", color=color, linewidth=2.0)
    axes.axhline(float((_CM * data["stretch_rest_length"].values).mean()), color="0.35", linestyle=":", linewidth=1.0)
    entries: list[tuple] = [("0.25", "-", 2.0, "mean of its sensors" if several else "sensor")]
    if several and isinstance(run.config.body, WormBody):
        entries.append(("0.25", "-", 0.7, run.config.body.springs.first_sensor))
    entries.append(("0.35", ":", 1.0, "rest length"))
    levels = _published_levels(run)
    # Each level's segment is named right of the panel, in turn above and below the line.
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
    if levels:
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


def _legend(axes: Axes, entries: list[tuple]) -> None:
    """Puts a one-line legend above the panel, so that it never covers a curve."""
    axes.legend(
        handles=line_entries(entries),
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(entries),
        columnspacing=1.0,
        handlelength=1.8,
        borderaxespad=0.1,
    )

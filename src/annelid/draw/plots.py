"""Figures of a run, drawn with matplotlib's object interface; no window, no global state."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.analysis.paper import changed_fields, published
from annelid.analysis.rhythm import CONTRACTED, segment_activation, stretches
from annelid.config.fidelity import RESOLUTION
from annelid.draw.canvas import canvas, evenly, line_entries, line_looks, panel_title, plain, save
from annelid.draw.figures import RUN_FIGURES
from annelid.errors import RunFileError
from annelid.output import with_suffix
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CM = 100.0
_DASH_PT = 5.0  # of a published level, in line widths
_SAME = 0.05  # levels nearer than this share of the panel's height are named together
_MOST_NAMED, _NAMES_A_ROW = 16, 8  # segments in the legend: of more, as many from the first to the last
_THICK, _THIN = 1.8, 0.8
PLOT_SUFFIXES = (".png", ".pdf", ".svg")


def figure7(run: Run, path: str | Path) -> Path:
    """Draws the counterpart of the paper's Fig. 7: membrane potentials and stretch sensor lengths.

    Three panels over time, one colour and line style per segment: potentials of the half-centres (contraction neurons
    thick, expansion neurons thin) or, without half-centres, of all neurons; the phases in which each segment
    contracts; and the stretch sensors' lengths (thick: mean of the segment's sensors, thin: the first of them).
    Horizontal lines are the rest length and, where there are published elongations, the lengths at which these end.

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
    looks = line_looks(n_segments)
    phase_height = 0.35 + 0.13 * n_segments
    with canvas(5.3 + phase_height) as figure:
        neural, phases, lengths = figure.subplots(3, 1, sharex=True, height_ratios=[2.5, phase_height, 2.5])
        _potentials(neural, run, looks)
        _phases(phases, run, looks)
        _lengths(lengths, run, looks)
        lengths.set(xlabel="time (s)", xlim=data["time"].values[[0, -1]])
        _name_segments(figure, looks, f"{run.config.name}: {n_segments} segments")
        figure.align_ylabels()
        return save(figure, path)


RUN_FIGURES.add("figure7", figure7)


def plot_path(path: str | Path) -> Path:
    """Returns the file that `figure7` writes for a name, a ``.png`` without a suffix; refuses other suffixes."""
    return with_suffix(path, PLOT_SUFFIXES, "a figure", default=".png")


def _potentials(axes: Axes, run: Run, looks: list[dict]) -> None:
    axes.set_ylabel("membrane potential\nabove rest (mV)")
    if "potential" not in run.data or not run.data.sizes["neuron"]:
        panel_title(axes, "Neurons")
        axes.text(0.5, 0.5, "no neurons recorded", transform=axes.transAxes, ha="center", color="0.4")
        return
    traces, widths = run.data["potential"], {"contraction": _THICK, "expansion": _THIN}
    names, drawn = set(traces["neuron"].values), []
    for role, width in widths.items():
        for segment, look in enumerate(looks, start=1):
            if (name := f"{role}_{segment}") in names:
                axes.plot(run.data["time"].values, traces.sel(neuron=name).values, **look, linewidth=width)
                drawn.append(role)
    if not drawn:
        _all_potentials(axes, run)
        return
    panel_title(axes, "Half-centres")
    _legend(axes, [("0.25", "-", widths[role], f"{role} neuron") for role in dict.fromkeys(drawn)])


def _all_potentials(axes: Axes, run: Run) -> None:
    """Draws the neurons of a network that has no half-centres, the first of many, with their names."""
    potential = run.data["potential"].isel(neuron=slice(_MOST_NAMED))
    n, n_all = potential.sizes["neuron"], run.data.sizes["neuron"]
    panel_title(axes, "Neurons" if n == n_all else f"Neurons, the first {n} of {n_all}")
    for trace, name, look in zip(potential.values.T, potential["neuron"].values, line_looks(n), strict=True):
        axes.plot(run.data["time"].values, trace, **look, linewidth=1.2, label=plain(str(name)))
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=6.5, handlelength=2.6)


def _phases(axes: Axes, run: Run, looks: list[dict]) -> None:
    """One bar for every stretch of time in which a segment is contracted, one row per segment."""
    data = run.data
    n_segments = len(looks)
    panel_title(axes, "Contraction (activation above 0.5)")
    step = max(1, -(-n_segments // 12))
    axes.set(ylabel="segment", ylim=(n_segments + 0.6, 0.4), yticks=range(1, n_segments + 1, step))
    axes.grid(visible=False, axis="y")
    if "activation" not in data:
        return
    time = data["time"].values
    activation = segment_activation(data["activation"].values, n_segments)
    for i, look in enumerate(looks):
        spans = (time[[a, min(b, len(time) - 1)]].tolist() for a, b in stretches(activation[:, i] > CONTRACTED))
        axes.broken_barh([(a, b - a) for a, b in spans], (i + 0.65, 0.7), facecolors=look["color"])


def _lengths(axes: Axes, run: Run, looks: list[dict]) -> None:
    data = run.data
    panel_title(axes, "Stretch sensors")
    axes.set_ylabel("length (cm)")
    time = data["time"].values
    stretch = _CM * data["stretch_length"].values
    several = stretch.shape[2] > 1
    for i, look in enumerate(looks):
        if several:
            axes.plot(time, stretch[:, i, 0], **look, linewidth=_THIN)
        axes.plot(time, stretch[:, i].mean(axis=1), **look, linewidth=_THICK)
    rest = float((_CM * data["stretch_rest_length"].values).mean())
    axes.axhline(rest, color="0.35", linewidth=0.6)
    _name_level(axes, rest, "at rest")
    entries: list[tuple] = [("0.25", "-", _THICK, "mean of its sensors" if several else "sensor")]
    if several and run.config.body.first_sensor:
        entries.append(("0.25", "-", _THIN, run.config.body.first_sensor))
    levels = _published_levels(run)
    if levels:
        _draw_levels(axes, levels, looks)
        entries.append(("0.25", (0, (_DASH_PT, _DASH_PT)), 1.0, "longest in the paper"))
    _legend(axes, entries)


def _draw_levels(axes: Axes, levels: list[float], looks: list[dict]) -> None:
    """Draws the segments' published levels, cm, and names them right of the panel, those that coincide together."""
    n = len(levels)
    together: list[list[int]] = []
    low, high = axes.get_ylim()
    for i in np.argsort(levels).tolist():
        # Each line's dashes fall into the gaps of the others, so that coinciding lines are all seen.
        dashes = (i * _DASH_PT, (_DASH_PT, _DASH_PT * max(n - 1, 1)))
        axes.axhline(levels[i], color=looks[i]["color"], linestyle=dashes, linewidth=1.0)
        if together and levels[i] - levels[together[-1][-1]] < _SAME * (high - low):
            together[-1].append(i)
        else:
            together.append([i])
    for group in together:
        named = ", ".join(str(i + 1) for i in sorted(group))
        _name_level(axes, float(np.mean([levels[i] for i in group])), f"paper: {named}")


def _name_level(axes: Axes, level: float, text: str) -> None:
    axes.text(1.004, level, text, transform=axes.get_yaxis_transform(), va="center", fontsize=7.0, color="0.25")


def _published_levels(run: Run) -> list[float]:
    """Where each segment's published elongation ends, cm: above the lowest length where it is peak to peak, or rest."""
    beside = published(run.config, run.attrs.get("controller"))
    changed = set(changed_fields(run.config)[1]).difference(RESOLUTION) if beside else set()
    if any(field.startswith(("body.", "controller.")) for field in changed):
        return []  # Of another worm they would be read as what it must reach.
    starts = {
        "elongation_first_helix_pp_m": run.data["stretch_length"].values[:, :, 0].min(axis=0),
        "elongation_mean_max_m": run.data["stretch_rest_length"].values.mean(axis=1),
    }
    for field, start in starts.items():
        if field in beside:
            return (_CM * (start + np.asarray(beside[field].value))).tolist()
    return []


def _name_segments(figure: Figure, looks: list[dict], title: str) -> None:
    """Puts a title and a legend of the segments above all panels: every one, or evenly spaced ones of many."""
    entries = [(*looks[i].values(), _THICK, f"segment {i + 1}") for i in evenly(len(looks), _MOST_NAMED)]
    figure.legend(
        handles=line_entries(entries),
        loc="outside upper left",
        ncols=_NAMES_A_ROW,
        handlelength=2.6,
        title=plain(title),
        title_fontproperties={"size": 11, "weight": "bold"},
        alignment="left",
    )


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

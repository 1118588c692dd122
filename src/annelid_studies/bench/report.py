"""The benchmark as a table, and in one picture: error against speed, cost against length, where a step's time goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D
from rich.table import Table as TerminalTable

from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid.markdown import Table
from annelid_studies.tables import terminal_table
from annelid_studies.worms import CHAIN

TOLERATED_PERCENT = 2.0
"""The line in the first panels: the error that a default may have."""

_MARKERS = "osD^v<>PX*"
_LEAST_PERCENT = 0.02
_LABELS = {"riddle2023": "paper's chain", "riddle2023-rods": "rods"}
_FADED = "0.35"
# Cold within the engine, warm around it.
_SHARE_COLORS = ("#1b2a6b", "#3658a7", "#5f8fd0", "#35b5a0", "#8fd3c5", "#c5cdd6", "#e3b428", "#c2410c", "#7a2a0a")


def bench_table(report: Mapping[str, Any]) -> TerminalTable:
    """Lays out the cases of a benchmark, the content of ``bench.json``, for the terminal, one a row."""
    references = list(report["fronts"])
    header = ["case", "ms a step", "x real time", "memory, MB", *(f"error, %, against {name}" for name in references)]
    rows = [_row(entry, references) for entry in report["cases"]]
    return terminal_table(Table(header, rows), f"{report['machine']}, recording on")


def slowdown_table(slowdowns: Mapping[str, float], tolerated: float) -> TerminalTable:
    """Lays out what `annelid_studies.bench.benchmark.slowdowns` found, the slowest first."""
    rows = [
        [name, f"{100 * share:+.0f} %", "slower" if share > tolerated else ""]
        for name, share in sorted(slowdowns.items(), key=lambda item: -item[1])
    ]
    caption = f"against the yardstick; {100 * tolerated:.0f} % are tolerated"
    return terminal_table(Table(["case", "time of a step", ""], rows), "Against the earlier benchmark", caption=caption)


def _row(entry: Mapping[str, Any], references: Sequence[str]) -> list[str]:
    name = f"{entry['name']} ({entry['level']})" if entry["level"] else entry["name"]
    if "failed" in entry:
        return [name, f"failed: {entry['failed']}"]
    compared = entry.get("errors", {})
    if compared and entry["rhythm"]["verdict"] != "ordered":
        name = f"{name}: {entry['rhythm']['reason']}"
    percents = [_percent(compared[name]["largest"]) if name in compared else "" for name in references]
    return [name, *_numbers(entry), _shown(entry["peak_memory_MB"], ".0f"), *percents]


def _numbers(entry: Mapping[str, Any]) -> list[str]:
    return [_shown(entry[key], ".3g") for key in ("step_mean_ms", "real_time_factor")]


def _percent(errors: Sequence[float | None]) -> str:
    """The range of an error over the perturbed runs, in percent."""
    known = [100.0 * error for error in errors if error is not None]
    return f"{min(known):.2f} to {max(known):.2f}" if len(known) == len(errors) else "-"


def _shown(value: float | None, digits: str) -> str:
    return "-" if value is None else format(value, digits)


def bench_figure(report: Mapping[str, Any], stem: Path) -> Path:
    """Draws a benchmark, the content of ``bench.json``.

    Above: errors against the finest converged run over times real time, one panel for each quantity, with bars over the
    perturbed runs; one colour for each number of elements, one marker for each step, hollow where the rhythm is not
    ordered; the dotted line joins the cases that no other beats. Below: time of a step against the number of segments
    with the slope, and its shares by phase. Panels for which nothing was measured stay out.
    """
    measured = [entry for entry in report["cases"] if "failed" not in entry]
    judged = [entry for entry in measured if entry["kind"] == "judged"]
    scaled = [entry for entry in measured if {"segments", "chain"} & set(entry["lines"])]
    divided = _divided(measured)
    panels: list[tuple[float, Callable[[SubFigure], None]]] = []
    if judged and report["fronts"]:
        panels.append((5.4, lambda part: _fronts(part, report, judged)))
    if scaled:
        panels.append((2.7, lambda part: _cost(part, scaled, report["cost_exponents"])))
    if divided:
        panels.append((1.2 + 0.24 * len(divided), lambda part: _shares(part, divided)))
    heights = [height for height, _ in panels]
    with canvas(sum(heights) or 1.0) as figure:
        if panels:
            rows = figure.subfigures(len(panels), 1, height_ratios=heights, squeeze=False)[:, 0]
            for part, (_, draw) in zip(rows, panels, strict=True):
                draw(part)
        return save_both(figure, stem)


def _fronts(part: SubFigure, report: Mapping[str, Any], judged: Sequence[Any]) -> None:
    reference = list(report["fronts"])[-1]
    elements = sorted({entry["elements_per_side"] for entry in judged})
    steps = sorted({entry["physics_step_ms"] for entry in judged})
    colors = dict(zip(elements, segment_colors(len(elements)), strict=True))
    markers = dict(zip(steps, cycle(_MARKERS), strict=False))
    *panels, legend = part.subplots(2, 3, sharex=True, squeeze=True).ravel()
    for axes, (quantity, front) in zip(panels, report["fronts"][reference].items(), strict=True):
        means = {}
        for entry in judged:
            errors = entry["errors"][reference][quantity]
            if None in (*errors, entry["real_time_factor"]):
                continue
            low, mean, high = np.maximum(100.0 * np.array([min(errors), np.mean(errors), max(errors)]), _LEAST_PERCENT)
            means[entry["name"]] = point = entry["real_time_factor"], mean
            color = colors[entry["elements_per_side"]]
            face = color if entry["rhythm"]["verdict"] == "ordered" else "none"
            look: dict[str, Any] = {"color": color, "markerfacecolor": face, "markersize": 5.0, "elinewidth": 0.8}
            bar = [[mean - low], [high - mean]]
            axes.errorbar(*point, yerr=bar, fmt=markers[entry["physics_step_ms"]], zorder=2, **look)
        best = [means[name] for name in front if name in means]
        axes.plot(*np.reshape(best, (-1, 2)).T, ":", color=_FADED, linewidth=1.0, zorder=1)
        _front_axes(axes, report, quantity.capitalize(), limit=quantity in ("elongation", "period"))
    panels[0].set_ylabel("error (%)")
    panels[3].set_ylabel("error (%)")
    legend.set_axis_off()
    meshes = [
        Line2D([], [], color=color, linewidth=4, label=f"{n} element{'s' if n > 1 else ''}")
        for n, color in colors.items()
    ]
    grey: dict[str, Any] = {"color": _FADED, "linestyle": "", "markersize": 5}
    paces = [Line2D([], [], marker=marker, label=f"{step:g} ms", **grey) for step, marker in markers.items()]
    if any(entry["rhythm"]["verdict"] != "ordered" for entry in judged):
        paces.append(Line2D([], [], marker="o", markerfacecolor="none", label="not ordered", **grey))
    legend.legend(
        handles=[*meshes, *paces], loc="center", ncols=2, title=f"Against {reference} (1 ms);\none core, recording on"
    )


def _front_axes(axes: Axes, report: Mapping[str, Any], title: str, *, limit: bool) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    words: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7.5}
    if limit:
        axes.axhline(TOLERATED_PERCENT, color="#c2410c", linewidth=0.8, linestyle="--", zorder=0)
        look = {"xycoords": axes.get_yaxis_transform(), "xytext": (0, 2), "ha": "left", "color": "#c2410c"}
        axes.annotate(f"{TOLERATED_PERCENT:g} %", (0.1, TOLERATED_PERCENT), **look, **words)
    # A speed to compare with that has no error of the same kind: the paper's own worm.
    chains = [one for one in report["cases"] if one["preset"] == CHAIN and one["n_segments"] == 3]
    papers = [one.get("real_time_factor") for one in chains]
    upright = {"xycoords": axes.get_xaxis_transform(), "rotation": 90, "va": "top", "color": _FADED}
    for speed, name in [(1.0, "real time"), *((speed, "paper's chain") for speed in papers if speed)]:
        axes.axvline(speed, color=_FADED, linewidth=0.8, linestyle="-.", zorder=0)
        axes.annotate(name, (speed, 0.99), xytext=(2, 0), ha="left", **upright, **words)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.margins(x=0.08, y=0.12)
    axes.set_xlabel("times real time")
    panel_title(axes, title)


def _cost(part: SubFigure, entries: Sequence[Any], exponents: Mapping[str, Mapping[str, float]]) -> None:
    axes = part.subplots()
    lines: dict[str, dict[int, Any]] = {}
    for entry in entries:
        if entry["step_median_ms"]:
            lines.setdefault(entry["preset"], {})[entry["n_segments"]] = entry
    for color, marker, (preset, points) in zip(segment_colors(4), _MARKERS, sorted(lines.items()), strict=False):
        sizes = sorted(points)
        slopes = [f"N^{slope:.2f} ({span.replace('-', '..')})" for span, slope in exponents.get(preset, {}).items()]
        step = points[sizes[0]]["physics_step_ms"]
        label = f"{_LABELS.get(preset, preset)}, steps of {step:g} ms"
        label += f": {', '.join(slopes)}" if slopes else ""
        axes.plot(sizes, [points[n]["step_median_ms"] for n in sizes], f"{marker}-", color=color, label=label)
        axes.axhline(step, color=color, linewidth=0.8, linestyle=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    sizes = sorted({n for points in lines.values() for n in points})
    axes.set_xticks(sizes, [str(n) for n in sizes])
    axes.minorticks_off()
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("segments N (dotted: where a step takes as long as it simulates)")
    axes.set_ylabel("time of a step (ms)")
    part.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=1)
    panel_title(axes, "Cost of a step against the length of the worm")


def _divided(measured: Sequence[Any]) -> dict[str, Any]:
    """The cases whose shares are drawn: the levels of fidelity, and the longest worm of each line."""
    found = {
        f"{entry['level']}: {entry['elements_per_side']} elements, {entry['physics_step_ms']:g} ms": entry
        for entry in sorted(measured, key=lambda entry: entry.get("real_time_factor") or 0.0)
        if entry["level"]
    }
    for line in ("segments", "chain"):
        on_line = [entry for entry in measured if line in entry["lines"] and not entry["level"]]
        if on_line:
            longest = max(on_line, key=lambda entry: entry["n_segments"])
            found[f"{_LABELS.get(longest['preset'], longest['preset'])}, N = {longest['n_segments']}"] = longest
    return found


def _shares(part: SubFigure, entries: Mapping[str, Any]) -> None:
    axes = part.subplots()
    phases = list(next(iter(entries.values()))["shares"])
    places = np.arange(len(entries))
    left = np.zeros(len(entries))
    for phase, color in zip(phases, _SHARE_COLORS, strict=False):
        widths = np.array([100.0 * max(entry["shares"][phase], 0.0) for entry in entries.values()])
        axes.barh(places, widths, 0.72, left=left, color=color, label=phase, edgecolor="w", linewidth=0.4)
        left += widths
    for place, entry in zip(places, entries.values(), strict=True):
        end = 101.0, float(place)
        axes.annotate(f"{entry['step_mean_ms']:.3g} ms", end, va="center", fontsize=8, annotation_clip=False)
    axes.set_yticks(places, list(entries))
    axes.invert_yaxis()
    axes.set_xlim(0.0, 100.0)
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("share of a step of the closed loop (%)")
    panel_title(axes, "Where the time of a step goes")
    part.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=5, columnspacing=1.2)

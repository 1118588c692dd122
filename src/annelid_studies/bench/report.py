"""The benchmark as a table, and in one picture: error against speed, cost against length."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from rich.table import Table as TerminalTable

from annelid.config import LEVELS
from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid.markdown import Table
from annelid_studies.bench.benchmark import QUANTITIES
from annelid_studies.bench.cases import CONVERGED_ELEMENTS, CONVERGED_STEP_S
from annelid_studies.standard_cases import CHAIN, RODS
from annelid_studies.tables import terminal_table

TOLERATED_PERCENT = 2.0
"""The line in the first panels: the error that a default may have."""

_MARKERS = "osD^"
_WAYS = ("o-", "s", "D", "^", "x")
_LEAST_PERCENT = 0.02
_LABELS = {CHAIN: "paper's chain", RODS: "rods"}
_FADED = "0.35"


def bench_table(report: Mapping[str, Any]) -> TerminalTable:
    """Lays out the cases of a benchmark, the content of ``bench.json``, for the terminal, one a row."""
    header = ["case", "ms a step", "x real time", f"times less processor time than {CHAIN}", "memory, MB", "error, %"]
    caption = "error: of elongation or period against the converged run, the larger, over runs of perturbed friction"
    table = Table(header, [_row(entry) for entry in report["cases"]])
    return terminal_table(table, f"{report['machine']}, recording on", caption=caption)


def _row(entry: Mapping[str, Any]) -> list[str]:
    name = f"{entry['name']} ({entry['level']})" if entry["level"] else entry["name"]
    if "failed" in entry:
        return [name, f"failed: {entry['failed']}"]
    if "errors" in entry and entry["rhythm"]["verdict"] != "ordered":
        name = f"{name}: {entry['rhythm']['reason']}"
    numbers = [_shown(entry[key], ".3g") for key in ("step_mean_ms", "real_time_factor")]
    less = _shown(entry["times_less_cpu"], ".3g") if "times_less_cpu" in entry else ""
    percent = _percent(entry["errors"]["largest"]) if "errors" in entry else ""
    return [name, *numbers, less, _shown(entry["peak_memory_MB"], ".0f"), percent]


def _percent(errors: Sequence[float | None]) -> str:
    """The range of an error over the perturbed runs, in percent."""
    known = [100.0 * error for error in errors if error is not None]
    return f"{min(known):.2f} to {max(known):.2f}" if len(known) == len(errors) else "-"


def _shown(value: float | None, digits: str) -> str:
    return "-" if value is None else format(value, digits)


def bench_figure(report: Mapping[str, Any], stem: Path) -> Path:
    """Draws a benchmark, the content of ``bench.json``.

    Above: errors against the converged run over times real time, one panel for each quantity, with bars over the
    perturbed runs: a line through the steps, marks of the levels of fidelity, and crosses where the rhythm is not
    ordered. Below: the time of a step against the number of segments with the slope. What was not measured stays out.
    """
    measured = [entry for entry in report["cases"] if "failed" not in entry]
    judged = [entry for entry in measured if "elongation" in entry.get("errors", {})]
    scaled = [entry for entry in measured if {"segments", "chain"} & set(entry["lines"])]
    panels: list[tuple[float, Callable[[SubFigure], None]]] = []
    if judged:
        panels.append((5.4, lambda part: _errors(part, judged)))
    if scaled:
        panels.append((2.7, lambda part: _cost(part, scaled, report["cost_exponents"])))
    heights = [height for height, _ in panels]
    with canvas(sum(heights) or 1.0) as figure:
        if panels:
            rows = figure.subfigures(len(panels), 1, height_ratios=heights, squeeze=False)[:, 0]
            for part, (_, draw) in zip(rows, panels, strict=True):
                draw(part)
        return save_both(figure, stem)


def _errors(part: SubFigure, judged: Sequence[Any]) -> None:
    steps = sorted((entry for entry in judged if "steps" in entry["lines"]), key=lambda entry: entry["physics_step_ms"])
    groups = {
        "steps in ms": steps,
        **{level: [entry for entry in judged if entry["level"] == level] for level in LEVELS},
        "not ordered": [entry for entry in judged if entry["rhythm"]["verdict"] != "ordered"],
    }
    look: dict[str, Any] = {"markersize": 5.0, "linewidth": 1.0, "elinewidth": 0.8}
    *panels, legend = part.subplots(2, 3, sharex=True, squeeze=True).ravel()
    for axes, quantity in zip(panels, QUANTITIES, strict=True):
        for (name, entries), color, marker in zip(groups.items(), [*segment_colors(4), "k"], _WAYS, strict=True):
            if not entries:
                continue
            # An error that is not known is not a number here, and is not drawn.
            known = np.array([(entry["real_time_factor"], *entry["errors"][quantity]) for entry in entries], float)
            speeds, percents = known[:, 0], np.maximum(100.0 * known[:, 1:].T, _LEAST_PERCENT)
            low, mean, high = percents.min(axis=0), percents.mean(axis=0), percents.max(axis=0)
            axes.errorbar(speeds, mean, np.abs([mean - low, high - mean]), fmt=marker, color=color, label=name, **look)
            for entry, *point in zip(steps if entries is steps else (), speeds, mean, strict=False):
                axes.annotate(f"{entry['physics_step_ms']:g}", point, xytext=(0, 4), textcoords="offset points")
        _error_axes(axes, quantity)
    panels[0].set_ylabel("error (%)")
    panels[3].set_ylabel("error (%)")
    legend.set_axis_off()
    legend.legend(
        *panels[0].get_legend_handles_labels(),
        loc="center",
        title=f"Against the converged run\n({CONVERGED_ELEMENTS} elements, {1e3 * CONVERGED_STEP_S:g} ms);\n"
        "one core, recording on",
    )


def _error_axes(axes: Axes, quantity: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    words: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7.5}
    if quantity in ("elongation", "period"):
        axes.axhline(TOLERATED_PERCENT, color="#c2410c", linewidth=0.8, linestyle="--", zorder=0)
        look = {"xycoords": axes.get_yaxis_transform(), "xytext": (0, 2), "ha": "left", "color": "#c2410c"}
        axes.annotate(f"{TOLERATED_PERCENT:g} %", (0.1, TOLERATED_PERCENT), **look, **words)
    upright = {"xycoords": axes.get_xaxis_transform(), "rotation": 90, "va": "top", "color": _FADED}
    axes.axvline(1.0, color=_FADED, linewidth=0.8, linestyle="-.", zorder=0)
    axes.annotate("real time", (1.0, 0.99), xytext=(2, 0), ha="left", **upright, **words)
    axes.set_xticks([0.3, 1.0, 3.0, 10.0], ["0.3", "1", "3", "10"])
    axes.set_xticks([], minor=True)
    axes.tick_params(labelbottom=True)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    # Errors of one kind may lie within a decade.
    axes.yaxis.set_minor_formatter(lambda value, _: f"{value:g}" if f"{value:e}"[0] in "25" else "")
    axes.margins(x=0.08, y=0.12)
    axes.set_xlabel("times real time")
    panel_title(axes, quantity.capitalize())


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
        label = f"{_LABELS[preset]}, steps of {step:g} ms"
        label += f": {', '.join(slopes)}" if slopes else ""
        axes.plot(sizes, [points[n]["step_median_ms"] for n in sizes], f"{marker}-", color=color, label=label)
        axes.axhline(step, color=color, linewidth=0.8, linestyle=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    sizes = sorted({n for points in lines.values() for n in points})
    axes.set_xticks(sizes, [str(n) for n in sizes])
    axes.set_xticks([], minor=True)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("segments N (dotted: where a step takes as long as it simulates)")
    axes.set_ylabel("time of a step (ms)")
    part.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=1)
    panel_title(axes, "Cost of a step against the length of the worm")

"""What is made of the ranking: CSV files, tables for the terminal and the figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple
from itertools import cycle
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import LogFormatter
from rich.table import Table as TerminalTable

from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid.markdown import Table
from annelid.output import write_csv
from annelid_studies.challenge.ranking import ALL, Standing
from annelid_studies.challenge.tasks import REFERENCE
from annelid_studies.tables import grouped, tabulated, terminal_table

CM = 100.0


def write_rows(kind: type[Any], rows: Sequence[Any], path: Path) -> Path:
    """Writes scores or standings as CSV, a column for every field; what there is nothing to tell of stays empty."""
    return write_csv(path, kind.__slots__, ([_cell(value) for value in astuple(row)] for row in rows))


def _with_interval(number: float, low: float, high: float, digits: int = 2) -> str:
    if not isfinite(number):
        return "-"
    return f"{number:.{digits}f}" + (f" ({low:.{digits}f} .. {high:.{digits}f})" if isfinite(low) else "")


def ranking_table(found: Sequence[Standing]) -> TerminalTable:
    """Lays out the ranking over all tasks."""
    columns: Mapping[str, Callable[[Standing], str]] = {
        "entrant": lambda one: one.entrant,
        "speed over reference": lambda one: _with_interval(one.ratio, one.ratio_low, one.ratio_high),
        "travels in order": lambda one: _with_interval(one.robust, one.robust_low, one.robust_high),
        "in time": lambda one: _with_interval(one.in_time, one.in_time_low, one.in_time_high),
        "travels": lambda one: _with_interval(one.travels, one.travels_low, one.travels_high),
    }
    overall = [one for one in found if one.task == ALL]
    return terminal_table(tabulated(overall, columns), "All tasks", caption="with 95 % intervals over draws")


def speed_table(found: Sequence[Standing], taus: Sequence[Mapping[str, float]] = ()) -> TerminalTable:
    """Lays out mean speeds, a row a task and a column an entrant, and Kendall's tau of comparisons that were made."""
    overall = [one.entrant for one in found if one.task == ALL]
    rows = []
    for task, own in _by_task(found).items():
        of = {one.entrant: one for one in own}
        speeds = (f"{CM * of[name].speed_m_per_s:.2f}{'*' if differs(of[name]) else ''}" for name in overall)
        rows.append([task, *speeds, *(f"{tau[task]:.2f}" for tau in taus)])
    caption = "* the 95 % interval of the difference to the reference excludes zero"
    heads = ["task", *overall, *(f"tau {i}" for i in range(1, len(taus) + 1))]
    return terminal_table(Table(heads, rows), "Mean speed (cm/s)", caption=caption)


def differs(one: Standing) -> bool:
    """Whether the interval of the difference to the reference excludes zero."""
    return one.gain_low > 0.0 or one.gain_high < 0.0


def write_tasks(found: Sequence[Standing], taus: Sequence[Mapping[str, float]], path: Path) -> Path:
    """Writes a row a task as CSV: the reference, the fastest other entrant beside it, and every entrant's mean speed.

    Args:
        found: Standings.
        taus: Kendall's tau by task, from comparisons with other rankings; a column each.
        path: File to write.
    """
    entrants = [one.entrant for one in found if one.task == ALL]
    rows = []
    for task, own in _by_task(found).items():
        of = {one.entrant: one for one in own}
        baseline = of[REFERENCE]
        best = max((one for one in own if one is not baseline), key=lambda one: one.speed_m_per_s, default=baseline)
        numbers = [baseline.speed_m_per_s, baseline.speed_low, baseline.speed_high, best.entrant, best.speed_m_per_s]
        numbers += [best.gain_m_per_s, best.gain_low, best.gain_high]
        rows.append([task, *numbers, *(tau[task] for tau in taus), *(of[name].speed_m_per_s for name in entrants)])
    baseline_columns = ["reference_m_per_s", "reference_low", "reference_high"]
    best_columns = ["best", "best_m_per_s", "gain_m_per_s", "gain_low", "gain_high"]
    columns = ["task", *baseline_columns, *best_columns, *(f"tau_{i}" for i in range(1, len(taus) + 1)), *entrants]
    return write_csv(path, columns, ([_cell(value) for value in row] for row in rows))


def _by_task(found: Sequence[Standing]) -> dict[str, list[Standing]]:
    return grouped((one for one in found if one.task != ALL), lambda one: one.task)


def _cell(value: object) -> object:
    return None if isinstance(value, float) and not isfinite(value) else value


def ranking_figure(found: Sequence[Standing], stem: Path) -> Path:
    """Draws speed against what the motors take per metre, and against the share of runs that travel in order."""
    overall = [one for one in found if one.task == ALL]
    with canvas(3.6) as figure:
        energy, robust = figure.subplots(1, 2, sharey=True)
        looks = zip(overall, segment_colors(len(overall)), cycle((-10, 3)), strict=False)
        for one, color, above in looks:
            y = (one.ratio, one.ratio_low, one.ratio_high)
            _point(energy, one.entrant, (one.electric_J_per_m, one.electric_low, one.electric_high), y, color, above)
            _point(robust, one.entrant, (one.robust, one.robust_low, one.robust_high), y, color, above)
        panel_title(energy, "Speed against energy")
        energy.set(xlabel="electrical energy (J/m)", ylabel="speed over the reference's, mean of tasks", xscale="log")
        for show in (energy.xaxis.set_major_formatter, energy.xaxis.set_minor_formatter):
            show(LogFormatter(minor_thresholds=(2, 1)))
        panel_title(robust, "Speed against robustness")
        robust.set(xlabel="share of runs that travel in order", xlim=(-0.05, 1.05))
        return save_both(figure, stem)


def _point(axes: Any, name: str, x: tuple[float, ...], y: tuple[float, ...], color: Any, above: float) -> None:
    """Draws a number with its interval in both directions and a name beside it; one that is infinite is left out."""
    if not isfinite(x[0]):
        return
    spans = [[[max(of[0] - of[1], 0.0)], [max(of[2] - of[0], 0.0)]] if np.isfinite(of).all() else None for of in (x, y)]
    axes.errorbar(x[0], y[0], xerr=spans[0], yerr=spans[1], fmt="o", color=color, markersize=4.0, linewidth=1.0)
    # A share near 1 has no room to its right.
    look: dict[str, Any] = {"xytext": (-4, above), "ha": "right"} if 0.7 < x[0] <= 1.0 else {"xytext": (4, above)}
    axes.annotate(name, (x[0], y[0]), textcoords="offset points", fontsize=7.5, color="0.15", **look)

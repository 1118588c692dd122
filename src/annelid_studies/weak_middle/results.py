"""What the study leaves behind: its CSV, its tables and its figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from rich.table import Table as TerminalTable

from annelid.analysis import PAPER_ELONGATION_M, ROBOT_ELONGATION_M, interior_deficit
from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid.experiment import Store
from annelid.markdown import Table
from annelid.output import write_csv
from annelid_studies.standard_cases import Effort
from annelid_studies.tables import Results, tabulated, terminal_table
from annelid_studies.weak_middle.pulls import ACTUATORS
from annelid_studies.weak_middle.sweeps import (
    BASE,
    BASE_KEY,
    FRICTION,
    QUANTITIES,
    STIFFNESS,
    WEIGHT,
    Answer,
    Asymmetry,
    Quantity,
    Reading,
    asymmetry,
    deficits,
    weak_middle,
)

ROBOT_DEFICIT, PAPERS_DEFICIT = interior_deficit(ROBOT_ELONGATION_M), interior_deficit(PAPER_ELONGATION_M)
"""How far the interior segments of the robot and of the paper's simulation stay below the ends, fractions."""
PERCENT = 100.0
FADED = "0.35"


def write_readings(readings: Sequence[Reading], path: Path) -> Path:
    """Writes one row a pulled segment as CSV with a header, and returns its path; the deficit is that of its worm."""
    rows = [
        {
            "quantity": reading.point.quantity,
            "value": f"{reading.point.value:g}",
            "n_segments": reading.point.n_segments,
            "actuator": reading.point.actuator.kind,
            "setting": reading.point.actuator.setting,
            "resolution": reading.point.resolution,
            "segment": one.segment,
            "elongation_cm": _number(100 * one.elongation_m, 3),
            "ring_length_m": _number(one.ring_length_m, 4),
            "force_N": _number(one.force_N, 3),
            "drift_mm": _number(1e3 * one.drift_m, 3),
            "deficit_percent": _number(100 * reading.deficit, 2),
            "problem": one.problem,
        }
        for reading in readings
        for one in reading.pulled
    ]
    return write_csv(path, rows[0], (row.values() for row in rows))


def weak_middle_figure(readings: Sequence[Reading], stem: Path) -> Path:
    """Draws the deficit over every quantity, a panel each, one line for every kind of actuator."""
    marks = {"robot": ROBOT_DEFICIT, "paper's\nmodel": PAPERS_DEFICIT}
    largest = max([*marks.values(), *(one.deficit for one in readings if isfinite(one.deficit))])
    with canvas(6.0) as figure:
        grid = figure.subplots(2, 2, sharey=True, squeeze=False)
        for letter, axes, quantity in zip("abcd", grid.flat, QUANTITIES, strict=True):
            _draw(axes, readings, quantity)
            panel_title(axes, f"{letter}) {quantity.title}")
            for value in marks.values():
                axes.axhline(PERCENT * value, color=FADED, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
            axes.set_ylim(0.0, 1.08 * PERCENT * largest)
        for left, right in grid:
            left.set_ylabel("interior below the ends (%)")
            beside: dict[str, Any] = {"xycoords": right.get_yaxis_transform(), "xytext": (4, 0), "va": "center"}
            for name, value in marks.items():
                text = f"{name}\n{PERCENT * value:.0f} %"
                look = {"textcoords": "offset points", "fontsize": 7.5, "color": FADED}
                right.annotate(text, (1.0, PERCENT * value), **beside, **look)
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), handlelength=3.0)
        return save_both(figure, stem)


def _draw(axes: Axes, readings: Sequence[Reading], quantity: Quantity) -> None:
    values = np.array([])
    looks = zip(segment_colors(4), ("o", "o", "^", "s"), ("-", (0, (1.2, 1.2)), (0, (5, 2)), "-"), strict=True)
    for order, (kind, (color, marker, dashes)) in enumerate(zip(ACTUATORS, looks, strict=True)):
        values, deficit = deficits(readings, quantity, kind)
        # Wherever the servo stalls its line lies on the force-limited one, so it is drawn as rings around that.
        ring = kind == "servo"
        look = {"markersize": 7.5 if ring else 4.5, "markerfacecolor": "none" if ring else color, "zorder": 6 - order}
        axes.plot(values, PERCENT * deficit, label=kind, color=color, marker=marker, linestyle=dashes, **look)
    axes.axvline(BASE[quantity.name], color="0.7", linewidth=0.8, zorder=0, label="base worm")
    axes.set_xlabel(quantity.label)
    if quantity in (STIFFNESS, FRICTION):
        axes.set_xscale("log")
    weightless = quantity is WEIGHT
    axes.set_xticks(values, ["weightless" if weightless and value == 0 else f"{value:g}" for value in values])
    axes.minorticks_off()


def sweep_table(readings: Sequence[Reading], quantity: Quantity) -> TerminalTable:
    """Tabulates one sweep: deficit, and elongations from the front to the middle."""
    own = [one for one in readings if one.point.quantity == quantity.name and not one.point.resolution]
    values = dict.fromkeys(one.point.value for one in own)
    rows = [[f"{value:g}", *(_cell(one) for one in own if one.point.value == value)] for value in values]
    title = "deficit of the interior, % (elongation from the front to the middle, cm)"
    return terminal_table(Table([quantity.label, *ACTUATORS], rows), title)


def asymmetry_table(found: Asymmetry) -> TerminalTable:
    """Tabulates what the robot's segments 2 and 3 would take."""
    weak, strong = (f"{100 * one:.2f} cm" for one in ROBOT_ELONGATION_M[1:-1])
    columns: Mapping[str, Callable[[Answer], str]] = {
        "one cause alone": lambda one: one.label,
        weak: lambda one: _number(one.weak, 3) or "-",
        strong: lambda one: _number(one.strong, 3) or "-",
        "difference": lambda one: f"{100 * one.difference:.0f} %" if isfinite(one.difference) else "-",
        "tried, cm": lambda one: " to ".join(f"{100 * end:.2f}" for end in one.extremes_m),
    }
    caption = ""
    if found.confirmed is not None:
        limits = " / ".join(f"{one:.2f}" for one in found.limits_N)
        reached, robot = (
            " / ".join(f"{100 * one:.2f}" for one in lengths)
            for lengths in (found.confirmed.elongation_m, ROBOT_ELONGATION_M)
        )
        caption = f"with force limits of {limits} N the segments elongate by {reached} cm; the robot's by {robot} cm"
    title = "what makes an interior segment as weak and as strong as the robot's two"
    return terminal_table(tabulated(found.answers, columns), title, caption=caption)


def study(store: Store, output: Path, effort: Effort) -> Results:
    """The study `weak-middle`; a quick one leaves the robot's own differences out."""
    set_to, readings = weak_middle(store, effort)
    found = asymmetry(store, set_to[BASE_KEY].force_N) if effort == "full" else None
    tables = [sweep_table(readings, quantity) for quantity in QUANTITIES]
    tables += [asymmetry_table(found)] if found else []
    path = write_readings([*readings, *(found.readings if found else ())], output / "weak_middle.csv")
    return (path, weak_middle_figure(readings, path.with_suffix(""))), tables


def _cell(reading: Reading) -> str:
    lengths = " / ".join(f"{100 * one.elongation_m:.2f}" for one in reading.pulled)
    return reading.problem or f"{100 * reading.deficit:.1f} ({lengths})"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if isfinite(value) else ""

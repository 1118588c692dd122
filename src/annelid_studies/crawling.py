"""How fast a gait crawls over ground of any friction, and with any number of segments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from annelid.body import WormBody
from annelid.config import load_config
from annelid.draw import canvas, draw_lines, panel_title, save_both
from annelid.errors import ConfigError
from annelid.experiment import Case, Judged, Store, StudyProgress, in_stage, judged_run
from annelid.markdown import Table
from annelid.morphology import Array
from annelid.output import write_csv
from annelid_studies.riddle2023.examination import Effort
from annelid_studies.tables import terminal_table

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

GAITS = ("riddle2025-muscles", "crawler")
"""The untuned gait and the one tuned for speed."""

Quantity = Literal["friction", "segments"]
VALUES: Mapping[Quantity, Mapping[Effort, tuple[float, ...]]] = {
    "friction": {"full": (0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5), "quick": (0.1, 0.7)},
    "segments": {"full": (3, 4, 5, 6, 8, 10, 12), "quick": (3, 6)},
}
LABELS: Mapping[Quantity, str] = {"friction": "friction of the ground", "segments": "number of segments"}
COLUMNS = {
    "speed_m_per_s": "speed (m/s)",
    "speed_body_lengths_per_s": "body lengths/s",
    "stride_m": "stride (m)",
    "period_s": "period (s)",
    "slip_ratio": "slip ratio",
    "cost_of_transport": "cost of transport",
    "cost_of_transport_net": "the same, net work",
    "cost_of_transport_cables": "the same, cables",
}
"""Numbers of a gait that are written, with their heads in a table."""
PANELS = {
    "speed_body_lengths_per_s": "speed (body lengths/s)",
    "cost_of_transport": "cost of transport",
    "slip_ratio": "slip ratio",
}
"""Numbers of a gait that are drawn, with their labels."""


@dataclass(frozen=True)
class Point:
    """One gait on one ground with one number of segments.

    Attributes:
        gait: Preset or TOML file.
        quantity: What is varied.
        value: Its value.
        case: The run.
    """

    gait: str
    quantity: Quantity
    value: float
    case: Case


@dataclass(frozen=True)
class Reading:
    """What was found at a point.

    Attributes:
        point: The point.
        judged: The gait's numbers, or why it does not walk.
    """

    point: Point
    judged: Judged

    def number(self, name: str) -> float | None:
        """Returns a number of the gait by its column's name; None where it does not walk."""
        gait = self.judged.gait
        return None if gait is None or self.judged.problem else getattr(gait, name)


def points(gaits: Sequence[str], effort: Effort) -> list[Point]:
    """Returns the points of the study, gait by gait.

    Raises:
        ConfigError: A gait is unknown or no 3D worm's.
    """
    return [
        Point(gait, quantity, value, Case(gait, changes_for(gait, quantity, value)))
        for gait in gaits
        for quantity, values in VALUES.items()
        for value in values[effort]
    ]


def changes_for(gait: str, quantity: Quantity, value: float) -> dict[str, Any]:
    """Returns what makes a gait's worm crawl on a friction, or have a number of segments.

    With the number of segments, rings inside get what the second ring has, the ends keep their own, and runs last in
    proportion, since a wave takes the longer to pass.

    Raises:
        ConfigError: The gait is unknown or no 3D worm's.
    """
    config = load_config(gait)
    body = config.body
    if not isinstance(body, WormBody):
        raise ConfigError(f"{gait} is a planar worm: this study needs a 3D worm")
    if quantity == "friction":
        return {"arena.friction": value}
    n, before = int(value), body.mesh.n_segments
    rings = body.rings
    field, forces = rings.force_field, rings.forces(before)
    return {
        "body.mesh.n_segments": n,
        f"body.rings.{field}": [forces[0], *[forces[1]] * (n - 2), forces[-1]],
        "duration_s": round(config.duration_s * max(n, before) / before, 3),
    }


def crawl(
    store: Store, chosen: Sequence[Point], *, jobs: int | None = None, progress: StudyProgress | None = None
) -> list[Reading]:
    """Computes points, as far as the store does not hold their runs.

    Raises:
        AnnelidError: A run cannot be built or written.
        KeyboardInterrupt: Finished runs are kept.
    """
    store.compute([point.case for point in chosen], jobs=jobs, progress=in_stage(progress, "crawling"))
    return [Reading(point, judged_run(store, point.case)) for point in chosen]


def write_readings(readings: Sequence[Reading], path: Path) -> None:
    """Writes one row a point as CSV with a header.

    Raises:
        RunFileError: The file cannot be written.
    """
    write_csv(path, ["gait", "quantity", "value", *COLUMNS, "problem"], map(_cells, readings))


def _cells(reading: Reading) -> list[str]:
    point = reading.point
    return [point.gait, point.quantity, f"{point.value:g}", *_numbers(reading), reading.judged.problem]


def _numbers(reading: Reading) -> list[str]:
    read = (reading.number(name) for name in COLUMNS)
    return ["" if number is None else f"{number:.4g}" for number in read]


def crawling_table(readings: Sequence[Reading], quantity: Quantity) -> TerminalTable:
    """Returns what was found over one quantity as a table for the terminal, one row a gait and value."""
    rows = [
        [_name(one.point.gait), f"{one.point.value:g}", *_numbers(one), one.judged.problem]
        for one in readings
        if one.point.quantity == quantity
    ]
    header = ["gait", LABELS[quantity], *COLUMNS.values(), "problem"]
    return terminal_table(Table(header, rows), f"Crawling, by {LABELS[quantity]}")


def write_figure(readings: Sequence[Reading], stem: Path) -> Path:
    """Draws a column for each quantity, and in it a panel for speed, cost of transport and slip, a line a gait.

    A cross on the lower edge marks where a gait does not walk.

    Args:
        readings: What was found.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    with canvas(7.0) as figure:
        grid = figure.subplots(len(PANELS), len(VALUES), squeeze=False, sharex="col", sharey="row")
        for letter, axes in zip("abcdefgh", grid.flat, strict=False):
            panel_title(axes, f"{letter})")
        for row, (name, label) in zip(grid, PANELS.items(), strict=True):
            row[0].set_ylabel(label)
            for axes, quantity in zip(row, VALUES, strict=True):
                draw_lines(axes, _lines(readings, quantity, name), markersize=4.0)
            row[0].set_ylim(bottom=0.0)
        for axes, quantity in zip(grid[-1], VALUES, strict=True):
            axes.set_xlabel(LABELS[quantity])
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return save_both(figure, stem)


def _lines(readings: Sequence[Reading], quantity: Quantity, name: str) -> dict[str, tuple[Array, Array]]:
    """Values of a quantity and a number of the gait, NaN where it does not walk, by the gait's name."""
    found = {}
    for gait in dict.fromkeys(one.point.gait for one in readings):
        own = [one for one in readings if (one.point.gait, one.point.quantity) == (gait, quantity)]
        numbers = np.array([one.number(name) for one in own], dtype=float)
        found[_name(gait)] = np.array([one.point.value for one in own]), numbers
    return found


def _name(gait: str) -> str:
    return Path(gait).name.removesuffix(".toml")

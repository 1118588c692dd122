"""How fast a gait crawls over ground of any friction, and with any number of segments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from rich.table import Table as TerminalTable

from annelid.body import WormBody
from annelid.config import load_config
from annelid.draw import canvas, draw_lines, panel_title, save_both
from annelid.errors import ConfigError
from annelid.experiment import Case, Judged, Store, judge
from annelid.markdown import Table
from annelid.output import write_csv
from annelid_studies.tables import grouped, terminal_table
from annelid_studies.worms import Effort

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


class Reading(NamedTuple):
    """A gait, a preset or TOML file, with one value of what is varied: its numbers, or why it does not walk."""

    gait: str
    quantity: Quantity
    value: float
    judged: Judged

    @property
    def name(self) -> str:
        """What tables and figures call the gait."""
        return Path(self.gait).name.removesuffix(".toml")

    def number(self, name: str) -> float | None:
        """Returns a number of the gait by its column's name; None where it does not walk."""
        gait = self.judged.gait
        return None if gait is None or self.judged.problem else getattr(gait, name)

    @property
    def cells(self) -> list[str]:
        """What stands in the last columns of its row."""
        numbers = (self.number(name) for name in COLUMNS)
        return [f"{self.value:g}", *("" if one is None else f"{one:.4g}" for one in numbers), self.judged.problem]


def runs(gaits: Sequence[str], effort: Effort) -> dict[tuple[str, Quantity, float], Case]:
    """Returns the runs of the study, gait by gait.

    Raises:
        ConfigError: A gait is unknown or no 3D worm's.
    """
    return {
        (gait, quantity, value): Case(gait, changes_for(gait, quantity, value))
        for gait in gaits
        for quantity, values in VALUES.items()
        for value in values[effort]
    }


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
    n, before = int(value), body.n_segments
    first, second, *_, last = body.rings.forces(before)
    return {
        "body.mesh.n_segments": n,
        f"body.rings.{body.rings.force_field}": [first, *[second] * (n - 2), last],
        "duration_s": round(config.duration_s * max(n, before) / before, 3),
    }


def crawl(store: Store, gaits: Sequence[str], effort: Effort) -> list[Reading]:
    """Runs every gait over all values, as far as the store does not hold the runs.

    Raises:
        ConfigError: A gait is unknown or no 3D worm's.
        AnnelidError: A run cannot be built or written.
    """
    cases = runs(gaits, effort)
    store.compute(cases.values(), "crawling")
    return [Reading(*point, judge(store[case])) for point, case in cases.items()]


def write_readings(readings: Sequence[Reading], path: Path) -> Path:
    """Writes one row a run as CSV with a header, and returns its path."""
    rows = ([one.gait, one.quantity, *one.cells] for one in readings)
    return write_csv(path, ["gait", "quantity", "value", *COLUMNS, "problem"], rows)


def crawling_table(readings: Sequence[Reading], quantity: Quantity) -> TerminalTable:
    """Tabulates what was found over one quantity, one row a gait and value."""
    rows = [[one.name, *one.cells] for one in readings if one.quantity == quantity]
    header = ["gait", LABELS[quantity], *COLUMNS.values(), "problem"]
    return terminal_table(Table(header, rows), f"Crawling, by {LABELS[quantity]}")


def write_figure(readings: Sequence[Reading], stem: Path) -> Path:
    """Draws a column for each quantity, and in it a panel for speed, cost of transport and slip, a line a gait.

    A cross on the lower edge marks where a gait does not walk.
    """
    with canvas(7.0) as figure:
        grid = figure.subplots(len(PANELS), len(VALUES), squeeze=False, sharex="col", sharey="row")
        for letter, axes in zip("abcdefgh", grid.flat, strict=False):
            panel_title(axes, f"{letter})")
        for row, (name, label) in zip(grid, PANELS.items(), strict=True):
            row[0].set_ylabel(label)
            for axes, quantity in zip(row, VALUES, strict=True):
                own = grouped((one for one in readings if one.quantity == quantity), lambda one: one.gait).values()
                numbers = [np.array([one.number(name) for one in of], dtype=float) for of in own]
                lines = {of[0].name: ([one.value for one in of], y) for of, y in zip(own, numbers, strict=True)}
                draw_lines(axes, lines, markersize=4.0)
            row[0].set_ylim(bottom=0.0)
        for axes, quantity in zip(grid[-1], VALUES, strict=True):
            axes.set_xlabel(LABELS[quantity])
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return save_both(figure, stem)

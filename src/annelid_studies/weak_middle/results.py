"""What the study leaves behind: its CSV, its tables, and what its figure is drawn from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from annelid.analysis.elongation import interior_deficit
from annelid.analysis.paper import published
from annelid.analysis.robot import ROBOT_ELONGATION_M
from annelid.config import load_config
from annelid.output import write_csv
from annelid_studies.figures.weak_middle import Panel
from annelid_studies.weak_middle.asymmetry import Asymmetry
from annelid_studies.weak_middle.pulls import ACTUATORS
from annelid_studies.weak_middle.settings import Key, Setting
from annelid_studies.weak_middle.sweeps import BASE, QUANTITIES, Quantity, Reading, deficits
from annelid_studies.worms import CHAIN

if TYPE_CHECKING:
    from rich.table import Table

COLUMNS = (
    "quantity",
    "value",
    "n_segments",
    "actuator",
    "setting",
    "resolution",
    "segment",
    "elongation_cm",
    "ring_length_m",
    "force_N",
    "drift_mm",
    "deficit_percent",
    "problem",
)


def write_readings(readings: Sequence[Reading], path: Path) -> None:
    """Writes one row a pulled segment as CSV with a header; the deficit is that of its worm.

    Raises:
        RunFileError: The file cannot be written.
    """
    write_csv(path, COLUMNS, (row for reading in readings for row in _rows(reading)))


def _rows(reading: Reading) -> Iterator[list[object]]:
    point = reading.point
    for one in reading.pulled:
        yield [
            point.quantity,
            f"{point.value:g}",
            point.n_segments,
            point.actuator.kind,
            point.actuator.setting,
            point.resolution,
            one.segment,
            _number(100 * one.elongation_m, 3),
            _number(one.ring_length_m, 4),
            _number(one.force_N, 3),
            _number(1e3 * one.drift_m, 3),
            _number(100 * reading.deficit, 2),
            one.problem,
        ]


def robot_deficit() -> float:
    """How far the robot's interior segments stay below its ends, a fraction."""
    return interior_deficit(ROBOT_ELONGATION_M)


def papers_deficit() -> float:
    """The same of the paper's simulation, its first helix read peak to peak."""
    elongation = published(load_config(CHAIN))["elongation_first_helix_pp_m"].value
    assert isinstance(elongation, tuple)
    return interior_deficit(elongation)


def panels(readings: Sequence[Reading]) -> list[Panel]:
    """Gathers the sweeps for the figure."""
    return [
        Panel(
            quantity.title,
            quantity.label,
            BASE[quantity.name],
            {kind: deficits(readings, quantity, kind) for kind in ACTUATORS},
            logarithmic=quantity.name in ("stiffness", "friction"),
            names={0.0: "weightless"} if quantity.name == "weight" else {},
        )
        for quantity in QUANTITIES
    ]


def settings_table(set_to: Mapping[Key, Setting]) -> Table:
    """Tabulates how strongly the actuators pull."""
    from rich.table import Table

    table = Table("worm", "", title="an end pulled to the robot's elongation")
    for heading in ("force limit (N)", "cable wound to (m)", "ring (m)", "muscle's activation"):
        table.add_column(heading, justify="right")
    labels = {quantity.name: quantity.label for quantity in QUANTITIES}
    for (name, value), one in set_to.items():
        numbers = (f"{one.force_N:.2f}", f"{one.length_m:.4f}", f"{one.ring_length_m:.4f}", f"{one.activation:.4f}")
        table.add_row(labels.get(name, name), f"{value:g}" if name in labels else "", *numbers)
    return table


def sweep_table(readings: Sequence[Reading], quantity: Quantity) -> Table:
    """Tabulates one sweep: deficit, and elongations from the front to the middle."""
    from rich.table import Table

    table = Table(quantity.label, title="deficit of the interior, % (elongation from the front to the middle, cm)")
    own = [one for one in readings if one.point.quantity == quantity.name and not one.point.resolution]
    for kind in ACTUATORS:
        table.add_column(kind, justify="right")
    for value in dict.fromkeys(one.point.value for one in own):
        table.add_row(f"{value:g}", *(_cell(one) for one in own if one.point.value == value))
    return table


def checks_table(readings: Sequence[Reading]) -> Table:
    """Tabulates deficits at other resolutions, with force-limited actuators."""
    from rich.table import Table

    table = Table("mass of the worm (kg)", "resolution", title="force-limited, at other resolutions")
    table.add_column("deficit, % (elongation, cm)", justify="right")
    masses = [one.point.value for one in readings if one.point.resolution]
    for one in readings:
        point = one.point
        if (point.quantity, point.actuator.kind) == ("weight", "force-limited") and point.value in masses:
            table.add_row(f"{point.value:g}", point.resolution or "the study's", _cell(one))
    return table


def asymmetry_table(found: Asymmetry) -> Table:
    """Tabulates what the robot's segments 2 and 3 would take."""
    from rich.table import Table

    weak, strong = (f"{100 * one:.2f} cm" for one in ROBOT_ELONGATION_M[1:-1])
    table = Table("one cause alone", title="what makes an interior segment as weak and as strong as the robot's two")
    for heading in (weak, strong, "difference", "tried, cm"):
        table.add_column(heading, justify="right")
    for one in found.answers:
        low, high = one.tried
        difference = f"{100 * one.difference:.0f} %" if isfinite(one.difference) else "-"
        table.add_row(
            one.label,
            _number(one.weak, 3) or "-",
            _number(one.strong, 3) or "-",
            difference,
            f"{100 * low:.2f} to {100 * high:.2f}",
        )
    if found.confirmed is not None:
        limits = " / ".join(f"{one:.2f}" for one in found.limits_N)
        reached = " / ".join(f"{100 * one:.2f}" for one in found.confirmed.elongation_m)
        robot = " / ".join(f"{100 * one:.2f}" for one in ROBOT_ELONGATION_M)
        table.caption = (
            f"with force limits of {limits} N the segments elongate by {reached} cm; the robot's by {robot} cm"
        )
    return table


def _cell(reading: Reading) -> str:
    lengths = " / ".join(f"{100 * one.elongation_m:.2f}" for one in reading.pulled)
    return reading.problem or f"{100 * reading.deficit:.1f} ({lengths})"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if isfinite(value) else ""

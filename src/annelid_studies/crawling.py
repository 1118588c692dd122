"""How fast a gait crawls over ground of any friction, and with any number of segments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from annelid.body.worm import WormBody
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment.case import Case
from annelid.experiment.progress import StudyProgress, in_stage
from annelid.experiment.store import Store
from annelid.experiment.tune.judge import Judged
from annelid.experiment.tune.search import judged_run
from annelid.output import write_csv
from annelid_studies.figures.crawling import Line, crawling_figure
from annelid_studies.riddle2023.examination import Effort

if TYPE_CHECKING:
    from rich.table import Table

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
    point, numbers = reading.point, [_short(reading.number(name)) for name in COLUMNS]
    return [point.gait, point.quantity, f"{point.value:g}", *numbers, reading.judged.problem]


def crawling_table(readings: Sequence[Reading], quantity: Quantity) -> Table:
    """Returns what was found over one quantity as a table for the terminal, one row a gait and value."""
    from rich.table import Table

    table = Table(title=f"Crawling, by {LABELS[quantity]}")
    for head in ("gait", LABELS[quantity], *COLUMNS.values(), "problem"):
        table.add_column(head, justify="left" if head in ("gait", "problem") else "right")
    for reading in readings:
        point = reading.point
        if point.quantity == quantity:
            numbers = [_short(reading.number(name)) for name in COLUMNS]
            table.add_row(_name(point.gait), f"{point.value:g}", *numbers, reading.judged.problem)
    return table


def write_figure(readings: Sequence[Reading], stem: Path) -> Path:
    """Draws speed, cost of transport and slip over both quantities.

    Raises:
        RunFileError: A file cannot be written.
    """
    gaits = list(dict.fromkeys(reading.point.gait for reading in readings))
    lines = {LABELS[quantity]: [_line(readings, gait, quantity) for gait in gaits] for quantity in VALUES}
    return crawling_figure(lines, stem)


def _line(readings: Sequence[Reading], gait: str, quantity: Quantity) -> Line:
    own = [one for one in readings if (one.point.gait, one.point.quantity) == (gait, quantity)]

    def column(name: str) -> tuple[float | None, ...]:
        return tuple(one.number(name) for one in own)

    return Line(
        _name(gait),
        tuple(one.point.value for one in own),
        column("speed_body_lengths_per_s"),
        column("cost_of_transport"),
        column("slip_ratio"),
    )


def _name(gait: str) -> str:
    return Path(gait).name.removesuffix(".toml")


def _short(number: float | None) -> str:
    return "" if number is None else f"{number:.4g}"

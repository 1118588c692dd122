"""How fast a gait crawls: over friction and number of segments, and with error bars.

A *headline* is the mean of a gait's numbers over runs that differ in the friction of the ground, by up to one percent
either way, with its 95 % interval, and beside it the change of each number at finer steps and with more elements.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import Any, Literal, NamedTuple

from rich.table import Table as TerminalTable

from annelid.analysis import mean_and_interval
from annelid.body import worm_of
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment import Case, Judged, Store, finer_steps, judge, more_elements
from annelid.markdown import Table
from annelid.output import write_csv
from annelid_studies.standard_cases import Effort, drawn_frictions
from annelid_studies.tables import Results, terminal_table

GAITS = ("riddle2025-muscles", "crawler")
"""The untuned gait and the one tuned for speed."""
HEADLINES = ("riddle2025", "riddle2025-muscles", "crawler", "crawler-timed", "crawler-servo")
"""The gaits that have a headline by default."""
PERTURBED: Mapping[Effort, int] = {"full": 8, "quick": 2}
"""How many runs with a friction of their own a headline has."""

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
    "gait_period_s": "period (s)",
    "slip_ratio": "slip ratio",
    "cost_of_transport": "cost of transport",
    "cost_of_transport_net": "the same, net work",
    "cost_of_transport_cables": "the same, cables",
}
"""Numbers of a gait that are written, with their heads in a table."""


class Reading(NamedTuple):
    """A gait, a preset or TOML file, with one value of what is varied: its numbers, or why it does not walk."""

    gait: str
    quantity: Quantity
    value: float
    judged: Judged

    @property
    def name(self) -> str:
        """What tables call the gait."""
        return Path(self.gait).name.removesuffix(".toml")

    def number(self, name: str) -> float | None:
        """Returns a number of the gait by its column's name; None where it does not walk."""
        return number_of(self.judged, name)

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
    body = worm_of(config)
    if quantity == "friction":
        return {"arena.friction": value}
    n, before = int(value), body.n_segments
    first, second, *_, last = body.rings.forces(before)
    return {
        "body.mesh.n_segments": n,
        f"body.rings.{body.rings.force_field}": [first, *[second] * (n - 2), last],
        "duration_s": round(config.duration_s * max(n, before) / before, 3),
    }


def speed(store: Store, output: Path, effort: Effort, gaits: Sequence[str] | None = None) -> Results:
    """The study `speed`, of `GAITS` or others."""
    cases = runs(gaits or GAITS, effort)
    store.compute(cases.values(), "crawling")
    readings = [Reading(*point, judge(store[case])) for point, case in cases.items()]
    path = write_readings(readings, output / "speed.csv")
    return (path,), [crawling_table(readings, quantity) for quantity in VALUES]


def write_readings(readings: Sequence[Reading], path: Path) -> Path:
    """Writes one row a run as CSV with a header, and returns its path."""
    rows = ([one.gait, one.quantity, *one.cells] for one in readings)
    return write_csv(path, ["gait", "quantity", "value", *COLUMNS, "problem"], rows)


def crawling_table(readings: Sequence[Reading], quantity: Quantity) -> TerminalTable:
    """Tabulates what was found over one quantity, one row a gait and value."""
    rows = [[one.name, *one.cells] for one in readings if one.quantity == quantity]
    header = ["gait", LABELS[quantity], *COLUMNS.values(), "problem"]
    return terminal_table(Table(header, rows), f"Crawling, by {LABELS[quantity]}")


class Headline(NamedTuple):
    """A gait with error bars: its own run, perturbed ones, and finer ones by what is finer about them."""

    gait: str
    own: Judged
    perturbed: Sequence[Judged]
    finer: Mapping[str, Judged]

    @property
    def n_walking(self) -> int:
        """How many of the perturbed runs walk."""
        return sum(not one.problem for one in self.perturbed)

    @property
    def problem(self) -> str:
        """Which runs do not walk, and why; empty where all do."""
        named = {"itself": self.own, **{f"run {i}": one for i, one in enumerate(self.perturbed, start=1)}, **self.finer}
        return "; ".join(f"{name}: {one.problem}" for name, one in named.items() if one.problem)

    def interval(self, name: str) -> tuple[float | None, float | None, float | None]:
        """Returns mean, lower and upper end of a number over the perturbed runs that walk; None where there is none."""
        known = [one for judged in self.perturbed if (one := number_of(judged, name)) is not None]
        mean, low, high = (None if isnan(end) else end for end in mean_and_interval(known))
        return mean, low, high

    def changes(self, name: str) -> dict[str, float | None]:
        """Returns by how much of itself a number changes in each finer run; None where one of both does not walk."""
        own = number_of(self.own, name)
        finer = {what: number_of(judged, name) for what, judged in self.finer.items()}
        return {what: one / own - 1.0 if own and one is not None else None for what, one in finer.items()}


def number_of(judged: Judged, name: str) -> float | None:
    """Returns a number of a run by its column's name; None where it does not walk."""
    return None if judged.gait is None or judged.problem else getattr(judged.gait, name)


def variants(gait: str, effort: Effort) -> tuple[list[dict[str, Any]], dict[str, dict[str, Any]]]:
    """Returns what is changed in the perturbed runs of a gait, and in its finer ones by what is finer about them.

    A quick study halves the step only.

    Raises:
        ConfigError: The gait is unknown or no 3D worm's.
    """
    config = load_config(gait)
    if config.arena is None:
        raise ConfigError(f"{gait} has no ground: this study needs a 3D worm")
    perturbed = drawn_frictions(config.arena.friction, PERTURBED[effort])
    half = finer_steps(config)[0]
    if effort == "quick":
        return perturbed, {"half_step": half}
    # A quarter in two halvings: of 10 ms with control steps of 1 ms that is 2 ms.
    quarter = finer_steps(load_config(config.model_dump(), half))[0]
    names = ("element_more", "elements_more")
    elements = dict(zip(names, more_elements(config), strict=True))
    return perturbed, {"half_step": half, "quarter_step": quarter, **elements}


def gaits(store: Store, output: Path, effort: Effort, gaits: Sequence[str] | None = None) -> Results:
    """The study `gaits`, of `HEADLINES` or others; the file is written gait by gait."""
    found: list[Headline] = []
    path = output / "gaits.csv"
    for gait, (perturbed, finer) in {gait: variants(gait, effort) for gait in gaits or HEADLINES}.items():
        cases = [Case(gait, changes) for changes in ({}, *perturbed, *finer.values())]
        store.compute(cases, gait)
        own, *others = (judge(store[case]) for case in cases)
        of_finer = dict(zip(finer, others[len(perturbed) :], strict=True))
        found.append(Headline(gait, own, others[: len(perturbed)], of_finer))
        write_headlines(found, path)
    return (path,), [headline_table(found)]


def write_headlines(found: Sequence[Headline], path: Path) -> Path:
    """Writes one row a gait as CSV, and returns its path: of every number its mean, interval and relative changes."""
    rows = []
    for one in found:
        row: dict[str, Any] = {"gait": Path(one.gait).name.removesuffix(".toml"), "walking": one.n_walking}
        for name in COLUMNS:
            row |= zip((name, f"{name}_low", f"{name}_high"), one.interval(name), strict=True)
            row |= {f"{name}_{what}": change for what, change in one.changes(name).items()}
        rows.append({**row, "problem": one.problem})
    return write_csv(path, rows[0], ([_rounded(value) for value in row.values()] for row in rows))


def _rounded(value: object) -> object:
    return f"{value:.5g}" if isinstance(value, float) else value


def headline_table(found: Sequence[Headline]) -> TerminalTable:
    """Tabulates speeds with their intervals and changes, one row a gait."""
    rows = []
    for one in found:
        mean, low, high = one.interval(shown := "speed_body_lengths_per_s")
        ends = "" if low is None else f"{low:.4f} .. {high:.4f}"
        changed = ["" if part is None else f"{100 * part:+.1f} %" for part in one.changes(shown).values()]
        rows.append([one.gait, "" if mean is None else f"{mean:.4f}", ends, str(one.n_walking), *changed])
    finer = [name.replace("_", " ") for name in found[0].finer]
    header = [
        "gait",
        COLUMNS["speed_body_lengths_per_s"],
        "95 % interval",
        f"walking of {len(found[0].perturbed)}",
        *finer,
    ]
    return terminal_table(Table(header, rows), "Gaits with error bars")

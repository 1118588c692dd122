"""A measured log, such as a robot's or a video tracker's, read into series in SI units that a run can be compared with.

A map, a TOML file, says which column is which signal of a run, in which unit. A defect of the log is handled and noted
in a sentence, or refused in one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas

from annelid.errors import ConfigError, UnreadableText, shown, suggest
from annelid.protocols import Array
from annelid_lab.logs.maps import UNITS, Column, LogMap, plain_unit, unit_of
from annelid_lab.logs.tables import LogTable, read_table, several

OUTLIER = 1.5
"""How far out of the range of most values an outlier lies, in widths of that range."""
MOST_REPEATED = 0.05
"""Largest share of the instants that may be in a log twice."""
FEWEST = 8
"""Rows with a time that a log must have."""
_CERTAINTY = ("likelihood", "score", "confidence", "conf", "p")
_CLOCK = r"\d+:\d\d:\d\d(?:\.\d+)?"
_DATE = r"\d+[-/.]\d+[-/.]\d+"


@dataclass(frozen=True)
class Measured:
    """A log.

    Attributes:
        time_s: Instants, s, strictly rising, ``(n,)``.
        values: Series in SI units, ``(n,)``, NaN in gaps, by the names of their columns.
        columns: What each is, by the same names.
        kinds: The SI unit that each was converted to, before ``scale``.
        notes: What was handled, a sentence each.
        log_map: The map by which it was read.
    """

    time_s: Array
    values: Mapping[str, Array]
    columns: Mapping[str, Column]
    kinds: Mapping[str, str]
    notes: tuple[str, ...]
    log_map: LogMap


def read_measured(path: str | Path, log_map: LogMap) -> Measured:
    """Reads a log by a map.

    Args:
        path: A table: text with any separator, a decimal comma, lines above its header, UTF-16 or gz; Excel; Parquet;
            MATLAB; netCDF; WCON; tables of DeepLabCut, SLEAP (CSV, or analysis HDF5) and motion capture; or poses that
            movement has written. Their points are ``NAME.x, NAME.y``.
        log_map: What its columns are.

    Raises:
        ConfigError: A column is missing or has a unit that is not known.
        UnreadableText: The file cannot be read, a cell is no number, or the time goes back.
        MissingDependency: A format needs a package that is not installed.
    """
    needed = [log_map.time, *log_map.map, *(column.distance_to for column in log_map.map.values())]

    def score(names: Sequence[str]) -> int:
        # A name above the coordinates of a point, as in motion capture, is not yet the point.
        return sum(2 * bool(points_of(name, names)) or names.count(name) == 1 for name in needed if name is not None)

    table = read_table(Path(path), score, log_map.individual)
    time_s, rows = _instants(table, log_map)
    read = {name: _series(name, column, table, log_map) for name, column in log_map.map.items()}
    time_s, values = _once(time_s, {name: series[rows] for name, (series, _) in read.items()}, table)
    notes = table.notes
    steps = np.diff(time_s)
    if (jitter := float(np.std(steps) / np.median(steps))) > 0.05:
        notes.append(f"samples are not evenly spaced ({100 * jitter:.0f} % of {np.median(steps):.3g} s)")
    for name, series in values.items():
        missing = float(np.isnan(series).mean())
        if missing > 0.5:
            raise UnreadableText(f"{name} in {path} has no number in {100 * missing:.0f} % of its rows")
        if missing:
            notes.append(f"{name}: {100 * missing:.1f} % missing")
        spikes = outliers(series)
        series[spikes] = np.nan
        if spikes.any():
            notes.append(f"{name}: {spikes.sum()} outliers left out")
        if np.ptp(series[~np.isnan(series)]) == 0.0:
            notes.append(f"{name} never changes: a sensor that was not connected?")
    kinds = {name: kind for name, (_, kind) in read.items()}
    return Measured(time_s, values, dict(log_map.map), kinds, tuple(notes), log_map)


def outliers(series: Array) -> np.ndarray:
    """Marks lone values, two in a row at most, far out of the range that 90 % of all have, ``(n,)``."""
    low, high = np.nanpercentile(series, [5, 95])
    with np.errstate(invalid="ignore"):
        far = np.abs(series - (low + high) / 2) > (0.5 + OUTLIER) * (high - low)
    after = np.cumsum(~far)
    return far & (np.bincount(after, minlength=len(far) + 1)[after] <= 3)


def _form(name: str) -> re.Pattern[str]:
    """What finds the columns of a tracked point, as ``worm1.head.x``, ``head_y_mm`` or ``X#head (cm)``."""
    words = "|".join(("x", "y", "z", *_CERTAINTY))
    return re.compile(
        rf"(?:(?P<who>.+)[.:])?(?:(?P<name>{name})[._: ](?P<axis>{words})|(?P<first>[xyz])[#._ ](?P<after>{name}))"
        r"(?:[_ (\[]+(?P<unit>[A-Za-zµμ]+)[)\]]?)?",
        re.IGNORECASE,
    )


_ANY_POINT = _form(".+?")


def point_in(column: str) -> str | None:
    """Returns the name of the tracked point that a column has a coordinate or the certainty of; None for another."""
    match = _ANY_POINT.fullmatch(column)
    name = match and (match["name"] or match["after"])
    return None if not name or UNITS.get(plain_unit(name), ("",))[0] in ("m", "px") else name


def points_of(name: str, names: Sequence[str]) -> dict[str, dict[str, str]]:
    """Finds a tracked point among columns: the column of each coordinate and of the certainty, by individual."""
    form = _form(re.escape(name))
    found: dict[str, dict[str, str]] = {}
    for column in names:
        if match := form.fullmatch(column):
            axes, axis = found.setdefault(match["who"] or "", {}), (match["axis"] or match["first"]).lower()
            if axis in axes:
                return {}
            axes[axis] = column
    return {individual: axes for individual, axes in found.items() if {"x", "y"} <= axes.keys()}


def _series(name: str, column: Column, table: LogTable, log_map: LogMap) -> tuple[Array, str]:
    """A column, or what two columns of a tracked point give, in SI units, and in which."""
    if name in table.names:
        values = table.numbers(name)
        kind, factor = unit_of(name, column.unit or table.units.get(name), f"map.{name}.unit")
    else:
        names = [name] if column.distance_to is None else [name, column.distance_to]
        places, units = zip(*(_place(point, table, log_map) for point in names), strict=True)
        kind, factor = unit_of("", column.unit or units[0] or "px", f"map.{name}.unit")
        if kind == "px":
            if log_map.m_per_px is None:
                raise ConfigError(f"{name} is a tracked point: the map needs m_per_px, the metres in a pixel")
            kind, factor = "m", log_map.m_per_px
        place = places[0]
        away = place - (places[1] if len(places) > 1 else place[np.isfinite(place).all(axis=1)][:1])
        if len(places) > 1:
            values = np.linalg.norm(away, axis=1)
        else:
            net = np.nanmean(away[-max(len(away) // 10, 1) :], axis=0)
            values = away @ (net / (np.linalg.norm(net) or 1.0))
    scale = 1.0 if column.scale is None else column.scale
    shift = 0.0 if column.offset == "free" else column.offset
    return factor * scale * values + shift, kind


def _place(name: str, table: LogTable, log_map: LogMap) -> tuple[Array, str | None]:
    """A tracked point's place, ``(n, 2)`` or ``(n, 3)``, NaN where it is unlikely, and its unit if that is stated."""
    points = points_of(name, table.names)
    if log_map.individual is not None:
        points = {who: axes for who, axes in points.items() if who in ("", log_map.individual)}
    if not points:
        known = {point_in(one) or one for one in table.names}
        raise ConfigError(f"{table.path} has no column {shown(name)}: {suggest(name, known)}")
    if len(points) > 1:
        raise UnreadableText(several(table.path, sorted(points)))
    (axes,) = points.values()
    place = np.stack([table.numbers(axes[axis]) for axis in "xyz" if axis in axes], axis=1)
    for word in axes.keys() & set(_CERTAINTY):
        place[~(table.numbers(axes[word]) >= log_map.least_likelihood)] = np.nan
    end = _form(re.escape(name)).fullmatch(axes["x"])
    return place, table.units.get(axes["x"]) or (end and end["unit"])


def _instants(table: LogTable, log_map: LogMap) -> tuple[Array, np.ndarray]:
    """Times of the rows that have one, s, and which rows these are."""
    if log_map.time is None:
        return np.arange(len(table.cells)) / float(log_map.rate_Hz or 1.0), np.ones(len(table.cells), dtype=bool)
    if log_map.time not in table.names:
        offered = suggest(log_map.time, table.names)
        raise ConfigError(f"{table.path} has no column {shown(log_map.time)}: {offered}")
    time_s = clock_times(log_map.time, table)
    if time_s is None:
        given = log_map.time_unit or table.units.get(log_map.time)
        kind, factor = unit_of(log_map.time, given, "time_unit", example="s")
        if kind != "s":
            unit = log_map.time_unit or log_map.time
            raise ConfigError(f"time_unit = {shown(unit)} is no unit of time: s, ms, us or min")
        time_s = factor * table.numbers(log_map.time)
    dated = np.isfinite(time_s)
    if dated.sum() < FEWEST:
        raise UnreadableText(f"{table.path} has {dated.sum()} rows with a time: too few to compare")
    if not dated.all():
        table.notes.append(f"{(~dated).sum()} rows without a time left out")
    back = np.flatnonzero(np.diff(time_s[dated]) < 0)
    if back.size:
        at = time_s[dated][back[0] : back[0] + 2]
        raise UnreadableText(
            f"the time in {table.path} goes back, from {at[0]:g} to {at[1]:g} s: cut it where it starts again"
        )
    return time_s[dated], dated


def clock_times(name: str, table: LogTable) -> Array | None:
    """Dates and clocks of a column as seconds since the first, NaN where there is none; None where most are neither."""
    cells = table.cells[name]
    if cells.dtype.kind in "fiu":
        return None
    text = pandas.Series(cells.astype(str)).str.strip().str.replace(",", ".", regex=False)
    if text.str.fullmatch(_CLOCK).mean() > 0.5:
        passed = pandas.to_timedelta(text.where(text.str.fullmatch(_CLOCK)))
        return passed.dt.total_seconds().to_numpy()
    if text.str.match(_DATE).mean() <= 0.5:
        return None
    day = text.str.extract(rf"^({_DATE})")[0].dropna().unique()
    if "-" in day[0] or len(day[0].partition("/")[0]) == 4:
        dates = pandas.to_datetime(text, errors="coerce", format="ISO8601", utc=True)
    elif "/" in day[0] and len(day) > 1:
        raise UnreadableText(f"dates as {shown(day[0])} in {table.path} may begin with day or month: write 2024-05-31")
    else:
        dates = pandas.to_datetime(text, errors="coerce", format="mixed", dayfirst="." in day[0], utc=True)
    if not dates.notna().any():
        raise UnreadableText(f"the dates in {table.path} cannot be read, as {shown(str(text.iloc[0]))}")
    return (dates - dates.dropna().iloc[0]).dt.total_seconds().to_numpy()


def _once(time_s: Array, values: dict[str, Array], table: LogTable) -> tuple[Array, dict[str, Array]]:
    """Takes the mean of rows with the same time."""
    instants, first, count = np.unique(time_s, return_inverse=True, return_counts=True)
    repeated = len(time_s) - len(instants)
    if repeated > MOST_REPEATED * len(time_s):
        raise UnreadableText(
            f"{repeated} of {len(time_s)} rows in {table.path} repeat the time before: is it too coarse?"
        )
    if not repeated:
        return time_s, values
    table.notes.append(f"{repeated} rows that repeat a time are averaged")
    return instants, {name: np.bincount(first, weights=series) / count for name, series in values.items()}

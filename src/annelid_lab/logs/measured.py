"""A measured log, such as a robot's or a video tracker's, read into series in SI units that a run can be compared with.

A map, a TOML file, says which column is which signal of a run, in which unit. A defect of the log is handled and noted
in a sentence, or refused in one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Annotated, Literal

import h5py
import numpy as np
import pandas
import xarray
from h5py import Dataset, HardLink
from h5py.h5d import VIRTUAL
from pandas import DataFrame
from pydantic import Field, model_validator

from annelid.config import Line, Positive, Section, Share, check_section
from annelid.errors import ConfigError, MissingDependency, UnreadableText, listed, shown, suggest
from annelid.protocols import Array
from annelid.textfiles import read_toml

MOST_BYTES = 300_000_000
"""Of a log that is read, and of each of its parts in memory: a compressed file may be small and hold terabytes."""
UNITS = {
    "s": ("s", 1.0), "ms": ("s", 1e-3), "us": ("s", 1e-6), "min": ("s", 60.0),
    "m": ("m", 1.0), "cm": ("m", 1e-2), "mm": ("m", 1e-3), "um": ("m", 1e-6), "in": ("m", 0.0254),
    "m/s": ("m/s", 1.0), "cm/s": ("m/s", 1e-2), "mm/s": ("m/s", 1e-3), "J": ("J", 1.0), "px": ("px", 1.0),
    "N": ("N", 1.0), "mN": ("N", 1e-3), "gf": ("N", 9.80665e-3), "kgf": ("N", 9.80665), "lbf": ("N", 4.4482216),
    "rad": ("rad", 1.0), "deg": ("rad", np.pi / 180.0), "1": ("1", 1.0), "%": ("1", 1e-2),
}  # fmt: skip
"""Units of columns: what each measures, by its SI unit, and how many of these it is."""
OFF_SCALE = 20.0
"""A column that is so many times as large or as small as its signal has another unit than the map says."""
OUTLIER = 1.5
"""How far out of the range of most values an outlier lies, in widths of that range."""
MOST_REPEATED = 0.05
"""Largest share of the instants that may be in a log twice."""

Drift = Annotated[float, Field(ge=-0.2, le=0.2)]
_NUMERIC = ("double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
_FILTERS = {1, 2, 3}  # deflate, shuffle and checksums, which HDF5 has itself
_UNIT = re.compile(r"[_ (\[]+([A-Za-z/%1]+)[)\]]?$")


class Column(Section):
    """What a column of a log is, as its entry under ``[map]``."""

    signal: Line = Field(description="the signal of the run, as stretch_length[1, left]")
    unit: Line | None = Field(
        default=None, description="unit of the column; none: the end of its name, as in length_mm"
    )
    scale: float | None = Field(default=None, description="SI units of the signal in one of the column's, as m per rad")
    offset: float | Literal["free"] = Field(
        default=0.0, description="added to the column, in the signal's SI unit; free: means are made equal"
    )
    distance_to: Line | None = Field(default=None, description="another tracked point: the column is their distance")


class LogMap(Section):
    """What the columns of a log are; the whole of a map."""

    time: Line | None = Field(default=None, description="column of the time; its unit is the end of its name")
    time_unit: Line | None = Field(default=None, description="unit of the time where its name has none")
    rate_Hz: Positive | None = Field(default=None, description="rows a second, in place of a column of the time")
    m_per_px: Positive | None = Field(default=None, description="metres in a pixel, for tracked points")
    least_likelihood: Share = Field(default=0.6, description="tracked points that are less likely are gaps")
    lag_s: float | Literal["free"] = Field(
        default="free", description="time of the run less time of the log, s; free: where both agree best"
    )
    clock_drift: Drift | Literal["free"] = Field(
        default=0.0, description="how much faster than true the log's clock runs; free: fitted"
    )
    map: Mapping[str, Column] = Field(description="what each column is")

    @model_validator(mode="before")
    @classmethod
    def _spelt_out(cls, given: object) -> object:
        """Takes a text for a column that only names its signal."""
        if not isinstance(given, Mapping) or not isinstance(named := given.get("map"), Mapping):
            return given
        return {**given, "map": {c: {"signal": own} if isinstance(own, str) else own for c, own in named.items()}}


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


def read_map(path: str | Path) -> LogMap:
    """Reads a map.

    Raises:
        ConfigError: It cannot be read, has an unknown field, or maps nothing.
    """
    read = check_section(LogMap, read_toml(Path(path), "the map"))
    if not read.map:
        raise ConfigError(f'{path} maps no column: write one under [map], as s1_left_mm = "stretch_length[1, left]"')
    if (read.time is None) == (read.rate_Hz is None):
        raise ConfigError(f"{path} needs either time, the column of the time, or rate_Hz, rows a second")
    return read


def read_measured(path: str | Path, log_map: LogMap) -> Measured:
    """Reads a log by a map.

    Args:
        path: A table: CSV with any separator, a decimal comma too; Parquet; MATLAB (vectors of equal length, not v7.3);
            netCDF; tables of DeepLabCut (CSV) and SLEAP (CSV, or analysis HDF5), whose points are ``NAME.x, NAME.y``.
        log_map: What its columns are.

    Raises:
        ConfigError: A column is missing or has a unit that is not known.
        UnreadableText: The file cannot be read, a cell is no number, or the time goes back.
        MissingDependency: A format needs a package that is not installed.
    """
    table, notes = _table(Path(path)), []
    time_s, rows = _instants(table, log_map, str(path), notes)
    read = {name: _series(name, column, table, log_map, str(path)) for name, column in log_map.map.items()}
    values = {name: series[rows] for name, (series, _) in read.items()}
    time_s, values = _once(time_s, values, str(path), notes)
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


def _unit(name: str, given: str | None, what: str) -> tuple[str, float]:
    """What a unit measures, and its factor; from the end of the column's name where the map gives none."""
    found = _UNIT.search(name)
    unit = given or (found[1] if found else "")
    if unit in UNITS:
        return UNITS[unit]
    if given:
        raise ConfigError(f"{what} = {shown(given)} is no known unit: it is one of {listed(list(UNITS))}")
    raise ConfigError(
        f'the unit of column {shown(name)} is not known: end its name in one, as _mm, or write {what} = "mm"'
    )


def _numbers(table: DataFrame, name: str, path: str) -> Array:
    """A column as numbers, NaN where a cell is empty."""
    column = table[name]
    numbers = np.asarray(pandas.to_numeric(column, errors="coerce"), dtype=float)
    bad = np.flatnonzero(np.isnan(numbers) & column.notna().to_numpy())
    bad = [row for row in bad if str(column.iloc[row]).strip().lower() not in ("", "nan", "na", "-", "null", "none")]
    if bad:
        raise UnreadableText(
            f"row {bad[0] + 1} of {shown(name)} in {path} is no number: {shown(str(column.iloc[bad[0]]))}"
        )
    return np.where(np.isinf(numbers), np.nan, numbers)


def _series(name: str, column: Column, table: DataFrame, log_map: LogMap, path: str) -> tuple[Array, str]:
    """A column, or what two columns of a tracked point give, in SI units, and in which."""
    points = [name] if column.distance_to is None else [name, column.distance_to]
    places = [_point(point, table, log_map, path) for point in points] if name not in table else []
    if places and (log_map.m_per_px is None and (column.unit or "px") == "px"):
        raise ConfigError(f"{name} is a tracked point: the map needs m_per_px, the metres in a pixel")
    if places:
        kind, factor = UNITS["px"] if column.unit is None else _unit(name, column.unit, f"map.{name}.unit")
        factor, kind = (factor * (log_map.m_per_px or 1.0), "m") if kind == "px" else (factor, kind)
        away = places[0] - (places[1] if len(places) > 1 else places[0][np.isfinite(places[0]).all(axis=1)][:1])
        if len(places) > 1:
            values = np.hypot(*away.T)
        else:
            net = np.nanmean(away[-max(len(away) // 10, 1) :], axis=0)
            values = away @ (net / (np.hypot(*net) or 1.0))
    else:
        kind, factor = _unit(name, column.unit, f"map.{name}.unit")
        values = _numbers(table, name, path)
    scale = 1.0 if column.scale is None else column.scale
    shift = 0.0 if column.offset == "free" else column.offset
    return factor * scale * values + shift, kind


def _point(name: str, table: DataFrame, log_map: LogMap, path: str) -> Array:
    """A tracked point's place, ``(n, 2)``, NaN where it is unlikely."""
    for form in ("{}.{}", "{}_{}", "{} {}"):
        axes = [form.format(name, axis) for axis in "xy"]
        if all(axis in table for axis in axes):
            place = np.stack([_numbers(table, axis, path) for axis in axes], axis=1)
            for certainty in ("likelihood", "score"):
                if (column := form.format(name, certainty)) in table:
                    place[~(_numbers(table, column, path) >= log_map.least_likelihood)] = np.nan
            return place
    raise ConfigError(f"{path} has no column {shown(name)}: {suggest(name, [str(one) for one in table.columns])}")


def _instants(table: DataFrame, log_map: LogMap, path: str, notes: list[str]) -> tuple[Array, np.ndarray]:
    """Times of the rows that have one, s, and which rows these are."""
    if log_map.time is None:
        return np.arange(len(table)) / float(log_map.rate_Hz or 1.0), np.ones(len(table), dtype=bool)
    if log_map.time not in table:
        offered = suggest(log_map.time, [str(one) for one in table.columns])
        raise ConfigError(f"{path} has no column {shown(log_map.time)}: {offered}")
    column = table[log_map.time]
    if column.dtype.kind not in "fiu" and column.astype(str).str.contains(r"\d[-/:T]\d").mean() > 0.5:
        dates = pandas.to_datetime(column, errors="coerce", format="ISO8601", utc=True)
        time_s = (dates - dates.dropna().iloc[0]).dt.total_seconds().to_numpy() if dates.notna().any() else np.empty(0)
    else:
        kind, factor = _unit(log_map.time, log_map.time_unit, "time_unit")
        if kind != "s":
            raise ConfigError(
                f"time_unit = {shown(log_map.time_unit or log_map.time)} is no unit of time: s, ms, us or min"
            )
        time_s = factor * _numbers(table, log_map.time, path)
    dated = np.isfinite(time_s)
    if dated.sum() < 8:
        raise UnreadableText(f"{path} has {dated.sum()} rows with a time: too few to compare")
    if not dated.all():
        notes.append(f"{(~dated).sum()} rows without a time left out")
    back = np.flatnonzero(np.diff(time_s[dated]) < 0)
    if back.size:
        at = time_s[dated][back[0] : back[0] + 2]
        raise UnreadableText(
            f"the time in {path} goes back, from {at[0]:g} to {at[1]:g} s: cut it where it starts again"
        )
    return time_s[dated], dated


def _once(time_s: Array, values: dict[str, Array], path: str, notes: list[str]) -> tuple[Array, dict[str, Array]]:
    """Takes the mean of rows with the same time."""
    instants, first, count = np.unique(time_s, return_inverse=True, return_counts=True)
    repeated = len(time_s) - len(instants)
    if repeated > MOST_REPEATED * len(time_s):
        raise UnreadableText(f"{repeated} of {len(time_s)} rows in {path} repeat the time before: is it too coarse?")
    if not repeated:
        return time_s, values
    notes.append(f"{repeated} rows that repeat a time are averaged")
    return instants, {name: np.bincount(first, weights=series) / count for name, series in values.items()}


def _table(path: Path) -> DataFrame:
    """A file as a table of named columns."""
    try:
        size = path.stat().st_size if path.is_file() else -1
    except OSError as error:
        raise UnreadableText(f"cannot read {path}: {error.strerror}") from None
    if size < 0:
        raise UnreadableText(f"cannot read {path}: there is no such file")
    _refuse_large(size, path)
    read = _READERS.get(path.suffix.lower(), _text_table)
    try:
        table = read(path)
    except (UnreadableText, MissingDependency):
        raise
    except ImportError as error:
        raise MissingDependency(
            f"cannot read {path}: {error.name} is missing, install it with: pip install 'annelid[export]'"
        ) from None
    except Exception as error:  # a reader of a foreign format raises what it likes on a damaged file
        raise UnreadableText(f"cannot read {path}: {str(error).splitlines()[0] if str(error) else 'damaged'}") from None
    if len(table) == 0:
        raise UnreadableText(f"{path} has no rows")
    twice = table.columns[table.columns.duplicated()]
    if len(twice):
        raise UnreadableText(f"{path} has two columns {shown(str(twice[0]))}: rename one")
    return table


def _text_table(path: Path) -> DataFrame:
    """A table in text, separated by semicolons, tabs, commas or spaces; where it is no comma, one may be the point."""
    with path.open(encoding="utf-8-sig") as file:
        lines = [line for line in (file.readline(100_000) for _ in range(60)) if line.strip() and line[0] != "#"]
    if not lines:
        raise UnreadableText(f"{path} has no rows")
    first, body = lines[0], lines[1:] or lines
    separator = next((one for one in (";", "\t", ",") if one in first), r"\s+")
    decimal = "," if separator != "," and sum(bool(re.search(r"\d,\d", line)) for line in body) > len(body) / 2 else "."
    options = {
        "sep": separator,
        "decimal": decimal,
        "comment": "#",
        "encoding": "utf-8-sig",
        "skipinitialspace": True,
        "compression": None,
    }
    cells = [cell.strip().lower() for cell in first.split(separator)] if separator != r"\s+" else []
    if cells[:1] == ["scorer"]:
        # DeepLabCut: rows of scorer, body part and coordinate above the numbers.
        table = pandas.read_csv(path, header=[1, 2], index_col=0, **options)
        table.columns = [f"{part}.{axis}" for part, axis in table.columns]
        return table
    if all(
        re.fullmatch(r"[-+\d.,eE]+", cell.strip()) for cell in first.split(None if separator == r"\s+" else separator)
    ):
        raise UnreadableText(f"{path} has no header: write the names of its columns into the first line")
    table = pandas.read_csv(path, header=0, index_col=False, **options)
    names = [name.strip().strip('"') for name in first.split(None if separator == r"\s+" else separator)]
    if len(names) == len(table.columns):
        # As they stand: pandas gives the second of two equal names a number.
        table.columns = names
    if "frame_idx" in table and "track" in table:
        # SLEAP: one row an instance and frame; frames without one are gaps.
        if table["track"].nunique(dropna=False) > 1:
            raise UnreadableText(f"{path} has {table['track'].nunique(dropna=False)} tracks: export one")
        last = int(table["frame_idx"].max())
        _refuse_large(8 * (last + 1) * len(table.columns), path)
        return table.set_index("frame_idx").reindex(range(last + 1)).drop(columns="track")
    return table


def _parquet(path: Path) -> DataFrame:
    from pyarrow.parquet import read_metadata

    about = read_metadata(path)
    _refuse_large(8 * about.num_rows * about.num_columns, path)
    return pandas.read_parquet(path, engine="pyarrow")


def _matlab(path: Path) -> DataFrame:
    from scipy.io import loadmat, whosmat

    try:
        vectors = {name: shape for name, shape, kind in whosmat(path) if kind in _NUMERIC and max(shape) == prod(shape)}
        _refuse_large(8 * sum(map(prod, vectors.values())), path)
        found = loadmat(path, squeeze_me=True, variable_names=[*vectors])
    except NotImplementedError:  # what SciPy says of version 7.3
        raise UnreadableText(f"cannot read {path}: it is of MATLAB's version 7.3, save it with -v7") from None
    return pandas.DataFrame(_equally_long({name: found[name] for name in vectors}, path))


def _netcdf(path: Path) -> DataFrame:
    with h5py.File(path, "r") as file:
        _check_hdf5(file, path)
    with xarray.open_dataset(path, engine="h5netcdf", decode_times=False, phony_dims="sort") as opened:
        return pandas.DataFrame(_equally_long({str(name): v.values for name, v in opened.variables.items()}, path))


def _sleap(path: Path) -> DataFrame:
    """SLEAP's analysis file: places of all nodes of one track."""
    with h5py.File(path, "r") as file:
        _check_hdf5(file, path)
        if "tracks" not in file or "node_names" not in file:
            raise UnreadableText(f"{path} is no analysis file of SLEAP; export a DeepLabCut file as CSV")
        places, names = np.asarray(file["tracks"], dtype=float), np.asarray(file["node_names"])
    if places.ndim != 4 or len(places) != 1:
        raise UnreadableText(f"{path} has {len(places)} tracks: export one")
    nodes = [name.decode() if isinstance(name, bytes) else str(name) for name in names]
    return pandas.DataFrame(
        {f"{node}.{axis}": places[0, j, i] for i, node in enumerate(nodes) for j, axis in enumerate("xy")}
    )


def _check_hdf5(file: h5py.File, path: Path) -> None:
    """Refuses variables that lie in other files, need code of others to unpack, or are too large in memory."""
    n_bytes = 0
    for name in file:
        if type(file.get(name, getlink=True)) is not HardLink:
            raise UnreadableText(f"cannot read {path}: {shown(name)} is a link to elsewhere")
        if isinstance(part := file[name], Dataset):
            made = part.id.get_create_plist()
            filters = {made.get_filter(index)[0] for index in range(made.get_nfilters())}
            if made.get_external_count() or made.get_layout() == VIRTUAL or not filters <= _FILTERS:
                raise UnreadableText(f"cannot read {path}: {shown(name)} lies elsewhere, or is packed in a rare way")
            n_bytes += part.nbytes
    _refuse_large(n_bytes, path)


def _refuse_large(n_bytes: int, path: Path) -> None:
    if n_bytes > MOST_BYTES:
        raise UnreadableText(f"cannot read {path}: it holds {n_bytes / 1e6:.0f} MB, more than {MOST_BYTES / 1e6:.0f}")


def _equally_long(found: Mapping[str, object], path: Path) -> dict[str, Array]:
    """The vectors of numbers that are as long as the longest."""
    arrays = {name: np.asarray(value) for name, value in found.items()}
    vectors = {name: one for name, one in arrays.items() if one.ndim == 1 and one.dtype.kind in "fiub"}
    longest = max(map(len, vectors.values()), default=0)
    if not longest:
        raise UnreadableText(f"{path} has no vector of numbers")
    return {name: one.astype(float) for name, one in vectors.items() if len(one) == longest}


_READERS: dict[str, Callable[[Path], DataFrame]] = {
    ".parquet": _parquet, ".mat": _matlab, ".nc": _netcdf, ".h5": _sleap, ".hdf5": _sleap
}  # fmt: skip

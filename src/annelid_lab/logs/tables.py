"""Files of measured data as tables: text in its usual forms, Excel, Parquet, MATLAB, netCDF, SLEAP, WCON.

Pandas, SciPy and xarray read the formats. Done here is what they leave open: which line of a text is its header,
whether commas are decimal, and what would be read wrong in silence.
"""

from __future__ import annotations

import csv
import gzip
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas
import xarray
from h5py.h5d import VIRTUAL
from pandas import DataFrame

from annelid.errors import MissingDependency, UnreadableText, shown
from annelid.protocols import Array
from annelid_lab.logs.maps import UNITS, plain_unit

MOST_BYTES = 300_000_000
"""Of a log that is read, and of each of its parts in memory: a compressed file may be small and hold terabytes."""
MOST_HEAD = 60
"""Lines among which the header is looked for."""
_NUMBER = re.compile(r"[-+]?[\d.,]+(?:[eE][-+]?\d+)?")
_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
_THOUSANDS = r"[-+]?[1-9]\d{0,2}(?:\.\d{3})+(?:,\d+)?"
_EMPTY = ("", "nan", "na", "-", "null", "none")
_SERIAL_MONITOR = re.compile(r"^\d+:\d\d:\d\d\.\d+ -> ", re.MULTILINE)
_NUMERIC = ("double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)))
_SLEAP_NAMES = ("node_names", "track_names")
_FILTERS = {1, 2, 3}  # deflate, shuffle and checksums, which HDF5 has itself

Names = list[str]
Score = Callable[[Sequence[str]], int]
"""How many of the columns that are looked for a header's names have."""


@dataclass
class LogTable:
    """A file as a table.

    Attributes:
        path: Of the file.
        cells: The columns by name; a point of a tracker has ``NAME.x``, ``NAME.y`` and so on.
        units: Units that stand in a row of their own, by column.
        notes: What was handled, a sentence each.
        decimal: The decimal sign of columns of text.
        above: The lines above the header of a text.
    """

    path: Path
    cells: DataFrame
    units: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    decimal: str = "."
    above: str = ""

    @property
    def names(self) -> Names:
        """Names of the columns."""
        return [str(name) for name in self.cells.columns]

    def numbers(self, name: str) -> Array:
        """Returns a column as numbers, ``(n,)``, NaN where a cell is empty.

        Raises:
            UnreadableText: A cell is no number.
        """
        column = self.cells[name]
        if column.dtype.kind in "fiub":
            numbers = column.to_numpy(dtype=float)
            return np.where(np.isinf(numbers), np.nan, numbers)
        text = column.astype(str).str.strip()
        plain = text
        if self.decimal == ",":
            grouped = text.str.fullmatch(_THOUSANDS)
            plain = text.where(~grouped, text.str.replace(".", "", regex=False))
            # A point that does not group thousands makes no number here.
            plain = plain.str.replace(".", "?", regex=False).str.replace(",", ".", regex=False)
        numbers = np.asarray(pandas.to_numeric(plain, errors="coerce"), dtype=float)
        bad = np.flatnonzero(np.isnan(numbers) & ~(column.isna() | text.str.lower().isin(_EMPTY)).to_numpy())
        if bad.size:
            cell = shown(str(column.iloc[bad[0]]))
            raise UnreadableText(f"row {bad[0] + 1} of {shown(name)} in {self.path} is no number: {cell}")
        return np.where(np.isinf(numbers), np.nan, numbers)


def read_table(path: Path, score: Score, individual: str | None = None) -> LogTable:
    """Reads a file.

    Args:
        path: The file.
        score: Finds the header of a text among its first lines.
        individual: Which track of a tracker's file, where it has several.

    Raises:
        UnreadableText: It cannot be read, or would be read wrong.
        MissingDependency: Its format needs a package that is not installed.
    """
    try:
        size = path.stat().st_size if path.is_file() else -1
    except OSError as error:
        raise UnreadableText(f"cannot read {path}: {error.strerror}") from None
    if size < 0:
        raise UnreadableText(f"cannot read {path}: there is no such file")
    _refuse_large(size, path)
    try:
        read = _READERS.get(path.suffix.lower())
        if read is None:
            table = _with_header(path, score)
        else:
            cells = read(path)
            table = LogTable(path, cells, cells.attrs.get("units", {}))
        if {"frame_idx", "track"} <= set(table.names):
            table.cells = _of_one_track(table, individual)
    except (UnreadableText, MissingDependency):
        raise
    except ImportError as error:
        extra = " or ".join(filter(None, (error.name and f"pip install {error.name}", "pip install 'annelid[export]'")))
        raise MissingDependency(f"cannot read {path}: {error.name or error} is missing: {extra}") from None
    except Exception as error:  # a reader of a foreign format raises what it likes on a damaged file
        raise UnreadableText(f"cannot read {path}: {str(error).splitlines()[0] if str(error) else 'damaged'}") from None
    if len(table.cells) == 0:
        raise UnreadableText(f"{path} has no rows")
    twice = table.cells.columns[table.cells.columns.duplicated()]
    if len(twice):
        raise UnreadableText(f"{path} has two columns {shown(str(twice[0]))}: rename one")
    return table


def _with_header(path: Path, score: Score) -> LogTable:
    """A text, or a sheet of Excel, whose header is the line that has most of what is looked for."""
    notes: Names = []
    if path.suffix.lower() in (".xlsx", ".xls", ".ods"):
        sheet = pandas.read_excel(path, header=None, dtype=str)
        head = sheet.head(MOST_HEAD).fillna("").to_numpy().tolist()
        place, above, names = _header(head, score, path)
        rows, cells, decimal = head[place + 1 :], sheet.iloc[place + 1 :].reset_index(drop=True), "."
    else:
        lines = _lines(path, notes)
        head = [_split(line, _separator(line)) for line in lines[:MOST_HEAD]]
        place, above, names = _header(head, score, path)
        separator, lines = _separator(lines[place]), lines[place + 1 :]
        lines = [line for line in lines if line[0] not in "#%"]
        rows = [_split(line, separator) for line in lines[:MOST_HEAD]]
        decimal = _decimal(rows, separator, path)
        width = max([len(names), *map(len, rows)])
        cells = pandas.read_csv(
            StringIO("\n".join(lines)), sep=separator, names=range(width), dtype=str, skipinitialspace=True
        ) if lines else DataFrame(columns=range(width))  # fmt: skip
    _refuse_unlike(names, rows, path)
    cells = cells.iloc[:, : len(names)].set_axis(names, axis=1)
    cells = cells.loc[:, [bool(name) for name in names]]
    units = {}
    first = dict(zip(names, rows[0], strict=False)) if rows else {}
    if first and all(not cell.strip() or plain_unit(cell) in UNITS for cell in first.values()) and any(first.values()):
        units = {name: plain_unit(cell) for name, cell in first.items() if cell.strip()}
    if units and not all(_NUMBER.fullmatch(cell) for cell in units.values()):
        cells = cells.iloc[1:].reset_index(drop=True)
    else:
        units = {}
    if place - above > 1:
        notes.append(f"{place - above} lines above the header left out")
    return LogTable(path, cells, units, notes, decimal, "\n".join(" ".join(row) for row in head[:place]))


def _lines(path: Path, notes: Names) -> Names:
    """The lines of a text that are not empty, without what a serial monitor has written before each."""
    with (gzip.open if path.suffix.lower() == ".gz" else open)(path, "rb") as file:
        data = file.read(MOST_BYTES + 1)
    _refuse_large(len(data), path)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("cp1252")
    if "\0" in text:
        raise UnreadableText(f"cannot read {path}: it is no text")
    if _SERIAL_MONITOR.match(text):
        text = _SERIAL_MONITOR.sub("", text)
        notes.append("the times of the serial monitor before each line left out")
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        raise UnreadableText(f"{path} has no rows")
    return lines


def _separator(line: str) -> str:
    return next((one for one in (";", "\t", ",") if one in line), r"\s+")


def _split(line: str, separator: str) -> Names:
    if separator == r"\s+":
        line, separator = " ".join(line.split()), " "
    return next(csv.reader([line], delimiter=separator, skipinitialspace=True))


def _header(head: Sequence[Names], score: Score, path: Path) -> tuple[int, int, Names]:
    """Which row is the header, how many above belong to it, as those of points over their coordinates; its names."""
    best, found = 0, (0, 0, [""])
    for place, row in enumerate(head):
        own = [cell.strip() for cell in row]
        if own and own[0][:1] in ("#", "%"):
            own = [own[0].lstrip("#% "), *own[1:]] if own[0].lstrip("#% ") else own[1:]
        if all(_NUMBER.fullmatch(cell) for cell in own):
            continue
        above = [_filled(other) for other in reversed(head[max(place - 5, 0) : place]) if len(other) == len(row)]
        # The row alone, below one other, or below two neighbours, as individuals over points.
        for rows in ((), *((one,) for one in above), *zip(above[1:], above, strict=False)):
            names = [".".join(filter(None, parts)) for parts in zip(*rows, own, strict=True)] if rows else own
            if (now := score(names)) > best:
                best, found = now, (place, len(rows), names)
    if best:
        return found
    place = next((n for n, row in enumerate(head) if row and row[0][:1] not in ("#", "%", "")), 0)
    names = [cell.strip() for cell in head[place]]
    if all(_NUMBER.fullmatch(name) for name in names):
        raise UnreadableText(f"{path} has no header: write the names of its columns into the first line")
    return place, 0, names


def _filled(row: Names) -> Names:
    """A row whose empty cells repeat the one before, as those of points over their coordinates."""
    filled, last = [], ""
    for cell in row:
        last = cell.strip() or last
        filled.append(last)
    return filled


def _refuse_unlike(names: Names, rows: Sequence[Names], path: Path) -> None:
    """Refuses a header that has more or fewer names than the rows have cells, so that none is at another's column."""
    while names and not names[-1]:
        names.pop()
    for number, row in enumerate(rows, start=1):
        if any(cell.strip() for cell in row[len(names) :]):
            raise UnreadableText(
                f"row {number} of {path} has {len(row)} cells, its header {len(names)} names: "
                f"name every column; the row is {shown(' '.join(row)[:80])}"
            )
    if rows and max(map(len, rows)) < len(names):
        raise UnreadableText(
            f"the header of {path} has {len(names)} names, its rows have {max(map(len, rows))} cells: "
            f"leave out what is no column; it is {shown(' '.join(names)[:80])}"
        )


def _decimal(rows: Sequence[Names], separator: str, path: Path) -> str:
    """The decimal sign: a comma where numbers have one."""
    commas = [cell.strip() for row in rows for cell in row if _COMMA.fullmatch(cell.strip())]
    if separator == "," and commas and all(len(cell.rpartition(",")[2]) == 3 for cell in commas):
        raise UnreadableText(
            f"{shown(commas[0])} in {path} may be a decimal comma or thousands: write points for decimals, or "
            "semicolons between columns"
        )
    return "," if commas else "."


def _of_one_track(table: LogTable, individual: str | None) -> DataFrame:
    """A table of SLEAP, one row an instance and frame, as one row a frame; frames without one are gaps."""
    tracks = table.cells["track"].fillna("").astype(str)
    names = sorted(set(tracks))
    if individual is None and len(names) > 1:
        raise UnreadableText(several(table.path, names))
    mine = table.cells[tracks == (names[0] if individual is None else individual)]
    frames = np.asarray(mine["frame_idx"], dtype=float).astype(int)
    if not len(frames):
        raise UnreadableText(several(table.path, names))
    _refuse_large(8 * (int(frames.max()) + 1) * len(mine.columns), table.path)
    return mine.set_index(frames).drop(columns=["track", "frame_idx"]).reindex(range(int(frames.max()) + 1))


def several(path: Path, individuals: Sequence[str]) -> str:
    """Says that a file has several individuals, and how one is chosen."""
    first = next(iter(individuals), "")
    return f'{path} has the individuals {", ".join(map(shown, individuals))}: write individual = "{first}" in the map'


def _parquet(path: Path) -> DataFrame:
    from pyarrow.parquet import read_metadata

    about = read_metadata(path)
    _refuse_large(8 * about.num_rows * about.num_columns, path)
    return pandas.read_parquet(path, engine="pyarrow")


def _matlab(path: Path) -> DataFrame:
    from scipy.io import loadmat, whosmat

    try:
        shapes = {name: shape for name, shape, kind in whosmat(path) if kind in (*_NUMERIC, "struct")}
        _refuse_large(8 * sum(map(prod, shapes.values())), path)
        found = loadmat(path, simplify_cells=True, variable_names=[*shapes])
    except NotImplementedError:  # what SciPy says of version 7.3, which is HDF5
        return _hdf5(path)
    return _equally_long(_flat(found), path)


def _flat(found: Mapping[str, Any]) -> dict[str, Any]:
    """Variables, and the fields of structs by their own names."""
    structs = {name: value for name, value in found.items() if isinstance(value, Mapping)}
    flat = {name: value for name, value in found.items() if name not in structs and not name.startswith("__")}
    for fields in structs.values():
        flat |= {name: value for name, value in _flat(fields).items() if name not in flat}
    return flat


def _hdf5(path: Path) -> DataFrame:
    """HDF5: SLEAP's analysis file, poses that movement has written, netCDF, or MATLAB's version 7.3."""
    with h5py.File(path, "r") as file:
        parts = _checked_parts(file, path)
        if {"tracks", "node_names"} <= parts.keys():
            return _sleap(parts)
        is_matlab, is_poses = "MATLAB_class" in next(iter(parts.values())).attrs, "keypoints" in parts
        if is_matlab:
            return _equally_long({name.rpartition("/")[2]: np.squeeze(part[...]) for name, part in parts.items()}, path)
    with xarray.open_dataset(path, engine="h5netcdf", decode_times=False, phony_dims="sort") as data:
        return _poses(data) if is_poses else _equally_long({str(n): v.values for n, v in data.variables.items()}, path)


def _poses(data: xarray.Dataset) -> DataFrame:
    """Poses as movement keeps those of every tracker: ``position`` over time, space, keypoints and individuals."""
    table: dict[str, Any] = {"time": data["time"].values}
    for individual in data["individuals"].values:
        for point in data["keypoints"].values:
            one = data.sel(individuals=individual, keypoints=point)
            table |= {f"{individual}.{point}.{axis}": one["position"].sel(space=axis) for axis in data["space"].values}
            if "confidence" in data:
                table[f"{individual}.{point}.confidence"] = one["confidence"]
    return DataFrame({name: np.asarray(values, dtype=float) for name, values in table.items()})


def _sleap(parts: Mapping[str, h5py.Dataset]) -> DataFrame:
    """SLEAP's analysis file, whose arrays are of tracks, coordinates, nodes and frames, or the other way round."""
    nodes, tracks = ([text.decode() for text in parts[name]] if name in parts else [] for name in _SLEAP_NAMES)
    places = np.asarray(parts["tracks"], dtype=float)
    scores = np.asarray(parts["point_scores"], dtype=float) if "point_scores" in parts else None
    if places.shape[-2:] == (len(nodes), 2):
        places = places.transpose(1, 3, 2, 0)
        scores = None if scores is None else scores.transpose(1, 2, 0)
    tracks = tracks if len(tracks) == len(places) else [f"track_{number}" for number in range(len(places))]
    table: dict[str, Array] = {}
    for number, track in enumerate(tracks):
        for place, node in enumerate(nodes):
            table |= {f"{track}.{node}.{axis}": places[number, i, place] for i, axis in enumerate("xy")}
            if scores is not None:
                table[f"{track}.{node}.score"] = scores[number, place]
    return DataFrame(table)


def _wcon(path: Path) -> DataFrame:
    """WCON, the format of worm trackers: the points along one worm over time, ``point_1`` the first."""
    data = json.loads(path.read_text(encoding="utf-8"))
    records = data["data"] if isinstance(data["data"], list) else [data["data"]]
    if len({str(one.get("id")) for one in records}) > 1:
        raise UnreadableText(f"{path} has several worms: keep one")
    columns, units = {"t": np.concatenate([np.atleast_1d(one["t"]) for one in records])}, {"t": data["units"]["t"]}
    for axis in "xy":
        parts = [np.reshape(one[axis], (np.size(one["t"]), -1)) for one in records]
        origins = [np.reshape(one.get(f"o{axis}", 0.0), (-1, 1)) for one in records]
        places = np.concatenate([part + origin for part, origin in zip(parts, origins, strict=True)])
        columns |= {f"point_{number}.{axis}": place for number, place in enumerate(places.T, start=1)}
    units |= {name: data["units"][name[-1]] for name in columns if name != "t"}
    table = DataFrame(columns)
    table.attrs["units"] = units
    return table


def _checked_parts(file: h5py.File, path: Path) -> dict[str, h5py.Dataset]:
    """The arrays of an HDF5 file; refuses what lies elsewhere, needs code of others to unpack, or is too large."""
    links: dict[str, object] = {}
    file.visititems_links(lambda name, link: links.update({name: link}))
    parts: dict[str, h5py.Dataset] = {}
    for name, link in links.items():
        if not isinstance(link, h5py.HardLink):
            raise UnreadableText(f"cannot read {path}: {shown(name)} is a link to elsewhere")
        if isinstance(part := file[name], h5py.Dataset):
            made = part.id.get_create_plist()
            filters = {made.get_filter(index)[0] for index in range(made.get_nfilters())}
            if made.get_external_count() or made.get_layout() == VIRTUAL or not filters <= _FILTERS:
                raise UnreadableText(f"cannot read {path}: {shown(name)} lies elsewhere, or is packed in a rare way")
            parts[name] = part
    _refuse_large(sum(part.nbytes for part in parts.values()), path)
    if not parts:
        raise UnreadableText(f"{path} has no rows")
    return parts


def _refuse_large(n_bytes: int, path: Path) -> None:
    if n_bytes > MOST_BYTES:
        raise UnreadableText(f"cannot read {path}: it holds {n_bytes / 1e6:.0f} MB, more than {MOST_BYTES / 1e6:.0f}")


def _equally_long(found: Mapping[str, object], path: Path) -> DataFrame:
    """The vectors of numbers that are as long as the longest."""
    arrays = {name: np.asarray(value) for name, value in found.items()}
    vectors = {name: one for name, one in arrays.items() if one.ndim == 1 and one.dtype.kind in "fiub"}
    longest = max(map(len, vectors.values()), default=0)
    if not longest:
        matrix = next((name for name, one in arrays.items() if one.ndim == 2), None)
        found_one = f"{shown(matrix)} is a matrix without names: " if matrix else ""
        raise UnreadableText(
            f"{path} has no vector of numbers: {found_one}save each column as its own variable, as in "
            "t = data(:, 1), or a table T as S = table2struct(T, 'ToScalar', true)"
        )
    return DataFrame({name: one.astype(float) for name, one in vectors.items() if len(one) == longest})


_READERS: dict[str, Callable[[Path], DataFrame]] = {
    ".parquet": _parquet, ".mat": _matlab, ".nc": _hdf5, ".h5": _hdf5, ".hdf5": _hdf5, ".wcon": _wcon
}  # fmt: skip

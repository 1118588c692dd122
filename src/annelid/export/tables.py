"""The part of a run that is wanted, as tidy tables in CSV or Parquet, or as one MATLAB file."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import xarray as xr

from annelid.draw.render import Progress
from annelid.errors import RunFileError, suggest
from annelid.output import plain_cell, whole_file, write_json
from annelid.simulation.runfile import Run
from annelid.text import numbered

if TYPE_CHECKING:
    from pandas import DataFrame


CLOCKS = {"time": "time", "frame": "frame_time"}
"""Dimensions that go with time, and the variable that has it."""
ABOUT = "about.json"
LONGEST_NAME = 63
"""Characters that MATLAB reads of a name."""
STRUCTS = ("units", "long_name", "dimensions", "labels", "config", "run")

Table: TypeAlias = "tuple[DataFrame, dict[str, tuple[str, str]]]"
"""Signals of the same dimensions, a column each, and unit and meaning of every column."""


@dataclass(frozen=True, slots=True)
class Selection:
    """What is wanted of a run.

    Attributes:
        signals: Names of signals; None for all.
        every: Keep every so many samples of the signals, and as many frames.
        start_s: From this simulated time on, s; None for the start.
        stop_s: Up to this time and with it, s; None for the end.
    """

    signals: Sequence[str] | None = None
    every: int = 1
    start_s: float | None = None
    stop_s: float | None = None


def selected(run: Run, selection: Selection) -> Run:
    """Returns a run cut down to a selection; labels and times stay with what they belong to.

    Args:
        run: The run.
        selection: What is wanted of it.

    Returns:
        The run with fewer signals, samples and frames.

    Raises:
        RunFileError: No signal has such a name, or the run has no sample in that time.
    """
    data = run.data
    for name in selection.signals or ():
        if name not in signal_names(data):
            raise RunFileError(f"the run has no signal {name!r}: {suggest(name, signal_names(data))}")
    if selection.every < 1:
        raise RunFileError(f"every = {selection.every}: keep every sample (1), or every so many")
    start, stop = selection.start_s, selection.stop_s
    for dim, clock in CLOCKS.items():
        times = data[clock].values
        # To within rounding.
        after = times >= (-np.inf if start is None else start - 1e-9)
        before = times <= (np.inf if stop is None else stop + 1e-9)
        data = data.isel({dim: np.flatnonzero(after & before)[:: selection.every]})
    if not data.sizes["time"]:
        times = run.data["time"].values
        if not times.size:
            raise RunFileError(f"{run.path} has no samples")
        asked = " ".join(
            f"{words} {bound:g} s" for words, bound in (("from", start), ("to", stop)) if bound is not None
        )
        raise RunFileError(f"{run.path} has no sample {asked}: it goes from {times[0]:g} to {times[-1]:g} s")
    if selection.signals is not None:
        data = data[[*dict.fromkeys(selection.signals), "frame_time"]]
    return run.with_data(data)


def signal_names(data: xr.Dataset) -> list[str]:
    """Returns the names of what was recorded, without labels and times."""
    return [str(name) for name in data.variables if name not in data.dims and name not in CLOCKS.values()]


def about(run: Run) -> dict[str, Any]:
    """Returns what a run is, as plain values: name, status, configuration, versions, and each signal's meaning."""
    return {
        "name": run.config.name,
        "status": run.status,
        "message": run.message,
        "signals": {
            name: {
                "units": str(run.data[name].attrs.get("units", "1")),
                "long_name": str(run.data[name].attrs.get("long_name", "")),
                "dimensions": [str(dim) for dim in run.data[name].dims],
            }
            for name in signal_names(run.data)
        },
        "attributes": {key: _plain(value) for key, value in run.data.attrs.items() if key != "config"},
        "configuration": run.config.model_dump(mode="json"),
    }


def _plain(value: Any) -> Any:
    """Returns an attribute as JSON can have it, a number that is not finite as None."""
    plain = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain


def tables_of(run: Run) -> dict[str, Table]:
    """Returns a table for every combination of dimensions, by these joined, such as ``time_segment_sensor``.

    It has a column for each dimension, with its times or labels, and for each signal; the last dimension counts
    fastest. Beside it stand unit and meaning of each column; labels have no unit.
    """
    signals, frame_times = about(run)["signals"], run.data["frame_time"]
    data = run.data.drop_vars("frame_time").assign_coords(frame=frame_times.values)
    clocks = {"time": run.data["time"].attrs, "frame": frame_times.attrs}
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, meaning in signals.items():
        groups.setdefault(tuple(meaning["dimensions"]), []).append(name)
    tables: dict[str, Table] = {}
    for dims, names in groups.items():
        if dims:
            columns = {name: (signals[name]["units"], signals[name]["long_name"]) for name in names}
            for dim in dims:
                time = "s", str(clocks.get(dim, {}).get("long_name", "simulated time"))
                columns["time" if dim in clocks else dim] = time if dim in clocks else ("", f"label of each {dim}")
            values = data[names].to_dataframe(dim_order=list(dims)).reset_index().rename(columns={"frame": "time"})
            tables["_".join(dims)] = values, columns
    return tables


def write_csv_tables(run: Run, path: Path, progress: Progress) -> list[Path]:
    """Writes a run's tables as CSV with units in the headers and numbers with all the digits that they have.

    A folder gets ``about.json`` besides, which says what the run is.
    """

    def write(table: Table, file: Path) -> None:
        values, columns = table
        words = values.select_dtypes(exclude="number").columns
        values = values.assign(**{name: values[name].map(plain_cell) for name in words})
        header = [plain_cell(f"{name} ({columns[name][0]})" if columns[name][0] else name) for name in values]
        with whole_file(file) as draft:
            values.to_csv(draft, header=header, index=False, na_rep="nan", lineterminator="\n")

    written = _write_tables(run, path, ".csv", write, progress)
    return written if path in written else [*written, write_json(path / ABOUT, about(run))]


def write_parquet_tables(run: Run, path: Path, progress: Progress) -> list[Path]:
    """Writes a run's tables as Parquet, with ``units`` and ``long_name`` in every field's metadata.

    The schema's metadata has what the run is as JSON, under ``annelid``.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    facts = {"annelid": json.dumps(about(run))}

    def write(table: Table, file: Path) -> None:
        values, columns = table
        arrays = [pa.array(values[name].to_numpy()) for name in values]
        fields = [
            pa.field(name, array.type, metadata=dict(zip(("units", "long_name"), columns[name], strict=True)))
            for name, array in zip(values, arrays, strict=True)
        ]
        with whole_file(file) as draft:
            pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields, metadata=facts)), draft)

    return _write_tables(run, path, ".parquet", write, progress)


def _write_tables(
    run: Run, path: Path, suffix: str, write: Callable[[Table, Path], None], progress: Progress
) -> list[Path]:
    """Writes every table of a run into a folder, or its only one to a file."""
    tables = tables_of(run)
    alone = path.suffix.lower() == suffix
    if alone and len(tables) != 1:
        raise RunFileError(
            f"{path} is one file, but these signals make {len(tables)} tables ({', '.join(tables)}): name a folder, "
            "or choose signals of the same dimensions with --signals"
        )
    (path.parent if alone else path).mkdir(parents=True, exist_ok=True)
    files = {path if alone else path / f"{name}{suffix}": table for name, table in tables.items()}
    rows, done = [len(values) for values, _ in tables.values()], 0
    for (file, table), own in zip(files.items(), rows, strict=True):
        write(table, file)
        done += own
        progress(done, sum(rows))
    return list(files)


def write_matlab(run: Run, path: Path) -> Path:
    """Writes a run as one MATLAB file: a variable for every signal, and structs that say what they are.

    Signals keep their dimensions, time first. The structs ``units``, ``long_name`` and ``dimensions`` have a field for
    every signal, ``labels`` one for every dimension that has labels, ``config`` the configuration, and ``run`` how it
    ended and with which versions.
    """
    from scipy.io import savemat

    data, facts = run.data, about(run)
    names = matlab_names([*CLOCKS.values(), *signal_names(data)], taken=STRUCTS)
    meanings = facts["signals"] | {clock: {"units": "s", "dimensions": [dim]} for dim, clock in CLOCKS.items()}
    content: dict[str, Any] = {ours: np.asarray(data[name].values, dtype=float) for name, ours in names.items()}
    for struct in ("units", "long_name", "dimensions"):
        content[struct] = {ours: _matlab_value(meanings[name].get(struct, "")) for name, ours in names.items()}
    labelled = [str(dim) for dim in data.sizes if dim not in CLOCKS and dim in data.variables]
    content["labels"] = {matlab_names([dim])[dim]: _matlab_value(data[dim].values.tolist()) for dim in labelled}
    content["config"] = _matlab_value(facts["configuration"])
    content["run"] = _matlab_value({key: facts[key] for key in ("name", "status", "message")} | facts["attributes"])
    with whole_file(path) as draft:
        savemat(draft, content, long_field_names=True, do_compression=True, oned_as="column")
    return path


def matlab_names(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """Returns a legal and distinct MATLAB name for each name, none of those taken: letters, digits and underscores."""
    names, taken = list(names), list(taken)
    stems = [re.sub(r"\W", "_", name, flags=re.ASCII) for name in names]
    # Room for a number is left to all.
    stems = [(stem if stem[:1].isalpha() else f"x{stem}")[: LONGEST_NAME - 4] for stem in stems]
    return dict(zip(names, numbered([*taken, *stems])[len(taken) :], strict=True))


def _matlab_value(value: Any) -> Any:
    """Turns a plain value into what scipy writes as its MATLAB counterpart.

    Tables become structs, lists of numbers rows, other lists cells, and None the empty array.
    """
    if value is None:
        return np.empty((0, 0))
    if isinstance(value, Mapping):
        names = matlab_names(value)
        return {names[key]: _matlab_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        if value and all(map(_is_number, value)):
            return np.array([value], dtype=float)
        cells = np.empty((1, len(value)), dtype=object)
        for i, item in enumerate(value):
            cells[0, i] = _matlab_value(item)
        return cells
    return float(value) if _is_number(value) else value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)

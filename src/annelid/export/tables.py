"""A run's signals as tidy tables: one for all signals of the same dimensions, with a row for each of their values."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.export.selection import CLOCKS, signal_names
from annelid.output import whole_file, write_csv

if TYPE_CHECKING:
    import xarray as xr

    from annelid.simulation.runfile import Run

_CHUNK_ROWS = 20_000


class Column(NamedTuple):
    """One column of a table.

    Attributes:
        name: Name of the signal, or of the dimension that it labels; ``time`` for both clocks.
        units: Unit in the run file's form; empty for labels.
        long_name: What it is, in words.
        values: Shape ``(n_rows,)``.
    """

    name: str
    units: str
    long_name: str
    values: NDArray[Any]


Table = list[Column]
"""Signals of the same dimensions, time and labels first."""


def tables_of(run: Run) -> dict[str, Table]:
    """Returns a table for every combination of dimensions, by these joined, such as ``time_segment_sensor``."""
    data = run.data
    groups: dict[tuple[str, ...], list[str]] = {}
    for name in signal_names(data):
        groups.setdefault(tuple(map(str, data[name].dims)), []).append(name)
    tables: dict[str, Table] = {}
    for dims, names in groups.items():
        if dims:
            labels = [_labels(data, dims, place) for place in range(len(dims))]
            tables["_".join(dims)] = labels + [_signal(data[name], name) for name in names]
    return tables


def about(run: Run) -> dict[str, Any]:
    """Returns what a run is, as plain values: name, status, configuration, versions, and each signal's meaning."""
    data = run.data
    return {
        "name": run.config.name,
        "status": run.status,
        "message": run.message,
        "signals": {name: _meaning(data[name]) for name in signal_names(data)},
        "attributes": {key: _plain(value) for key, value in data.attrs.items() if key != "config"},
        "configuration": run.config.model_dump(mode="json"),
    }


def labels_of(data: xr.Dataset, dim: str) -> NDArray[Any]:
    """Returns the labels along a dimension; numbers from 0 where it has none."""
    return data[dim].values if dim in data.variables else np.arange(data.sizes[dim])


def write_table(table: Table, path: Path, wrote: Callable[[int], object]) -> Path:
    """Writes a table as CSV with its units in the header; numbers with all the digits that they have.

    Args:
        table: The table.
        path: File to write.
        wrote: Called with the number of rows after every chunk of them.

    Raises:
        RunFileError: The file cannot be written.
    """

    def rows() -> Iterator[tuple[object, ...]]:
        for start in range(0, len(table[0].values), _CHUNK_ROWS):
            chunk = [column.values[start : start + _CHUNK_ROWS].tolist() for column in table]
            yield from zip(*chunk, strict=True)
            wrote(len(chunk[0]))

    return write_csv(path, [f"{one.name} ({one.units})" if one.units else one.name for one in table], rows())


def write_parquet(table: Table, path: Path, facts: dict[str, Any]) -> Path:
    """Writes a table as one Parquet file, with ``units`` and ``long_name`` in every field's metadata.

    Args:
        table: The table.
        path: File to write.
        facts: What the run is; JSON in the schema's metadata, under ``annelid``.

    Raises:
        RunFileError: The file cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrays = [pa.array(one.values.tolist() if one.values.dtype.kind in "UO" else one.values) for one in table]
    fields = [
        pa.field(one.name, array.type, metadata={"units": one.units, "long_name": one.long_name})
        for one, array in zip(table, arrays, strict=True)
    ]
    schema = pa.schema(fields, metadata={"annelid": json.dumps(facts)})
    with whole_file(path) as draft:
        pq.write_table(pa.Table.from_arrays(arrays, schema=schema), draft)
    return path


def _meaning(variable: xr.DataArray) -> dict[str, Any]:
    return {
        "units": str(variable.attrs.get("units", "1")),
        "long_name": str(variable.attrs.get("long_name", "")),
        "dimensions": [str(dim) for dim in variable.dims],
    }


def _labels(data: xr.Dataset, dims: tuple[str, ...], place: int) -> Column:
    """Repeats the labels of a dimension down a table whose last dimension changes fastest."""
    dim, counts = dims[place], [data.sizes[dim] for dim in dims]
    clock = CLOCKS.get(dim)
    values = labels_of(data, dim) if clock is None else data[clock].values
    values = np.tile(np.repeat(values, prod(counts[place + 1 :])), prod(counts[:place]))
    if clock is None:
        return Column(dim, "", f"label of each {dim}", values)
    return Column("time", "s", str(data[clock].attrs.get("long_name", "simulated time")), values)


def _signal(variable: xr.DataArray, name: str) -> Column:
    meaning = _meaning(variable)
    return Column(name, meaning["units"], meaning["long_name"], variable.values.ravel())


def _plain(value: Any) -> Any:
    """Returns an attribute as JSON can have it, a number that is not finite as None."""
    plain = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain

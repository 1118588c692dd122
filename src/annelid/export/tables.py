"""A run's signals as tidy tables: one for all signals of the same dimensions, with a row for each of their values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.export.selection import CLOCKS, signal_names

if TYPE_CHECKING:
    import xarray as xr

    from annelid.simulation.runfile import Run


@dataclass(frozen=True, slots=True)
class Column:
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

    @property
    def heading(self) -> str:
        """The name with its unit, for example ``ring_length (m)``."""
        return f"{self.name} ({self.units})" if self.units else self.name


@dataclass(frozen=True, slots=True)
class Table:
    """Signals of the same dimensions, time and labels first.

    Attributes:
        name: The dimensions joined, for example ``time_segment_sensor``.
        columns: All columns, equally long.
    """

    name: str
    columns: tuple[Column, ...]

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return len(self.columns[0].values)


def tables_of(run: Run) -> list[Table]:
    """Lays out the signals of a run.

    Returns:
        A table for every combination of dimensions, in the order of the run file.
    """
    data = run.data
    groups: dict[tuple[str, ...], list[str]] = {}
    for name in signal_names(data):
        groups.setdefault(tuple(map(str, data[name].dims)), []).append(name)
    return [_table(data, dims, names) for dims, names in groups.items() if dims]


def about(run: Run) -> dict[str, Any]:
    """Returns what a run is, as plain values: name, status, configuration, versions, and each signal's meaning."""
    data = run.data
    attrs = {key: _plain(value) for key, value in data.attrs.items()}
    return {
        "name": run.config.name,
        "status": run.status,
        "message": run.message,
        "signals": {name: _meaning(data[name]) for name in signal_names(data)},
        "attributes": {key: value for key, value in attrs.items() if key != "config"},
        "configuration": run.config.model_dump(mode="json"),
    }


def labels_of(data: xr.Dataset, dim: str) -> NDArray[Any]:
    """Returns the labels along a dimension; numbers from 0 where it has none."""
    return data[dim].values if dim in data.variables else np.arange(data.sizes[dim])


def _meaning(variable: xr.DataArray) -> dict[str, Any]:
    return {
        "units": str(variable.attrs.get("units", "1")),
        "long_name": str(variable.attrs.get("long_name", "")),
        "dimensions": [str(dim) for dim in variable.dims],
    }


def _table(data: xr.Dataset, dims: tuple[str, ...], names: list[str]) -> Table:
    sizes = {dim: data.sizes[dim] for dim in dims}
    labels = [_label(data, dim, i, sizes) for i, dim in enumerate(dims)]
    columns = [_column(data[name], name, data[name].values.ravel()) for name in names]
    return Table("_".join(dims), (*labels, *columns))


def _label(data: xr.Dataset, dim: str, place: int, sizes: Mapping[str, int]) -> Column:
    """Repeats the labels of a dimension down a table whose last dimension changes fastest."""
    counts = list(sizes.values())
    clock = CLOCKS.get(dim)
    values = labels_of(data, dim) if clock is None else data[clock].values
    values = np.tile(np.repeat(values, prod(counts[place + 1 :])), prod(counts[:place]))
    if clock is None:
        return Column(dim, "", f"label of each {dim}", values)
    return Column("time", "s", str(data[clock].attrs.get("long_name", "simulated time")), values)


def _column(variable: xr.DataArray, name: str, values: NDArray[Any]) -> Column:
    meaning = _meaning(variable)
    return Column(name, meaning["units"], meaning["long_name"], values)


def _plain(value: Any) -> Any:
    """Returns an attribute as JSON can have it, a number that is not finite as None."""
    plain = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain

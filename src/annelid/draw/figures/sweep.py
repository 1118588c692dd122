"""A sweep: lines over one field, maps over two, lines over each of more."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.analysis.interval import CONFIDENCE, mean_and_interval
from annelid.draw.canvas import canvas, mark_lost, plain, save_both, segment_colors

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS, SIGNED = "viridis", "RdBu"
"""Colours of numbers, and of such as lie on both sides of zero: white is zero, blue is positive, so forwards."""
_PANEL_IN = (3.7, 2.6)
_LETTERS = 36
_FAILED: Any = {"color": "0.6", "markersize": 5.0}
_MOST_TICKS = 8
_MOST_WRITTEN = 6  # cells of a row or a column whose numbers fit into them
_LEAST_RANGE = 0.02
"""Colours and axes span at least this share of the largest number, so that a tiny difference looks like one."""


def sweep_figure(data: xr.Dataset, fields: Sequence[str], numbers: Sequence[str], stem: str | Path) -> Path:
    """Draws numbers over the varied fields; runs without a number are marked with crosses.

    Args:
        data: The numbers, each with its attribute ``heading``, along the fields of a grid or along ``sample``, perhaps
            along ``repeat``: over one field their mean is drawn with its 95 % interval.
        fields: The varied fields, coordinates of the data.
        numbers: Variables of the data. Over three or more fields the first is drawn over each of them.
        stem: Path without suffix; ``.svg`` and ``.png`` are written, and the latter's path is returned.
    """
    if len(fields) > 2:
        panels = [([field], numbers[0]) for field in fields]
    else:
        panels = [(list(fields), name) for name in numbers]
    columns = min(2, len(panels))
    rows = ceil(len(panels) / columns)
    with canvas(0.5 + _PANEL_IN[1] * rows, _PANEL_IN[0] * columns if len(panels) > 1 else 4.6) as figure:
        places = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, (over, name) in zip(places, panels, strict=False):
            if len(over) == 1:
                _line(axes, data, over[0], name)
            else:
                _map(figure, axes, data, over, name)
        for axes in places[len(panels) :]:
            axes.set_visible(False)
        if any(data[name].isnull().any() for _, name in panels):
            figure.supxlabel("×: the run has no such number", fontsize=7.5)
        return save_both(figure, stem)


def _line(axes: Axes, data: xr.Dataset, field: str, name: str) -> None:
    is_grid = data[field].dims == (field,)
    if is_grid and _is_number(data[field]):
        data = data.sortby(field)
    values, color = data[name], segment_colors(2)[is_grid]
    y = values.transpose(data[field].dims[0], ...).values.reshape(data[field].size, -1)
    x = _places(axes, "x", data[field])
    found = np.array([mean_and_interval(row[np.isfinite(row)].tolist()) for row in y])
    mean, half = found[:, 0], found[:, 2] - found[:, 0]
    several = y.shape[1] > 1
    if several:
        axes.plot(np.repeat(x, y.shape[1]), y.ravel(), ".", color="0.65", markersize=4.0, label="one run")
    look: Any = {"fmt": "o-" if is_grid else "o", "color": color, "markersize": 3.5, "capsize": 3.0}
    axes.errorbar(x, mean, half if several else None, label=f"mean, {100 * CONFIDENCE:g} % interval", **look)
    if several:
        axes.legend(loc="best", fontsize=7.0)
    mark_lost(axes, x[np.isnan(y).any(axis=1)], _FAILED["color"], 0.03)
    axes.set_ylabel(_quantity(values))
    if limits := _wider(y):
        axes.set_ylim(*limits)


def _map(figure: Figure, axes: Axes, data: xr.Dataset, fields: Sequence[str], name: str) -> None:
    values = data[name]
    if "repeat" in values.dims:
        values = values.mean("repeat", keep_attrs=True)
    if fields[0] in values.dims:
        # Cells are of one size, whatever the spacing of the values.
        grid = np.ma.masked_invalid(values.transpose(fields[1], fields[0]).values)
        shown: Any = axes.pcolormesh(np.arange(grid.shape[1]), np.arange(grid.shape[0]), grid, **_colors(grid.data))
        for row, column in np.ndindex(grid.shape):
            if np.ma.getmaskarray(grid)[row, column]:
                axes.plot(column, row, "x", **_FAILED)
            elif max(grid.shape) <= _MOST_WRITTEN:
                value = float(grid[row, column])
                ink = "black" if np.dot(shown.to_rgba(value)[:3], (0.3, 0.59, 0.11)) > 0.5 else "white"
                axes.text(column, row, f"{value:.3g}", ha="center", va="center", fontsize=7.5, color=ink)
        for which, field in zip("xy", fields, strict=True):
            words = [f"{one:.4g}" if _is_number(data[field]) else plain(str(one)) for one in data[field].values]
            every = ceil(len(words) / _MOST_TICKS)
            axes.set(**{f"{which}ticks": range(0, len(words), every), f"{which}ticklabels": words[::every]})
            axes.set(**{f"{which}label": _label(data[field])})
    else:
        x, y = (_places(axes, which, data[field]) for which, field in zip("xy", fields, strict=True))
        z, known = values.values, np.isfinite(values.values)
        shown = axes.scatter(x[known], y[known], c=z[known], s=18.0, edgecolors="0.4", linewidths=0.3, **_colors(z))
        axes.plot(x[~known], y[~known], "x", **_FAILED)
    axes.grid(visible=False)
    figure.colorbar(shown, ax=axes, pad=0.02)
    axes.set_title(plain(_quantity(values)), pad=5.0)


def _colors(values: np.ndarray) -> dict[str, Any]:
    """The map of colours of numbers, and that its middle is zero where they lie on both sides of it."""
    from matplotlib.colors import CenteredNorm

    known = values[np.isfinite(values)]
    if not known.size or known.min() >= 0.0 or known.max() <= 0.0:
        return {"cmap": COLORS, **dict(zip(("vmin", "vmax"), _wider(known) or (), strict=False))}
    return {"cmap": SIGNED, "norm": CenteredNorm()}


def _wider(values: np.ndarray) -> tuple[float, float] | None:
    """Returns limits about numbers that are nearly equal, `_LEAST_RANGE` apart; None for others."""
    known = values[np.isfinite(values)]
    least = _LEAST_RANGE * float(np.abs(known).max(initial=0.0))
    if not known.size or float(np.ptp(known)) >= least:
        return None
    middle = float(known.min() + known.max()) / 2
    return middle - least / 2, middle + least / 2


def _places(axes: Axes, which: str, coordinate: xr.DataArray) -> np.ndarray:
    """Names an axis, and returns where the values of a field lie along it: numbers, or words in their order."""
    axes.set(**{f"{which}label": _label(coordinate)})
    if not _is_number(coordinate):
        return np.array([plain(str(word)) for word in coordinate.values])
    low, middle, high = np.min(coordinate), np.median(coordinate), np.max(coordinate)
    # Over a decade, and spread evenly by ratio rather than by difference.
    if 0.0 < 10.0 * low < high and abs(np.log(middle**2 / (low * high))) < abs(np.log(2.0 * middle / (low + high))):
        axes.set(**{f"{which}scale": "log"})
    return coordinate.values.astype(float)


def _is_number(coordinate: xr.DataArray) -> bool:
    return coordinate.dtype.kind in "if"


def _quantity(values: xr.DataArray) -> str:
    """Writes what numbers are called, in lines that fit there."""
    return "\n".join(wrap(values.heading, _LETTERS))


def _label(coordinate: xr.DataArray) -> str:
    return worded(str(coordinate.name).rsplit(".", 1)[-1], coordinate.attrs["units"])


def worded(name: str, unit: str) -> str:
    """Writes a name without the unit that ends it, and the unit in brackets."""
    name = name.removeprefix("n_")
    if unit == "1":
        return name.replace("_", " ")
    ending = "_" + unit.replace("1/", "per ").replace("/", " per ").replace(" ", "_")
    return f"{name.removesuffix(ending).replace('_', ' ')} ({unit})"

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
_CELL_TEXT_IN = (0.36, 0.15)  # width and height of a number in a cell
_PANEL_IN = (3.7, 2.6)
_TITLE_LETTERS = 42
_FAILED = "0.6"
_MOST_TICKS = 8


def sweep_figure(data: xr.Dataset, fields: Sequence[str], numbers: Sequence[str], stem: str | Path) -> Path:
    """Draws numbers over the varied fields; runs without a number are marked with crosses.

    Args:
        data: The numbers along the fields of a grid or along ``sample``, perhaps along ``repeat``: over one field their
            mean is drawn with its 95 % interval.
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
        for i, (axes, (over, name)) in enumerate(zip(places, panels, strict=False)):
            if len(over) == 1:
                _line(axes, data, over[0], name)
            else:
                _map(figure, axes, data, over, name)
                if i % columns:
                    axes.set_ylabel("")
        for axes in places[len(panels) :]:
            axes.set_visible(False)
        if any(data[name].isnull().any() for _, name in panels):
            figure.supxlabel("×: the run has no such number", fontsize=7.5)
        return save_both(figure, stem)


def _line(axes: Axes, data: xr.Dataset, field: str, name: str) -> None:
    values = data[name]
    x, ticks = _axis(data[field].values)
    others = [dim for dim in values.dims if dim != data[field].dims[0]]
    y = values.transpose(data[field].dims[0], *others).values.reshape(len(x), -1)
    dot, line, *_ = segment_colors(4)
    order = np.argsort(x, kind="stable")
    found = np.array([mean_and_interval(row[np.isfinite(row)].tolist()) for row in y])
    mean, half = found[:, 0], found[:, 2] - found[:, 0]
    on_a_grid = data[field].dims == (field,)
    color = line if on_a_grid else dot
    if y.shape[1] > 1:
        axes.plot(np.repeat(x, y.shape[1]), y.ravel(), ".", color="0.65", markersize=4.0, label="one run")
        bars = f"mean, {100 * CONFIDENCE:g} % interval"
        axes.errorbar(x, mean, half, fmt="none", ecolor=color, elinewidth=1.2, capsize=3.0, label=bars)
        axes.legend(loc="best", fontsize=7.0)
    axes.plot(x[order], mean[order], "o-" if on_a_grid else "o", color=color, markersize=3.5)
    mark_lost(axes, x[np.isnan(y).any(axis=1)], _FAILED, 0.03)
    _name_axis(axes, "x", data[field], ticks)
    axes.set_ylabel(quantity(values, 30))


def quantity(values: xr.DataArray, letters: int = _TITLE_LETTERS) -> str:
    """Writes what numbers are, in words where their dataset has them, with their unit; in lines of so many letters."""
    unit, words = values.attrs["units"], values.attrs.get("long_name")
    text = worded(str(values.name), unit) if words is None else f"{words}{'' if unit == '1' else f' ({unit})'}"
    return "\n".join(wrap(text, letters))


def _write_in_cells(axes: Axes, mesh: Any, grid: np.ma.MaskedArray) -> None:
    """Writes the numbers into the cells of a map, if they fit."""
    rows, columns = grid.shape
    # Axes and colour bar take about a third of a panel's width, and title and ticks of its height.
    cell = (0.65 * _PANEL_IN[0] / columns, 0.65 * _PANEL_IN[1] / rows)
    if cell[0] < _CELL_TEXT_IN[0] or cell[1] < _CELL_TEXT_IN[1]:
        return
    for row, column in zip(*np.nonzero(~np.ma.getmaskarray(grid)), strict=True):
        value = float(grid[row, column])
        red, green, blue, _ = mesh.to_rgba(value)
        ink = "black" if 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 else "white"
        axes.text(column, row, f"{value:.3g}", ha="center", va="center", fontsize=7.5, color=ink)


def _map(figure: Figure, axes: Axes, data: xr.Dataset, fields: Sequence[str], name: str) -> None:
    values = data[name]
    if "repeat" in values.dims:
        values = values.mean("repeat", keep_attrs=True)
    along_x, along_y = (data[field] for field in fields)
    (x, x_ticks), (y, y_ticks) = _axis(along_x.values), _axis(along_y.values)
    if fields[0] in values.dims:
        grid = np.ma.masked_invalid(values.transpose(fields[1], fields[0]).values)
        edges = np.arange(len(x) + 1) - 0.5, np.arange(len(y) + 1) - 0.5
        shown: Any = axes.pcolormesh(*edges, grid, **_colors(grid))
        _write_in_cells(axes, shown, grid)
        rows, columns = np.nonzero(np.ma.getmaskarray(grid))
        axes.plot(columns, rows, "x", color=_FAILED, markersize=5.0)
        # Cells are of one size, whatever the spacing of the values.
        x_ticks, y_ticks = _cells(along_x.values), _cells(along_y.values)
    else:
        z = values.values
        known = np.isfinite(z)
        shown = axes.scatter(x[known], y[known], c=z[known], s=18.0, edgecolors="0.4", linewidths=0.3, **_colors(z))
        axes.plot(x[~known], y[~known], "x", color=_FAILED, markersize=5.0)
    axes.grid(visible=False)
    _name_axis(axes, "x", along_x, x_ticks)
    _name_axis(axes, "y", along_y, y_ticks)
    figure.colorbar(shown, ax=axes, pad=0.02)
    axes.set_title(plain(quantity(values)), pad=5.0)


def _colors(values: np.ndarray) -> dict[str, Any]:
    """The map of colours of numbers, and its range where they lie on both sides of zero."""
    known = values[np.isfinite(values)]
    if not known.size or known.min() >= 0.0 or known.max() <= 0.0:
        return {"cmap": COLORS}
    reach = float(np.abs(known).max())
    return {"cmap": SIGNED, "vmin": -reach, "vmax": reach}


def _axis(values: np.ndarray) -> tuple[np.ndarray, list[tuple[float, str]]]:
    """Returns where values lie along an axis, and the ticks of words; numbers have none of their own."""
    if values.dtype.kind in "if":
        return values.astype(float), []
    words = list(dict.fromkeys(values.tolist()))
    ticks = [(float(i), plain(str(word))) for i, word in enumerate(words)]
    return np.array([words.index(value) for value in values], dtype=float), ticks


def _cells(values: np.ndarray) -> list[tuple[float, str]]:
    texts = [f"{value:.4g}" if values.dtype.kind in "if" else plain(str(value)) for value in values]
    every = ceil(len(texts) / _MOST_TICKS)
    return [(float(i), text) for i, text in enumerate(texts)][::every]


def _name_axis(axes: Axes, which: str, coordinate: xr.DataArray, ticks: list[tuple[float, str]]) -> None:
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_label_text(_label(coordinate))
    if ticks:
        axis.set_ticks([place for place, _ in ticks], labels=[text for _, text in ticks])
    elif coordinate.values.min() > 0.0 and _is_logarithmic(coordinate.values):
        axes.set_xscale("log") if which == "x" else axes.set_yscale("log")


def _is_logarithmic(values: np.ndarray) -> bool:
    """Whether values over a decade are spread evenly by ratio rather than by difference."""
    low, middle, high = np.min(values), np.median(values), np.max(values)
    return bool(high > 10.0 * low and abs(np.log(middle**2 / (low * high))) < abs(np.log(2.0 * middle / (low + high))))


def _label(coordinate: xr.DataArray) -> str:
    return worded(str(coordinate.name).rsplit(".", 1)[-1], coordinate.attrs["units"])


def worded(name: str, unit: str) -> str:
    """Writes a name without the unit that ends it, and the unit in brackets."""
    if unit == "1":
        return name.replace("_", " ")
    ending = "_" + unit.replace("1/", "per ").replace("/", " per ").replace(" ", "_")
    return f"{name.removesuffix(ending).replace('_', ' ')} ({unit})"

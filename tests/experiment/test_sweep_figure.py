from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from annelid.draw.figures.sweep import (
    COLORS,
    _colors,
    _line,
    _map,
    sweep_figure,
)

FIELDS = {
    "arena.friction": ([0.1, 0.3, 1.0], "1"),
    "controller.gate_time_constant_ms": ([100.0, 200.0], "ms"),
    "controller.kind": (["sns", "sine"], "1"),
}


def grid(fields: Sequence[str], repeat: bool) -> xr.Dataset:
    coords = {field: (field, np.array(FIELDS[field][0]), {"units": FIELDS[field][1]}) for field in fields}
    shape = tuple(len(FIELDS[field][0]) for field in fields) + ((2,) if repeat else ())
    values = np.arange(np.prod(shape), dtype=float).reshape(shape)
    values.flat[1] = np.nan
    dims = (*fields, "repeat") if repeat else tuple(fields)
    data = {name: (dims, values, {"heading": name}) for name in ("speed_m_per_s", "slip_ratio")}
    return xr.Dataset(data, coords)


def samples(fields: Sequence[str]) -> xr.Dataset:
    coords = {field: ("sample", np.array(FIELDS[field][0][:2] * 3), {"units": FIELDS[field][1]}) for field in fields}
    values = np.append(np.arange(5.0), np.nan)
    return xr.Dataset({"speed_m_per_s": ("sample", values, {"heading": "speed (m/s)"})}, coords)


@pytest.mark.parametrize("n_fields", [1, 2, 3])
@pytest.mark.parametrize("kind", ["grid", "repeats", "samples"])
def test_a_sweep_is_drawn_over_any_number_of_fields(kind: str, n_fields: int, tmp_path: Path) -> None:
    fields = list(FIELDS)[:n_fields]
    data = samples(fields) if kind == "samples" else grid(fields, kind == "repeats")
    path = sweep_figure(data, fields, [str(name) for name in data], tmp_path / "sweep")
    assert path == tmp_path / "sweep.png"
    assert path.stat().st_size > 5000
    assert "<svg" in (tmp_path / "sweep.svg").read_text()


def test_nothing_but_failures_is_drawn_too(tmp_path: Path) -> None:
    for n in (1, 2, 3):
        data = samples(list(FIELDS)[:n])
        data["speed_m_per_s"] = data["speed_m_per_s"] * np.nan
        data["speed_m_per_s"].attrs["heading"] = "speed (m/s)"
        assert sweep_figure(data, list(FIELDS)[:n], ["speed_m_per_s"], tmp_path / f"{n}").exists()


def drawn(values: np.ndarray, **attrs: str) -> xr.Dataset:
    coords = {f: (f, np.arange(n, dtype=float), {"units": "1"}) for f, n in zip("ab", values.shape, strict=True)}
    return xr.Dataset({"speed_m_per_s": (("a", "b"), values, {"heading": "speed (m/s)", **attrs})}, coords)


def cells(values: np.ndarray) -> list[tuple[tuple[float, float], str]]:
    figure = Figure()
    axes = figure.subplots()
    _map(figure, axes, drawn(values), ["a", "b"], "speed_m_per_s")
    return [(text.get_position(), text.get_text()) for text in axes.texts]


def test_values_stand_in_the_cells_of_a_map_where_they_fit() -> None:
    values = np.array([[0.1234, -0.02], [np.nan, 12.345]])
    assert cells(values) == [((0, 0), "0.123"), ((0, 1), "-0.02"), ((1, 1), "12.3")]
    assert cells(np.zeros((40, 2))) == []
    assert cells(np.zeros((2, 40))) == []


def test_a_difference_that_no_table_shows_is_not_spread_over_all_colours() -> None:
    nearly, apart = np.array([[0.034716, 0.034732]]), np.array([[1.0, 2.0]])
    assert _colors(nearly)["vmax"] - _colors(nearly)["vmin"] == pytest.approx(0.02 * 0.034732)
    assert _colors(apart) == {"cmap": COLORS}
    axes = Figure().subplots()
    _line(axes, drawn(nearly.T).isel(b=0), "a", "speed_m_per_s")
    assert np.ptp(axes.get_ylim()) == pytest.approx(0.02 * 0.034732)


def test_repeats_have_the_interval_of_students_t() -> None:
    coords = {"x": ("x", np.arange(3.0), {"units": "1"})}
    values = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, np.nan], [5.0, np.nan, np.nan]])
    data = xr.Dataset({"slip_ratio": (("x", "repeat"), values, {"heading": "slip"})}, coords)
    axes = Figure().subplots()
    _line(axes, data, "x", "slip_ratio")
    [bars] = [part for part in axes.collections if isinstance(part, LineCollection)]
    heights = [float(np.diff(ends[:, 1])[0]) for ends in bars.get_segments() if np.isfinite(ends).all() and len(ends)]
    # t(0.975) is 4.303 with two degrees of freedom and 12.706 with one; one run alone has no interval.
    assert heights == pytest.approx([2 * 4.303 / np.sqrt(3.0), 12.706], rel=1e-3)
    axes = Figure().subplots()
    _line(axes, grid(["arena.friction"], True), "arena.friction", "slip_ratio")
    assert len(axes.containers) == 1
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("friction", "slip_ratio")
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["one run", "mean, 95 % interval"]

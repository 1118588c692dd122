from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from annelid.draw.figures.sweep import _label, sweep_figure, worded

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
    data = {name: (dims, values, {"units": unit}) for name, unit in (("speed_m_per_s", "m/s"), ("slip_ratio", "1"))}
    return xr.Dataset(data, coords)


def samples(fields: Sequence[str]) -> xr.Dataset:
    coords = {field: ("sample", np.array(FIELDS[field][0][:2] * 3), {"units": FIELDS[field][1]}) for field in fields}
    values = np.append(np.arange(5.0), np.nan)
    return xr.Dataset({"speed_m_per_s": ("sample", values, {"units": "m/s"})}, coords)


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
        data["speed_m_per_s"].attrs["units"] = "m/s"
        assert sweep_figure(data, list(FIELDS)[:n], ["speed_m_per_s"], tmp_path / f"{n}").exists()


def test_labels_have_the_unit_once() -> None:
    assert worded("speed_m_per_s", "m/s") == "speed (m/s)"
    assert worded("heading_change_rad", "rad") == "heading change (rad)"
    assert worded("slip_ratio", "1") == "slip ratio"
    assert _label(grid(list(FIELDS), False)["controller.gate_time_constant_ms"]) == "gate time constant (ms)"

"""WCON has what its schema requires, and the centre line that it has is read again as a log."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from annelid.analysis import track_of
from annelid.export import FORMATS
from annelid.simulation.runfile import Run
from annelid_lab.logs.tables import read_table


def test_a_run_as_wcon_is_read_again(rods_run: Run, tmp_path: Path) -> None:
    [path] = FORMATS.find("wcon").write(rods_run, tmp_path / "run.wcon", lambda done, total: None)
    written = json.loads(path.read_text())
    assert written["units"].keys() >= {"t", "x", "y"}
    [record] = written["data"]
    assert isinstance(record["id"], str)
    assert record["head"] == "L"
    n_planes = len(record["x"][0])
    assert {len(record[name]) for name in ("t", "x", "y")} == {len(rods_run.data["frame"])}
    assert all(len(line) == n_planes for line in record["x"] + record["y"])
    read = read_table(path, lambda names: 0)
    track = track_of(rods_run)
    line = track.crossing_m.reshape(len(track.time_s), n_planes, -1, 3).mean(axis=2)
    assert read.numbers("t") == pytest.approx(track.time_s)
    for point in (0, n_planes - 1):
        for axis, places in zip("xy", line[:, point].T, strict=False):
            name = f"point_{point + 1}.{axis}"
            assert (read.units[name], read.numbers(name)) == ("mm", pytest.approx(1e3 * places, abs=1e-6))

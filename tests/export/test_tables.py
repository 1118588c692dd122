"""Values read back from CSV, Parquet and MATLAB files are the run's, bit for bit."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import loadmat

from annelid.config import RunConfig
from annelid.errors import MissingDependency, RunFileError
from annelid.export import FORMATS, Selection, formats, selected
from annelid.export.tables import LONGEST_NAME, matlab_names, signal_names
from annelid.simulation.runfile import Run

Columns = Mapping[str, list[Any]]


def nothing(done: int, total: int) -> None:
    """Takes note of no progress."""


def read_csv(path: Path) -> dict[str, list[Any]]:
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, map(list, zip(*rows, strict=True)), strict=True))


def read_parquet(path: Path) -> dict[str, list[Any]]:
    table = pq.read_table(path)
    units = [(field.metadata or {}).get(b"units", b"").decode() for field in table.schema]
    names = [f"{name} ({unit})" if unit else name for name, unit in zip(table.column_names, units, strict=True)]
    return dict(zip(names, (column.to_pylist() for column in table.columns), strict=True))


READERS: dict[str, Callable[[Path], Columns]] = {"csv": read_csv, "parquet": read_parquet}


@pytest.mark.parametrize("name", READERS)
def test_every_signal_is_read_back_bit_for_bit_under_its_labels(run: Run, target: Path, name: str) -> None:
    files = FORMATS.find(name).write(run, target, nothing)
    columns: dict[str, tuple[Columns, np.ndarray]] = {}
    for file in files:
        if file.suffix == f".{name}":
            table = READERS[name](file)
            columns |= {heading: (table, np.array(values)) for heading, values in table.items()}
    for signal in signal_names(run.data):
        variable = run.data[signal]
        table, values = columns[f"{signal} ({variable.attrs['units']})"]
        np.testing.assert_array_equal(values.astype(float), variable.values.ravel())
        for place, dim in enumerate(map(str, variable.dims)):
            clock = {"time": "time", "frame": "frame_time"}.get(dim)
            wanted = run.data[clock] if clock else run.data[dim] if dim in run.data.variables else None
            labels = np.arange(run.data.sizes[dim]) if wanted is None else wanted.values
            index = np.indices(variable.shape)[place].ravel()
            read = np.array(table["time (s)" if clock else dim])
            np.testing.assert_array_equal(read.astype(labels.dtype), labels[index])


@pytest.mark.parametrize("name", READERS)
def test_the_configuration_goes_along(run: Run, target: Path, name: str) -> None:
    files = FORMATS.find(name).write(run, target, nothing)
    if name == "csv":
        facts = json.loads((target / "about.json").read_text(encoding="utf-8"))
    else:
        facts = json.loads(pq.read_schema(files[0]).metadata[b"annelid"])
    assert RunConfig.model_validate(facts["configuration"]) == run.config
    assert facts["status"] == "complete"
    assert facts["signals"]["ring_length"]["units"] == "m"
    assert facts["attributes"]["mujoco_version"] == run.data.attrs["mujoco_version"]


def test_a_matlab_file_has_every_signal_with_unit_labels_and_configuration(run: Run, target: Path) -> None:
    (path,) = FORMATS.find("mat").write(run, target.with_suffix(".mat"), nothing)
    read = loadmat(path, simplify_cells=True)
    for signal in signal_names(run.data):
        np.testing.assert_array_equal(np.squeeze(run.data[signal].values), read[signal])
        assert read["units"][signal] == run.data[signal].attrs["units"]
        dims = read["dimensions"][signal]
        assert [str(dim) for dim in np.atleast_1d(dims)] == list(run.data[signal].dims)
    np.testing.assert_array_equal(read["time"], run.data["time"].values)
    np.testing.assert_array_equal(read["frame_time"], run.data["frame_time"].values)
    assert list(read["labels"]["axis"]) == ["x", "y", "z"]
    assert read["config"]["controller"]["kind"] == run.config.controller.kind
    assert read["config"]["clock"]["control_timestep_s"] == run.config.clock.control_timestep_s
    assert read["run"]["status"] == "complete"


@given(st.lists(st.text(max_size=100), unique=True, max_size=8))
def test_matlab_names_are_legal_and_distinct(names: list[str]) -> None:
    legal = matlab_names(names, taken=("units",))
    assert list(legal) == names
    assert len({*legal.values(), "units"}) == len(names) + 1
    for name in legal.values():
        assert name.isascii()
        assert name.isidentifier()
        assert name[0].isalpha()
        assert len(name) <= LONGEST_NAME


def test_only_what_is_wanted_is_kept(rods_run: Run) -> None:
    part = selected(rods_run, Selection(["ring_length", "qpos"], every=2, start_s=0.04, stop_s=0.16))
    assert signal_names(part.data) == ["ring_length", "qpos"]
    whole = rods_run.data
    kept = whole["time"].values[(whole["time"] >= 0.04 - 1e-9) & (whole["time"] <= 0.16 + 1e-9)][::2]
    np.testing.assert_array_equal(part.data["time"].values, kept)
    expected = whole["ring_length"].sel(time=kept)
    np.testing.assert_array_equal(part.data["ring_length"].values, expected.values)
    np.testing.assert_allclose(part.data["frame_time"].values, [0.04, 0.12])
    assert part.config == rods_run.config


@given(st.integers(1, 300), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_window_and_the_thinning_hold_for_any_choice(planar_run: Run, every: int, one: float, other: float) -> None:
    start, stop = sorted((one, other))
    times = planar_run.data["time"].values
    inside = times[(times >= start) & (times <= stop)]
    if not inside.size:
        return
    part = selected(planar_run, Selection(every=every, start_s=start, stop_s=stop)).data["time"].values
    assert len(part) >= len(inside[::every])
    assert np.all((part >= start - 1e-6) & (part <= stop + 1e-6))
    assert np.allclose(np.diff(part), every * 0.005)


def test_what_cannot_be_selected_is_said(planar_run: Run) -> None:
    for selection, words in (
        (Selection(["ring_lenght"]), "did you mean 'ring_length'"),
        (Selection(["time"]), "no signal 'time'"),
        (Selection(every=0), "every = 0"),
        (Selection(start_s=0.5, stop_s=0.4), "no sample from 0.5 s to 0.4 s: it goes from 0 to 3 s"),
    ):
        with pytest.raises(RunFileError, match=words):
            selected(planar_run, selection)


def test_progress_ends_at_the_total(rods_run: Run, target: Path) -> None:
    steps: list[tuple[int, int]] = []
    FORMATS.find("csv").write(rods_run, target, lambda done, total: steps.append((done, total)))
    assert steps[-1][0] == steps[-1][1]
    assert [done for done, _ in steps] == sorted(done for done, _ in steps)


def test_one_table_may_go_into_one_file_and_several_may_not(planar_run: Run, target: Path) -> None:
    file = target.with_suffix(".csv")
    one = selected(planar_run, Selection(["ring_length", "activation"]))
    assert FORMATS.find("csv").write(one, file, nothing) == [file]
    assert list(read_csv(file)) == ["time (s)", "muscle", "ring_length (m)", "activation (1)"]
    with pytest.raises(RunFileError, match="2 tables"):
        FORMATS.find("csv").write(selected(planar_run, Selection(["ring_length", "potential"])), file, nothing)


def test_a_missing_package_is_named_with_the_line_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formats, "find_spec", lambda package: None)
    with pytest.raises(MissingDependency, match=r"pip install 'annelid\[export\]'"):
        FORMATS.find("parquet").require()
    FORMATS.find("csv").require()

"""NWB files hold the run's numbers bit for bit, pass NWB's own validator, and break no rule that a robot could keep."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pynwb
import pytest

from annelid import load_config, simulate
from annelid.control import NetworkController
from annelid.errors import RunFileError
from annelid.export import FORMATS, Selection, selected
from annelid.nervous import Network, Neuron, Synapse, persistent_sodium
from annelid.simulation.runfile import Run
from annelid_lab.nwb import UNITS

UNMET = {
    "check_subject_species_exists": "a robot has no species",
    "check_experimenter_exists": "annelid does not know who ran it",
    "check_institution": "nor where",
}


def nothing(done: int, total: int) -> None:
    """Takes note of no progress."""


@pytest.fixture(scope="module")
def named_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run under a user's network whose neurons have names that no NWB object may have."""
    network = Network("own")
    for name in ("in/out", "in:out", "in_out"):
        network.add_neuron(name, Neuron(bias_nA=5.0, channels=(persistent_sodium(1.0),)))
        network.add_output(name, name)
    network.add_synapse("in/out", "in:out", Synapse(0.5, -40.0))
    controller = NetworkController(network, {}, ["in/out", "in:out", "in_out"])
    config = load_config("riddle2022-planar", {"duration_s": 0.5})
    return simulate(config, tmp_path_factory.mktemp("named") / "run", controller=controller, progress=False)


@contextmanager
def read(run: Run, target: Path) -> Iterator[Any]:
    [path] = FORMATS.find("nwb").write(run, target.with_suffix(".nwb"), nothing)
    assert pynwb.validate(path=str(path)) == []
    with pynwb.NWBHDF5IO(str(path), "r") as io:  # pyright: ignore[reportCallIssue]
        yield io.read()


def all_series(file: Any) -> dict[str, Any]:
    found = dict(file.acquisition)
    for module in file.processing.values():
        for each in module.data_interfaces.values():
            inner = getattr(each, "time_series", None) or getattr(each, "spatial_series", None) or {each.name: each}
            found |= dict(inner)
    return found


def times(series: Any) -> np.ndarray:
    if series.timestamps is not None:
        return series.timestamps[:]
    return series.starting_time + np.arange(len(series.data)) / series.rate


@pytest.mark.parametrize("which", ["planar_run", "rods_run", "named_run"])
def test_every_number_is_read_back(which: str, request: pytest.FixtureRequest, target: Path) -> None:
    run: Run = request.getfixturevalue(which)
    with read(run, target) as file:
        series = all_series(file)
        for name, signal in run.data.data_vars.items():
            if signal.dims[:1] != ("time",):
                continue
            unit = UNITS.get(signal.attrs["units"], (signal.attrs["units"], 1.0))
            if name == "potential":
                ours = [each for each in file.acquisition.values() if each.name.startswith("potential_")]
                by_cell = {each.electrode.cell_id: each for each in ours}
                assert len(by_cell) == signal.sizes["neuron"]
                for neuron in signal["neuron"].values:
                    read_back = by_cell[str(neuron)]
                    np.testing.assert_array_equal(read_back.data[:], signal.sel(neuron=neuron).values)
                    np.testing.assert_allclose(times(read_back), run.data["time"].values, rtol=0, atol=1e-9)
                    assert (read_back.unit, read_back.conversion) == ("volts", 1e-3)
            else:
                read_back = series[str(name)]
                np.testing.assert_array_equal(read_back.data[:], signal.values)
                assert (read_back.unit, read_back.conversion) == unit
                for dim in set(signal.dims) & set(signal.coords) - {"time"}:
                    assert json.loads(read_back.comments)[dim] == signal[dim].values.tolist()
                np.testing.assert_allclose(times(read_back), run.data["time"].values, rtol=0, atol=1e-9)


def test_segments_are_where_their_rings_are(rods_run: Run, target: Path) -> None:
    mesh = rods_run.config.body.geometry()
    assert mesh is not None
    with read(rods_run, target) as file:
        position = file.processing["behavior"]["Position"]
        for segment, ring in enumerate(mesh.rings, start=1):
            expected = rods_run.data["crossing_position"].values[:, ring].mean(axis=1)
            np.testing.assert_allclose(position[f"segment_{segment}"].data[:], expected, atol=1e-12)


def test_the_configuration_and_the_time_go_along(planar_run: Run, target: Path) -> None:
    with read(planar_run, target) as file:
        notes = json.loads(file.notes)
        assert notes["configuration"] == planar_run.config.model_dump(mode="json")
        assert file.session_start_time == datetime.fromisoformat(planar_run.data.attrs["created"])
        assert "doi:10.3389/fnbot.2017.00037" in file.related_publications[:]


@pytest.mark.parametrize("which", ["planar_run", "named_run"])
def test_the_inspector_finds_only_what_a_robot_cannot_have(
    which: str, request: pytest.FixtureRequest, target: Path
) -> None:
    import nwbinspector as inspector

    with read(request.getfixturevalue(which), target) as file:
        findings = [one for one in inspector.inspect_nwbfile_object(file) if one is not None]
    assert {finding.check_function_name for finding in findings} == set(UNMET)
    assert all(finding.importance.name != "CRITICAL" for finding in findings)


def test_a_part_keeps_its_times(planar_run: Run, target: Path) -> None:
    part = selected(planar_run, Selection(["ring_length"], every=3, start_s=0.25, stop_s=0.75))
    with read(part, target) as file:
        [series] = all_series(file).values()
        np.testing.assert_allclose(times(series), part.data["time"].values, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(series.data[:], part.data["ring_length"].values)


def test_what_nwb_cannot_hold_is_refused(rods_run: Run, planar_run: Run, target: Path) -> None:
    with pytest.raises(RunFileError, match="qpos"):
        FORMATS.find("nwb").write(selected(rods_run, Selection(["qpos"])), target.with_suffix(".nwb"), nothing)
    undated = planar_run.with_data(planar_run.data.assign_attrs(created="yesterday"))
    with pytest.raises(RunFileError, match="created = 'yesterday'"):
        FORMATS.find("nwb").write(undated, target.with_suffix(".nwb"), nothing)
    assert not target.with_suffix(".nwb").exists()

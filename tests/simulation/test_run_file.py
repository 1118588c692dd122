from __future__ import annotations

import errno
import itertools
import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st
from toy import N, SavedToyPlant, ToyController, ToyPlant, toy_config, without_digest

from annelid.errors import ConfigError, RunFileError
from annelid.protocols import Recordable, Signal
from annelid.references import entries
from annelid.simulation import Run, container, digest, loop, open_run, simulate
from annelid.simulation.container import RawWriter, Variable
from annelid.simulation.runfile import SCHEMA_VERSION, read_config, verify_run


def toy_run(out: Path, **overrides: object) -> Run:
    return simulate(toy_config(**overrides), out, plant=SavedToyPlant(), controller=ToyController())


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return toy_run(tmp_path_factory.mktemp("toy") / "run")


def test_plain_xarray_opens_it_and_every_variable_has_units_and_a_name(run: Run) -> None:
    with xarray.open_dataset(run.path, engine="h5netcdf") as data:
        assert {"potential", "activation", "stretch_length", "wall_time", "stretch_rest_length"} <= set(data)
        for name, variable in data.variables.items():
            assert variable.attrs.get("units"), name
            assert variable.attrs.get("long_name"), name
        assert int(data["samples_written"]) == data.sizes["time"] == 41
        assert data["potential"].dims == ("time", "neuron")
        assert list(data["neuron"].values) == [f"contraction_{i}" for i in (1, 2, 3)]
        assert list(data["segment"].values) == [1, 2, 3]
        assert "frame_time" in data["qpos"].coords
        flags = data["status_code"].attrs
        assert dict(zip(flags["flag_meanings"].split(), flags["flag_values"], strict=True))["complete"] == int(
            data["status_code"]
        )
        assert data["stretch_rest_length"].values == pytest.approx(0.1)


def test_the_attributes_are_those_of_cf(run: Run) -> None:
    attrs = run.data.attrs
    assert attrs["Conventions"] == "CF-1.11"
    assert run.config.name in attrs["title"]
    assert attrs["history"] == f"run by annelid {attrs['annelid_version']}"
    assert attrs["annelid_version"] in attrs["source"]
    assert set(attrs["references"].split(":")[0].split(", ")) <= set(entries())
    assert attrs["comment"]
    with xarray.open_dataset(run.path, engine="h5netcdf") as data:
        assert data["time"].dtype == data["frame_time"].dtype == float  # not decoded as dates


def test_attributes_say_how_to_do_it_again(run: Run) -> None:
    attrs = run.data.attrs
    assert json.loads(attrs["config"]) == json.loads(toy_config().model_dump_json())
    assert run.config == toy_config()
    assert attrs["numpy_version"] == np.__version__
    assert attrs["seed"] == 0
    assert attrs["total_mass_kg"] == pytest.approx(0.3)
    for name in ("annelid_version", "mujoco_version", "python_version", "platform", "created"):
        assert attrs[name], name
    assert os.uname().nodename not in attrs["platform"].split()


def test_a_seed_beyond_64_bits_is_kept(tmp_path: Path) -> None:
    assert int(toy_run(tmp_path, seed=2**70).data.attrs["seed"]) == 2**70


def test_a_file_of_a_newer_schema_is_refused(run: Run, tmp_path: Path) -> None:
    shutil.copy(run.path, tmp_path)
    with without_digest(tmp_path / "run.nc") as file:
        file.attrs["schema_version"] = SCHEMA_VERSION + 6
        file.create_dataset("packed", data=np.zeros(100), compression="gzip")
    for read in (open_run, read_config, verify_run):
        with pytest.raises(
            RunFileError, match=f"version {SCHEMA_VERSION + 6}, .* none above {SCHEMA_VERSION}: a newer"
        ):
            read(tmp_path)


def test_missing_foreign_and_damaged_files_are_named(run: Run, tmp_path: Path) -> None:
    def refused(path: Path) -> str:
        with pytest.raises(RunFileError) as caught:
            open_run(path)
        sentence = str(caught.value)
        assert "\n" not in sentence
        return sentence

    assert "there is no run file" in refused(tmp_path / "nowhere")
    assert "holds no run.nc" in refused(tmp_path)
    text = tmp_path / "notes.txt"
    text.write_text("time,potential\n0,1\n")
    assert "not a netCDF-4 file" in refused(text)
    assert "there is no run file" in refused(text / "run.nc")
    empty = tmp_path / "empty.nc"
    empty.touch()
    assert "is empty" in refused(empty)
    foreign = tmp_path / "foreign.nc"
    xarray.Dataset({"t": ("x", [1.0, 2.0])}).to_netcdf(foreign, engine="h5netcdf")
    assert "not an annelid run" in refused(foreign)
    plain = tmp_path / "plain.h5"
    with h5py.File(plain, "w") as file:
        file["a"] = 1
    assert "not an annelid run" in refused(plain)
    future = tmp_path / "future.nc"
    shutil.copy(run.path, future)
    with without_digest(future) as file:
        file.attrs["config"] = '{"legs": 6}'
        file.attrs["annelid_version"] = "99.0"
    assert "annelid 99.0" in refused(future)


def test_impossible_bookkeeping_is_damage(subtests: pytest.Subtests, run: Run, tmp_path: Path) -> None:
    for name, value in (("samples_written", -3), ("frames_written", 10**6), ("status_code", -1)):
        with subtests.test(f"{name!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            copy = folder / "copy.nc"
            shutil.copy(run.path, copy)
            with without_digest(copy) as file:
                file[name][()] = value  # type: ignore[index]
            with pytest.raises(RunFileError, match=f"is damaged: {name} is {value}"):
                open_run(copy)


@given(share=st.floats(0.0, 0.999))
@settings(max_examples=25)
def test_a_truncated_file_is_refused_wherever_it_is_cut(run: Run, share: float) -> None:
    content = run.path.read_bytes()
    cut = run.path.with_name("cut.nc")
    cut.write_bytes(content[: int(share * len(content))])
    with pytest.raises(RunFileError, match=r"truncated|empty|not a netCDF-4 file"):
        open_run(cut)


def test_a_folder_in_use_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ConfigError, match="not empty"):
        toy_run(tmp_path)
    with pytest.raises(ConfigError, match="is a file"):
        toy_run(tmp_path / "notes.txt")
    assert [entry.name for entry in tmp_path.iterdir()] == ["notes.txt"]
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_overwriting_replaces_the_run_and_nothing_else(tmp_path: Path) -> None:
    toy_run(tmp_path, seed=1)
    (tmp_path / "notes.txt").write_text("mine")
    simulate(toy_config(seed=2), tmp_path, plant=ToyPlant(), controller=ToyController(), overwrite=True)
    assert open_run(tmp_path).config.seed == 2
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["notes.txt", "run.nc"]


def test_no_room_is_said_in_megabytes_before_anything_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: shutil._ntuple_diskusage(10**9, 10**9 - 200_000, 200_000))
    with pytest.raises(RunFileError, match=r"needs \d+\.\d MB and 0\.2 MB are free"):
        toy_run(tmp_path / "deep" / "er")
    assert list(tmp_path.iterdir()) == []


def test_an_overwritten_run_survives_a_failed_layout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = toy_run(tmp_path).path.read_bytes()

    def refuse(*arguments: object) -> dict[str, int]:
        raise RuntimeError("file write failed\nwith a long tale")

    monkeypatch.setattr(container, "_lay_out", refuse)
    with pytest.raises(RunFileError, match=r"file write failed$"):
        simulate(toy_config(), tmp_path, plant=ToyPlant(), controller=ToyController(), overwrite=True)
    assert [(entry.name, entry.read_bytes()) for entry in tmp_path.iterdir()] == [("run.nc", old)]


@pytest.mark.parametrize("at_write", [20, 100])
def test_a_disk_that_fills_up_ends_the_run_with_a_readable_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_write: int
) -> None:
    """Every write from the given one on fails after taking half of its bytes."""
    monkeypatch.setattr(loop.RecordedRun, "flush_interval_s", 0.0)
    whole, count = digest.write_whole, itertools.count()

    def write(file: BinaryIO, content: bytes) -> None:
        if next(count) >= at_write:
            file.write(content[: len(content) // 2])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        whole(file, content)

    monkeypatch.setattr(digest, "write_whole", write)
    with pytest.raises(RunFileError, match="No space left on device; what was written before is kept"):
        toy_run(tmp_path)
    run = open_run(tmp_path)
    # Not even the status could be written here.
    assert run.status == "running_or_killed"
    assert 0 < run.data.sizes["time"] < 41
    np.testing.assert_array_equal(run.data["control_steps"], 5 * np.arange(run.data.sizes["time"]))
    assert not run.data["stretch_length"].isnull().any()


def test_a_disk_that_recovers_for_the_last_words_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop.RecordedRun, "flush_interval_s", 0.0)
    whole = RawWriter.write

    def write(self: RawWriter, name: str, content: Any, skip_bytes: int = 0) -> None:
        if name == "potential" and skip_bytes > 600:
            raise RunFileError("cannot write the run file: No space left on device")
        whole(self, name, content, skip_bytes)

    monkeypatch.setattr(RawWriter, "write", write)
    with pytest.raises(RunFileError, match="No space left"):
        toy_run(tmp_path)
    run = open_run(tmp_path)
    assert run.status == "disk_failure"
    assert "No space left on device" in run.message
    # Rows of 3 numbers, 24 bytes each: the row that starts after byte 600 is the 27th.
    assert run.data.sizes["time"] == 26


def test_long_messages_are_cut_between_characters(tmp_path: Path) -> None:
    class Wordy(SavedToyPlant):
        def alarm(self) -> str | None:
            return "ü" * 600

    with pytest.raises(Exception, match="üü"):
        simulate(toy_config(), tmp_path, plant=Wordy(), controller=ToyController())
    message = open_run(tmp_path).message
    assert 500 <= len(message.encode()) <= 512
    assert message.endswith("ü")


def test_a_name_recorded_twice_is_refused(tmp_path: Path) -> None:
    class Twice(SavedToyPlant):
        def recordable(self) -> Recordable:
            return Recordable((Signal("potential", ("neuron",), (N,), "mV", "potential"),))

    with pytest.raises(ValueError, match="recorded more than once: potential"):
        simulate(toy_config(), tmp_path / "a", plant=Twice(), controller=ToyController())


def test_a_signal_that_is_named_but_not_read_is_refused(tmp_path: Path) -> None:
    class Silent(SavedToyPlant):
        def read(self, frame: bool) -> Mapping[str, Any]:
            return {} if frame else {"stretch_length": 0.0, "control_steps": 0.0}

    with pytest.raises(ValueError, match="'kinetic_energy'"):
        simulate(toy_config(), tmp_path / "a", plant=Silent(), controller=ToyController())


@given(
    lengths=st.lists(st.integers(1, 40), min_size=1, max_size=5),
    kinds=st.lists(st.sampled_from(["<f8", "<i8", "u1"]), min_size=1, max_size=5),
)
@settings(max_examples=12)
def test_what_is_written_raw_is_what_xarray_reads(
    tmp_path_factory: pytest.TempPathFactory, lengths: Sequence[int], kinds: Sequence[str]
) -> None:
    path = tmp_path_factory.mktemp("raw") / "a.nc"
    sizes = {f"d{i}": length for i, length in enumerate(lengths)}
    dims = tuple(sizes)[:3]
    variables = [Variable(f"v{i}", dims, "1", "numbers", kind) for i, kind in enumerate(kinds)]
    variables.append(Variable("counter", (), "1", "scalar", "<i8"))
    extents = container.create(path, sizes, variables, {"title": "a"})
    assert all(offset % 8 == 0 for offset, _ in extents.values())
    assert path.stat().st_size <= container.needed_bytes(sizes, variables)
    size = path.stat().st_size
    shape = tuple(sizes[dim] for dim in dims)
    contents = {v.name: (np.arange(np.prod(shape)) % 100).reshape(shape).astype(v.dtype) for v in variables[:-1]}
    with xarray.open_dataset(path, engine="h5netcdf") as before:
        for variable in variables[:-1]:
            unwritten = before[variable.name].values
            assert np.isnan(unwritten).all() if variable.dtype == "<f8" else (unwritten == 0).all()
    with closing(RawWriter(path, extents)) as writer:
        for name, content in contents.items():
            writer.write(name, content[:1])
            if shape[0] > 1:
                writer.write(name, content[1:], content[0].nbytes)
        writer.write("counter", np.array(-5, dtype="<i8"))
    assert path.stat().st_size == size
    with xarray.open_dataset(path, engine="h5netcdf") as after:
        for name, content in contents.items():
            np.testing.assert_array_equal(after[name].values, content)
        assert int(after["counter"]) == -5

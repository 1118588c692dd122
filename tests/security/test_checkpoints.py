"""A checkpoint whose checksum is right and whose content is not is refused in a sentence, and nothing is begun."""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from annelid.config import load_config
from annelid.errors import RunFileError
from annelid.simulation import Run, simulate
from annelid.simulation.checkpoint import Checkpoint, newest_payload, to_slot
from annelid.simulation.runfile import SLOTS, read_checkpoint

Arrays = dict[str, Any]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    config = load_config("riddle2022-planar", {"duration_s": 0.05, "sensor.noise_m": 0.001})
    return simulate(config, tmp_path_factory.mktemp("whole") / "run", progress=False)


def refusal(run: Run, tmp_path: Path, payload: bytes) -> str:
    """Puts a payload into both slots of a copy of a run, and returns how its continuation is refused."""
    path = shutil.copy(run.path, tmp_path / "run.nc")
    with h5py.File(path, "r+") as file:
        file.attrs.pop("schema_version", None)
        for number, name in enumerate(SLOTS, start=1):
            slot = file[name]
            assert isinstance(slot, h5py.Dataset)
            content = to_slot(number, payload)
            room = slot.shape[0]
            assert len(content) <= room
            slot[...] = np.frombuffer(content.ljust(room, b"\0"), dtype="u1")
    with pytest.raises(RunFileError) as caught:
        simulate(
            load_config(run.config.model_dump(), {"duration_s": 0.2}), tmp_path / "on", resume=path, progress=False
        )
    assert not (tmp_path / "on").exists()
    sentence = str(caught.value)
    assert sentence.startswith(str(path))
    assert sentence.isprintable()
    return sentence


def packed(arrays: Arrays, compression: int = zipfile.ZIP_STORED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, value in arrays.items():
            member = io.BytesIO()
            np.save(member, value)
            archive.writestr(f"{name}.npy", member.getvalue())
    return buffer.getvalue()


def with_value(name: str, value: Any) -> Callable[[Arrays], Arrays]:
    return lambda arrays: arrays | {name: value}


def without(name: str) -> Callable[[Arrays], Arrays]:
    return lambda arrays: {key: value for key, value in arrays.items() if key != name}


def with_first(name: str, value: float) -> Callable[[Arrays], Arrays]:
    def change(arrays: Arrays) -> Arrays:
        changed = np.array(arrays[name])
        changed.flat[0] = value
        return arrays | {name: changed}

    return change


WRONG: dict[str, tuple[Callable[[Arrays], Arrays], str]] = {
    "step before the start": (with_value("loop/step", np.int64(-5)), "its step is -5, not in 0 .. 50"),
    "step behind the end": (with_value("loop/step", np.int64(51)), "its step is 51"),
    "another step": (with_value("loop/step", np.int64(49)), "'controller/n_steps' is 50, not in 0 .. 49"),
    "an array of steps": (with_value("loop/step", np.arange(3)), "is damaged"),
    "no step": (without("loop/step"), "is damaged"),
    "another time": (with_value("sensation/time_s", np.float64(1.0)), "its time is 1 s, not the 0.05 s of its step"),
    "no height": (without("plant/height"), "'plant/height' is missing"),
    "no stretch": (without("sensation/stretch_m"), "is damaged"),
    "a further array": (with_value("plant/more", np.zeros(3)), "'plant/more' is not of this plant"),
    "another group": (with_value("other/more", np.zeros(3)), "is damaged"),
    "misshapen height": (
        with_value("plant/height", np.zeros((3, 1))),
        "'plant/height' is float64 of shape (3, 1), not",
    ),
    "misshapen stretch": (with_value("sensation/stretch_m", np.zeros(0)), "'sensation/stretch_m' is float64 of shape"),
    "height in words": (with_value("plant/height", np.array(["a", "b", "c"])), "is damaged"),
    "whole heights": (with_value("plant/height", np.zeros(3, dtype=int)), "'plant/height' is int64"),
    "NaN": (with_first("controller/potential", np.nan), "'controller/potential' holds a value that is not finite"),
    "infinity": (with_first("sensation/stretch_m", np.inf), "'sensation/stretch_m' holds a value that is not finite"),
    "steps before the start": (with_value("controller/n_steps", np.array(-1)), "'controller/n_steps' is -1"),
    "noise of floats": (with_value("loop/noise", np.zeros(6)), "'loop/noise' is float64"),
    "noise of zeros": (with_value("loop/noise", np.zeros(6, dtype=np.uint64)), "no generator of noise has the state"),
}


def test_wrong_content_is_refused(subtests: pytest.Subtests, run: Run, tmp_path: Path) -> None:
    for case in WRONG:
        with subtests.test(f"{case!r:.60}"):
            folder = Path(tempfile.mkdtemp(dir=tmp_path))
            change, says = WRONG[case]
            arrays = read_checkpoint(run.path).arrays()
            assert says in refusal(run, folder, packed(change(arrays)))


def test_an_array_takes_no_more_memory_than_it_has_bytes(run: Run, tmp_path: Path) -> None:
    """A header of 128 bytes may declare a petabyte, and 3 kB of compressed zeros unpack to 3 MB."""
    arrays = read_checkpoint(run.path).arrays()
    giant = io.BytesIO()
    np.lib.format.write_array_header_1_0(giant, {"descr": "<f8", "fortran_order": False, "shape": (10**14,)})
    buffer = io.BytesIO(packed(without("plant/height")(arrays)))
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.writestr("plant/height.npy", giant.getvalue())
    assert "holds an array that is not what it says" in refusal(run, tmp_path, buffer.getvalue())
    bomb = packed(arrays | {"plant/height": np.zeros(400_000)}, zipfile.ZIP_DEFLATED)
    assert "is damaged" in refusal(run, tmp_path, bomb)
    objects = packed(without("plant/height")(arrays))
    assert "is damaged" in refusal(run, tmp_path, objects[:-30])


def test_entries_that_are_the_same_bytes_are_refused(run: Run, tmp_path: Path) -> None:
    buffer = io.BytesIO(packed(read_checkpoint(run.path).arrays()))
    with zipfile.ZipFile(buffer, "a") as archive:
        longest = max(archive.infolist(), key=lambda entry: entry.file_size)
        archive.filelist += [longest] * (len(buffer.getvalue()) // longest.file_size)
        archive._didModify = True  # type: ignore[attr-defined]
    assert "declares more than it holds" in refusal(run, tmp_path, buffer.getvalue())


def test_a_generator_from_a_file_is_unpickled_never(run: Run, tmp_path: Path) -> None:
    arrays = read_checkpoint(run.path).arrays()
    buffer = io.BytesIO(packed(without("plant/height")(arrays)))
    member = io.BytesIO()
    np.save(member, np.array([print], dtype=object), allow_pickle=True)
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.writestr("plant/height.npy", member.getvalue())
    assert "is damaged" in refusal(run, tmp_path, buffer.getvalue())


def test_what_is_right_is_continued(run: Run, tmp_path: Path) -> None:
    saved = read_checkpoint(run.path)
    assert saved.misfit(saved, 0.001, 50) is None
    assert saved.misfit(replace(saved, plant={}), 0.001, 50) == "'plant/height' is not of this plant or controller"
    on = simulate(load_config(run.config.model_dump(), {"duration_s": 0.06}), tmp_path / "on", resume=run.path)
    assert on.data["time"].values[-1] == pytest.approx(0.06)
    with h5py.File(run.path, "r") as file:
        slots = [file[name][()].tobytes() for name in SLOTS]  # type: ignore[index]
    payload = newest_payload(slots)
    assert payload is not None
    assert Checkpoint.from_bytes(payload).step == 50

"""A checkpoint whose checksum is right and whose content is not is refused in a sentence, and nothing is begun."""

from __future__ import annotations

import io
import shutil
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from annelid.config import load_config
from annelid.errors import RunFileError
from annelid.simulation import Run, simulate
from annelid.simulation.checkpoint import to_slot
from annelid.simulation.runfile import SLOTS, read_checkpoint


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    config = load_config("riddle2022-planar", {"duration_s": 0.05, "sensor.noise_m": 0.001})
    return simulate(config, tmp_path_factory.mktemp("whole") / "run", progress=False)


def refusal(run: Run, folder: Path, payload: bytes) -> str:
    """Puts a payload into both slots of a copy of a run, and returns how its continuation is refused."""
    path = shutil.copy(run.path, folder / "run.nc")
    with h5py.File(path, "r+") as file:
        file.attrs.pop("schema_version", None)
        for number, name in enumerate(SLOTS, start=1):
            slot = file[name]
            assert isinstance(slot, h5py.Dataset)
            slot[...] = np.frombuffer(to_slot(number, payload).ljust(slot.shape[0], b"\0"), dtype="u1")
    longer = load_config(run.config.model_dump(), {"duration_s": 0.2})
    with pytest.raises(RunFileError) as caught:
        simulate(longer, folder / "on", resume=path, progress=False)
    assert not (folder / "on").exists()
    sentence = str(caught.value)
    assert sentence.startswith(str(path))
    assert sentence.isprintable()
    return sentence


def packed(arrays: dict[str, Any], compression: int = zipfile.ZIP_STORED, **members: bytes) -> bytes:
    """An archive of arrays, and of members that are no arrays, whose names have dashes for slashes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, value in arrays.items():
            member = io.BytesIO()
            np.save(member, value, allow_pickle=True)
            archive.writestr(f"{name}.npy", member.getvalue())
        for name, content in members.items():
            archive.writestr(f"{name.replace('__', '/')}.npy", content)
    return buffer.getvalue()


CHANGES: dict[str, tuple[dict[str, Any], str]] = {
    "step before the start": ({"loop/step": np.int64(-5)}, "its step is -5, not in 0 .. 50"),
    "another step": ({"loop/step": np.int64(49)}, "'controller/n_steps' is 50, not in 0 .. 49"),
    "an array of steps": ({"loop/step": np.arange(3)}, "is damaged"),
    "another time": ({"sensation/time_s": np.float64(1.0)}, "its time is 1 s, not the 0.05 s of its step"),
    "no height": ({"plant/height": None}, "'plant/height' is missing"),
    "no step": ({"loop/step": None}, "is damaged"),
    "a further array": ({"plant/more": np.zeros(3)}, "'plant/more' is not of this plant"),
    "another group": ({"other/more": np.zeros(3)}, "is damaged"),
    "misshapen height": ({"plant/height": np.zeros((3, 1))}, "'plant/height' is float64 of shape (3, 1), not"),
    "height in words": ({"plant/height": np.array(["a", "b", "c"])}, "'plant/height' is <U1"),
    "NaN": ({"controller/potential": np.full(30, np.nan)}, "'controller/potential'"),
    "noise of zeros": ({"loop/noise": np.zeros(6, dtype=np.uint64)}, "no generator of noise has the state"),
    "a function": ({"plant/height": np.array([print], dtype=object)}, "is damaged"),
}


def test_an_array_that_the_run_cannot_have_is_refused(run: Run, tmp_path: Path, subtests: pytest.Subtests) -> None:
    arrays = read_checkpoint(run.path).arrays()
    for number, (case, (changes, says)) in enumerate(CHANGES.items()):
        with subtests.test(case):
            (folder := tmp_path / str(number)).mkdir()
            kept = {name: value for name, value in (arrays | changes).items() if value is not None}
            assert says in refusal(run, folder, packed(kept))


def test_an_archive_takes_no_more_memory_than_it_has_bytes(run: Run, tmp_path: Path) -> None:
    """A header may declare a petabyte, zeros unpack to a thousand times their bytes, entries be the same ones."""
    arrays = read_checkpoint(run.path).arrays()
    petabyte = io.BytesIO()
    np.lib.format.write_array_header_1_0(petabyte, {"descr": "<f8", "fortran_order": False, "shape": (10**14,)})
    without = {name: value for name, value in arrays.items() if name != "plant/height"}
    zeros = packed(arrays | {"plant/height": np.zeros(400_000)}, zipfile.ZIP_DEFLATED)
    repeated = io.BytesIO(packed(arrays))
    with zipfile.ZipFile(repeated, "a") as archive:
        longest = max(archive.infolist(), key=lambda entry: entry.file_size)
        archive.filelist += [longest] * (len(repeated.getvalue()) // longest.file_size)
        archive._didModify = True  # type: ignore[attr-defined]
    cut = packed(arrays)[:-30]
    for number, payload in enumerate(
        (packed(without, plant__height=petabyte.getvalue()), zeros, repeated.getvalue(), cut)
    ):
        (folder := tmp_path / str(number)).mkdir()
        assert "is damaged" in refusal(run, folder, payload)

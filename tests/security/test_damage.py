"""A run that has ended says of every byte whether it is still what was written."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

from annelid.cli import app
from annelid.config import load_config
from annelid.errors import RunFileError
from annelid.simulation import Run, container, digest, open_run, runfile, simulate
from annelid.simulation.recorder import Recorder
from annelid.simulation.runfile import verify_run

SEED = 16


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("whole")
    return simulate(load_config("riddle2022-planar", {"duration_s": 0.05}), folder / "run", progress=False)


def flips(content: bytes, count: int) -> Iterator[tuple[int, bytes]]:
    """Contents with one byte changed each: at random places, then in every byte of the footer."""
    draw = np.random.default_rng(SEED)
    places = [*draw.integers(len(content), size=count).tolist(), *range(len(content) - 64, len(content))]
    for place in places:
        flipped = bytearray(content)
        flipped[place] ^= int(draw.integers(1, 256))
        yield place, bytes(flipped)


def test_every_flipped_byte_is_noticed(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    for place, content in flips(run.path.read_bytes(), 150):
        path.write_bytes(content)
        for read in (verify_run, open_run):
            with pytest.raises(RunFileError, match="damaged") as caught:
                read(path)
            assert "\n" not in str(caught.value), place


@pytest.mark.parametrize("name", ["activation", "time", "checkpoint/slot_1"])
def test_the_damaged_variable_is_named_and_no_other(run: Run, tmp_path: Path, name: str) -> None:
    path = tmp_path / "run.nc"
    group, _, variable = name.rpartition("/")
    with xarray.open_dataset(run.path, engine="h5netcdf", group=group or None) as data:
        own = data[variable].values.tobytes()
    content = bytearray(run.path.read_bytes())
    content[bytes(content).index(own) + len(own) // 2] ^= 8
    path.write_bytes(content)
    done = CliRunner().invoke(app, ["show", str(path), "--verify"])
    assert done.exit_code == 2
    assert done.stderr.rstrip().endswith(f"not as it was when the run ended: {name}")


def test_verify_says_what_it_found(run: Run, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["show", str(run.path.parent), "--verify"])
    assert done.exit_code == 0
    assert done.stdout == f"{run.path} is intact: every byte is as it was when the run ended\n"
    unfinished = tmp_path / "run.nc"
    content = run.path.read_bytes()
    unfinished.write_bytes(content[:-32] + bytes(32))
    assert "carries no digest, so damage would not show: it has not ended, was killed, or its digest" in verify_run(
        unfinished
    )
    assert open_run(unfinished).data.identical(run.data)
    cut = tmp_path / "cut.nc"
    cut.write_bytes(content[:-64])
    with pytest.raises(RunFileError, match="the digest at its end is missing"):
        open_run(cut)


def test_a_large_file_is_compared_on_demand_only(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = bytearray(run.path.read_bytes())
    where = bytes(content).index(run.data["activation"].values.tobytes()) + 10
    content[where] ^= 1
    path = tmp_path / "run.nc"
    path.write_bytes(content)
    monkeypatch.setattr(runfile, "CHECKED_ON_OPENING_BYTES", len(content) - 1)
    assert open_run(path).status == "complete"
    with pytest.raises(RunFileError, match="activation"):
        verify_run(path)


def test_a_run_that_was_killed_carries_no_digest_and_opens(tmp_path: Path) -> None:
    code = (
        "import os, signal, annelid.simulation.digest as d\n"
        "d.write = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "from annelid.config import load_config\n"
        "from annelid.simulation import simulate\n"
        f"simulate(load_config('riddle2022-planar', {{'duration_s': 0.05}}), {str(tmp_path / 'run')!r}, progress=False)"
    )
    done = subprocess.run([sys.executable, "-c", code], check=False, timeout=120)
    assert done.returncode == -signal.SIGKILL
    assert open_run(tmp_path / "run").status == "complete"
    assert "carries no digest" in verify_run(tmp_path / "run")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(5, "Input/output error"), MemoryError()])
def test_a_digest_that_cannot_be_written_ends_the_run_with_its_own_error(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise error

    monkeypatch.setattr(digest, "write", refuse)
    told = RunFileError if isinstance(error, OSError) else type(error)
    with pytest.raises(told):
        simulate(load_config("riddle2022-planar", {"duration_s": 0.05}), tmp_path / "run", progress=False)
    assert open_run(tmp_path / "run").status == "complete"
    assert "or its digest could not be written" in verify_run(tmp_path / "run")


def test_a_run_whose_last_samples_cannot_be_written_is_not_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = container.RawWriter.write

    def full(self: container.RawWriter, name: str, content: Any, skip_bytes: int = 0) -> None:
        if name == "activation":
            raise RunFileError("the disk is full")
        write(self, name, content, skip_bytes)

    monkeypatch.setattr(container.RawWriter, "write", full)
    # Without one, as for a controller that cannot be saved, the last samples are written at the very end.
    monkeypatch.setattr(Recorder, "checkpoint", lambda *_: None)
    with pytest.raises(RunFileError, match="the disk is full"):
        simulate(load_config("riddle2022-planar", {"duration_s": 0.05}), tmp_path / "run", progress=False)
    left = open_run(tmp_path / "run")
    assert (left.status, left.message) == ("disk_failure", "the disk is full")


def test_a_table_that_names_what_is_not_there_is_damage(run: Run, tmp_path: Path) -> None:
    """A stranger can write any table with a right sum."""
    path = tmp_path / "run.nc"
    content = run.path.read_bytes()
    overlap = "1 9 a\n" + "0" * 64 + " 2 9 b"
    for line in ("0 10 a", "-5 10 a", f"0 {10**30} a", "x 1 a", "1 a", "9" * 5000 + " 1 a", overlap):
        table = f"{'0' * 64} {line}\n".encode()
        end = len(content) - 64
        sums = digest.hashlib.sha256(table).digest()
        footer = digest._FOOTER.pack(digest._MAGIC, end, len(table), sums)
        path.write_bytes(content[:end] + table + footer)
        with pytest.raises(RunFileError, match="damaged"):
            open_run(path)


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["riddle2022-planar", "riddle2023-rods"])
def test_200_flipped_bytes_are_noticed_and_harm_no_command(preset: str, tmp_path: Path) -> None:
    config = load_config(preset, {"duration_s": 0.2})
    whole = simulate(config, tmp_path / "run", progress=False).path.read_bytes()
    path, noticed, harmed = tmp_path / "flipped.nc", 0, 0
    for _, content in flips(whole, 200):
        path.write_bytes(content)
        noticed += CliRunner().invoke(app, ["show", str(path), "--verify"]).exit_code == 2
        for words in (["show"], ["export", "--to", "csv", "-o", str(tmp_path / "csv"), "--force"], ["plot"]):
            done = CliRunner().invoke(app, [words[0], str(path), *words[1:]])
            harmed += done.exit_code != 2 or len(done.stderr.splitlines()) != 1
    print(f"{preset}: of 264 flipped bytes {noticed} noticed, {harmed} commands of 792 not ended in a sentence")
    assert (noticed, harmed) == (264, 0)

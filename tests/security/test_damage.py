"""A run that has ended says of every byte whether it is still what was written."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
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
    whole = run.path.read_bytes()
    path.write_bytes(whole)
    assert "is intact: every byte is as it was when the run ended" in verify_run(path)
    assert open_run(path).data.identical(run.data)
    for place, content in flips(whole, 60):
        path.write_bytes(content)
        for read in (verify_run, open_run):
            with pytest.raises(RunFileError, match="damaged") as caught:
                read(path)
            assert "\n" not in str(caught.value), place


def test_a_file_of_0_2_opens_without_a_comparison(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "run.nc"
    path.write_bytes(run.path.read_bytes()[:-64] + b"annelid digest 1".ljust(64, b"7"))
    assert open_run(path).data.identical(run.data)
    assert "carries no digest, so damage would not show: an older version" in verify_run(path)


def test_a_run_without_its_digest_is_unfinished_or_cut(run: Run, tmp_path: Path) -> None:
    path, content = tmp_path / "run.nc", run.path.read_bytes()
    path.write_bytes(content[:-32] + bytes(32))
    assert "carries no digest, so damage would not show: it has not ended, was killed, or its" in verify_run(path)
    assert open_run(path).data.identical(run.data)
    path.write_bytes(content[:-64])
    with pytest.raises(RunFileError, match="the digest at its end is missing"):
        open_run(path)


def test_a_large_file_is_compared_on_demand_only(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = bytearray(run.path.read_bytes())
    where = bytes(content).index(run.data["activation"].values.tobytes()) + 10
    content[where] ^= 1
    path = tmp_path / "run.nc"
    path.write_bytes(content)
    monkeypatch.setattr(runfile, "CHECKED_ON_OPENING_BYTES", len(content) - 1)
    assert open_run(path).status == "complete"
    done = CliRunner().invoke(app, ["show", str(path), "--verify"])
    assert done.exit_code == 2
    assert done.stderr.rstrip().endswith(f"{path} is damaged: it is not as it was when the run ended")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(5, "Input/output error")])
def test_a_digest_that_cannot_be_written_ends_the_run_with_its_own_error(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise error

    monkeypatch.setattr(digest, "write", refuse)
    with pytest.raises(RunFileError if isinstance(error, OSError) else KeyboardInterrupt):
        simulate(load_config("riddle2022-planar", {"duration_s": 0.05}), tmp_path / "run", progress=False)
    assert open_run(tmp_path / "run").status == "complete"


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

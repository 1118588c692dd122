"""One writer a folder: of two that start together one wins whole, and the other is told who writes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest
from typer.testing import CliRunner

from annelid.cli import app, entry
from annelid.cli.run import locked_folder
from annelid.config import load_config
from annelid.errors import RunFileError
from annelid.simulation import open_run, simulate
from annelid.simulation.lock import LOCK_NAME, locked

PLANAR = "riddle2022-planar"


def start(*words: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "annelid", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def holder(folder: Path, then: str) -> subprocess.Popen[str]:
    """A process that locks a folder, says so, and does something."""
    code = (
        "import os, signal, sys\nfrom annelid.simulation.lock import locked\n"
        f"with locked({str(folder)!r}):\n    print('locked', flush=True)\n    {then}\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "locked\n"
    return process


def test_the_other_is_told_who_writes_and_changes_nothing(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "run"
    process = holder(folder, "sys.stdin.readline()")
    before = {entry: entry.stat().st_mtime_ns for entry in folder.iterdir()}
    with pytest.raises(RunFileError, match=rf"process {process.pid} writes into the folder"):
        simulate(load_config(PLANAR, {"duration_s": 0.05}), folder, overwrite=True)
    for words in (["run", PLANAR, "-o"], ["calibrate", "-o"], ["study", "bench", "-o"]):
        done = CliRunner().invoke(app, [*words, str(folder)])
        assert done.exit_code == 2
        assert f"process {process.pid}" in done.stderr
        assert len(done.stderr.splitlines()) == 1
    assert {entry: entry.stat().st_mtime_ns for entry in folder.iterdir()} == before
    process.communicate("end\n", timeout=120)
    assert list(tmp_path.iterdir()) == []


def test_a_lock_ends_with_its_process(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert holder(folder, "os.kill(os.getpid(), signal.SIGKILL)").wait(60) == -signal.SIGKILL
    assert [entry.name for entry in folder.iterdir()] == [LOCK_NAME]
    simulate(load_config(PLANAR, {"duration_s": 0.05}), folder)
    assert [entry.name for entry in folder.iterdir()] == ["run.nc"]


def test_the_same_thread_may_lock_again_and_no_other(tmp_path: Path) -> None:
    with locked(tmp_path), locked(tmp_path / "." / "a" / ".."), locked(tmp_path):
        assert f"process {os.getpid()}" in refusal_of(tmp_path)
    assert list(tmp_path.iterdir()) == []


def refusal_of(folder: Path) -> str:
    """What another thread is told that wants to write there."""
    refused: list[str] = []

    def other() -> None:
        with pytest.raises(RunFileError) as caught, locked(folder):
            pass
        refused.append(str(caught.value))

    thread = threading.Thread(target=other)
    thread.start()
    thread.join(60)
    return refused[0]


def test_a_folder_that_was_replaced_can_be_locked_by_another(tmp_path: Path) -> None:
    with locked(tmp_path / "run"):
        (tmp_path / "run").rename(tmp_path / "moved")
        simulate(load_config(PLANAR, {"duration_s": 0.05}), tmp_path / "other")
        process = holder(tmp_path / "run", "pass")
        process.communicate(timeout=120)
        assert process.returncode == 0


def test_a_lock_file_is_never_written_through(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / LOCK_NAME).symlink_to(tmp_path / "mine")
    with pytest.raises(RunFileError, match="cannot write into the folder"), locked(tmp_path / "run"):
        pass
    assert (tmp_path / "mine").read_text() == "mine"


def test_what_a_lock_file_says_cannot_steer_the_terminal(tmp_path: Path) -> None:
    with locked(tmp_path):
        for text in ("[" * 4000, "\x1b[2J", " 1\x1b[2J", "", " 999999999999999999999"):
            (tmp_path / LOCK_NAME).write_text(text)
            sentence = refusal_of(tmp_path)
            assert "writes into the folder" in sentence
            assert sentence.isprintable()
            assert len(sentence) < 400 + len(str(tmp_path))


def test_a_folder_that_cannot_be_made_is_said_to_be_one() -> None:
    with pytest.raises(RunFileError, match="it cannot be made"), locked("/proc/nowhere/run"):
        pass


@pytest.fixture
def _threads_change_often() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("_threads_change_often")
def test_numbered_folders_are_taken_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    together, everyone_has_one = threading.Barrier(4), threading.Barrier(4)

    def begin() -> Path:
        with ExitStack() as stack:
            entry._locks.set(stack)
            together.wait(60)
            try:
                return locked_folder(None, "worm")
            finally:
                everyone_has_one.wait(60)

    with ThreadPoolExecutor(4) as threads:
        taken = [each.result() for each in [threads.submit(begin) for _ in range(4)]]
    assert sorted(taken) == [Path("runs", f"worm-{i:03d}") for i in range(1, 5)]
    # Nothing was written into them.
    assert list(tmp_path.glob("*/*")) == []


def test_of_two_runs_into_one_folder_one_is_there_whole_and_the_other_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    words = ("run", PLANAR, "--no-video", "-o", str(folder))
    first = start(*words, "--seed", "1", "--duration", "2")
    time.sleep(0.3)
    second = start(*words, "--seed", "2", "--duration", "2.5")
    out = {seed: process.communicate(timeout=120) for seed, process in ((1, first), (2, second))}
    codes = {1: first.returncode, 2: second.returncode}
    assert sorted(codes.values()) == [0, 2], (codes, out)
    winner, loser = (1, 2) if codes[1] == 0 else (2, 1)
    pid = (first if winner == 1 else second).pid
    assert f"process {pid} writes" in out[loser][1], out
    assert len(out[loser][1].splitlines()) == 1
    run = open_run(folder)
    assert (run.config.seed, run.status) == (winner, "complete")
    assert run.data["time"].values[-1] == pytest.approx({1: 2.0, 2: 2.5}[winner])
    assert sorted(os.listdir(folder)) == ["figure7.png", "frame.png", "run.nc"]

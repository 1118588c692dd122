"""Workers end with the command that started them, however it ends, and nobody else can reach them."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")

LIMIT_S = 5.0
"""All processes of a command must be gone after this time."""

LONG = """
preset = "riddle2023-rods"
set.duration_s = 300.0
[[vary]]
field = "arena.friction"
values = [0.3, 0.5, 0.7]
"""


def processes_of(session: int) -> list[psutil.Process]:
    """Processes that a command has started, itself among them, but for such as wait to be collected."""
    found = []
    for process in psutil.process_iter():
        with suppress(psutil.NoSuchProcess, ProcessLookupError, PermissionError):
            if os.getsid(process.pid) == session and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
    return found


def listen_to_signals() -> None:
    """Has a process end by signals that this one was perhaps told to ignore, as by nohup."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


@contextmanager
def started(words: list[str], folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A command in a session of its own, of which nothing is left in the end."""
    with (folder / "log").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, *words],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=log,
            text=True,
            start_new_session=True,
            preexec_fn=listen_to_signals,
        )
        try:
            yield process
        finally:
            for left in processes_of(process.pid):
                with suppress(psutil.NoSuchProcess):
                    left.kill()
            process.wait(60)


def wait_for(condition: Callable[[], object], process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 120
    while not condition():
        assert process.poll() is None, "the command ended before it had workers"
        assert time.monotonic() < end, "no worker was started"
        time.sleep(0.05)


def left_after(process: subprocess.Popen[str], number: signal.Signals) -> list[str]:
    """Sends a signal to the command alone, and returns what is still there after the limit."""
    began = time.monotonic()
    process.send_signal(number)
    while (left := processes_of(process.pid)) and time.monotonic() - began < LIMIT_S:
        time.sleep(0.02)
        process.poll()
    return [str(one) for one in left]


def test_sigterm_ends_a_sweep_as_ctrl_c_does_and_it_opens_no_port(tmp_path: Path) -> None:
    with sweeping(tmp_path) as process:
        ports = [one for part in processes_of(process.pid) for one in part.net_connections()]
        assert [one for one in ports if one.status == psutil.CONN_LISTEN] == []
        assert left_after(process, signal.SIGTERM) == []
        assert process.wait(60) == 130
    log = (tmp_path / "log").read_text()
    assert "annelid: interrupted: finished runs are kept in sweep/runs; go on with:\n  annelid sweep study.toml" in log
    assert "Traceback" not in log
    assert "leaked" not in log


@contextmanager
def sweeping(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A long sweep that has begun with its first run."""
    (folder / "study.toml").write_text(LONG)
    with started(["-m", "annelid", "sweep", "study.toml", "--jobs", "1"], folder) as process:
        wait_for(lambda: any((folder / "sweep" / "runs").glob(".*/run.nc")), process)
        yield process


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_ten_kills_of_each_kind_leave_no_process(number: signal.Signals, tmp_path: Path) -> None:
    draws, codes = random.Random(0), set()
    for i in range(10):
        (tmp_path / str(i)).mkdir()
        with sweeping(tmp_path / str(i)) as process:
            time.sleep(draws.uniform(0.0, 4.0))
            assert left_after(process, number) == []
            codes.add(process.wait(60))
    assert codes == {-signal.SIGKILL if number == signal.SIGKILL else 130}

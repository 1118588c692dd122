"""Runs in processes of their own that get killed or interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import xarray
from toy import SavedToyPlant, ToyController, ToyPlant, toy_config

from annelid.protocols import Array, Sensation
from annelid.simulation import open_run, simulate

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")


def start(out: Path, duration_s: float, pause_s: float) -> subprocess.Popen[str]:
    child = subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("child.py")), str(out), str(duration_s), str(pause_s)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60
    while not (out / "run.nc").exists():
        assert child.poll() is None, child.communicate(timeout=120)
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return child


def test_a_killed_run_keeps_all_but_its_last_second_and_can_be_continued(tmp_path: Path) -> None:
    child = start(tmp_path / "run", 60.0, 0.002)
    began = time.monotonic()
    time.sleep(1.3)
    # While it is going on, another process reads what there is so far.
    live = open_run(tmp_path / "run")
    assert live.status == "running_or_killed"
    assert live.data.sizes["time"] > 50
    time.sleep(0.7)
    child.send_signal(signal.SIGKILL)
    killed = time.monotonic()
    child.communicate(timeout=120)

    with xarray.open_dataset(tmp_path / "run" / "run.nc", engine="h5netcdf") as plain:
        n = int(plain["samples_written"])
        assert n > live.data.sizes["time"]
        np.testing.assert_array_equal(plain["control_steps"][:n], np.arange(n))
        assert plain["control_steps"][n:].isnull().sum() > 0
    run = open_run(tmp_path / "run")
    assert run.status == "running_or_killed"
    assert run.data.sizes["time"] == n
    assert not any(run.data[name].isnull().any() for name in ("stretch_length", "potential", "activation", "qpos"))
    # The loop starts as soon as the file appears.
    assert killed - began - run.wall_time_s <= 1.0

    config = toy_config(duration_s=run.data["time"].values[-1] + 0.1, record__signals_interval_s=0.001)
    second = simulate(
        config, tmp_path / "on", plant=SavedToyPlant(), controller=ToyController(), resume=tmp_path / "run"
    )
    whole = simulate(config, tmp_path / "whole", plant=SavedToyPlant(), controller=ToyController())
    joined = xarray.concat(
        [run.data["potential"][: int(second.data["control_steps"][0])], second.data["potential"]], "time"
    )
    np.testing.assert_array_equal(joined, whole.data["potential"])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_once_it_ends_in_good_order(tmp_path: Path, number: signal.Signals) -> None:
    child = start(tmp_path / "run", 60.0, 0.002)
    time.sleep(0.3)
    child.send_signal(number)
    out, err = child.communicate(timeout=30)
    assert child.returncode == 0, err
    assert out.split() == ["started", "interrupted"]
    run = open_run(tmp_path / "run")
    assert run.status == "interrupted"
    assert number.name in run.message
    # Everything up to the instant it stopped at: one sample a control step.
    assert f"at {run.data['time'].values[-1]:.6g} s" in run.message
    assert run.data.sizes["time"] > 10


def test_interrupted_twice_it_leaves_at_once(tmp_path: Path) -> None:
    # One control step takes 20 s, so the first signal alone would not end it soon.
    child = start(tmp_path / "run", 60.0, 20.0)
    time.sleep(0.3)
    child.send_signal(signal.SIGINT)
    time.sleep(0.3)
    assert child.poll() is None
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=10)
    assert child.returncode != 0
    assert "KeyboardInterrupt" in err
    assert open_run(tmp_path / "run").status == "interrupted"


def test_handlers_are_put_back(tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    inside: list[object] = []

    class Looking(ToyController):
        def step(self, sensation: Sensation) -> Array:
            inside.append(signal.getsignal(signal.SIGINT))
            return super().step(sensation)

    simulate(toy_config(), tmp_path, plant=ToyPlant(), controller=Looking())
    assert inside[0] != before[0]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_a_run_in_another_thread_needs_no_signals(tmp_path: Path) -> None:
    thread = threading.Thread(
        target=simulate,
        args=(toy_config(), tmp_path),
        kwargs={"plant": ToyPlant(), "controller": ToyController()},
    )
    thread.start()
    thread.join(60)
    assert open_run(tmp_path).status == "complete"

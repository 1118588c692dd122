"""The command `sweep`: what it writes and says, and that killing whatever computes it loses and doubles nothing."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
import xarray as xr

from annelid.cli.entry import EXIT_SOME_FAILED
from annelid.experiment.outcome import OUTCOME_NAME
from annelid.experiment.store import DRAFTS
from outcome import Command

SHORT = """
preset = "riddle2022-planar"
set.duration_s = 0.2
[[vary]]
field = "body.gain"
values = [1.0, 1e4]
[[vary]]
field = "controller.scheme"
choices = ["euler", "heun"]
"""


@pytest.mark.usefixtures("runs_in_this_process")
def test_a_sweep_ends_with_a_table_and_its_files(annelid: Command) -> None:
    Path("study.toml").write_text(SHORT)
    done = annelid("sweep", "study.toml", "-o", "out", "--jobs", "1")
    assert done.exit_code == EXIT_SOME_FAILED, done.err
    assert done.out.splitlines()[-3:] == [str(Path("out", name)) for name in ("sweep.nc", "sweep.csv", "sweep.png")]
    assert "4 runs, of which 2 are complete" in done.out
    assert "2 failed" in done.out
    assert "overshoot" in done.out
    data = xr.load_dataset("out/sweep.nc", engine="h5netcdf")
    assert dict(data.sizes) == {"body.gain": 2, "controller.scheme": 2, "segment": 3}
    assert data.status.values.tolist() == [["complete"] * 2, ["failed"] * 2]
    assert all("overshoot" in reason for reason in data.reason.values[1])
    assert data.elongation_mean_max_m.sel({"body.gain": 1.0}).notnull().all()
    rows = list(csv.DictReader(Path("out/sweep.csv").read_text().splitlines()))
    assert [row["status"] for row in rows] == ["complete", "complete", "failed", "failed"]
    assert [row["controller.scheme"] for row in rows] == ["euler", "heun"] * 2
    folders = {path.name for path in Path("out/runs").iterdir() if path.is_dir()}
    assert {row["run"] for row in rows if row["run"]} == folders


@pytest.mark.usefixtures("runs_in_this_process")
def test_a_checked_sweep_says_what_is_resolved_in_words_and_in_json(annelid: Command) -> None:
    Path("study.toml").write_text(SHORT.replace("1.0, 1e4", "1.31, 1.4").replace("0.2", "1.0"))
    words = ("sweep", "study.toml", "-o", "out", "--jobs", "1", "--check", "2")
    done = annelid(*words)
    assert done.exit_code == 0, done.err
    assert done.out.splitlines()[-4] == "Checked 2 of 4 runs: all resolved."
    assert "Checked" not in annelid(*words, "--quiet").out
    results = json.loads(annelid(*words, "--json").out)["results"]
    assert [row["check"] for row in results["sweep.csv"]] == ["resolved", None, None, "resolved"]
    assert list(results["check"]) == ["0", "3"]
    assert results["check"]["0"]["resolved"]
    assert results["check"]["0"]["sentence"].startswith("Resolved: with half the step (0.5 ms)")


def test_the_example_is_a_study_that_runs_after_its_first_line(annelid: Command) -> None:
    from annelid.config import load_study
    from annelid.experiment.sweep import plan_of

    text = annelid("sweep", "--example").out
    assert text.splitlines()[0].startswith("# A sweep:  annelid sweep study.toml")
    Path("study.toml").write_text(text)
    plan = plan_of(load_study("study.toml"))
    assert len(plan.points) == 12
    assert all(case.config for _, case in plan.points)
    fields = {line.split("=")[0].strip("# ") for line in text.splitlines() if "=" in line}
    assert {"samples", "seed", "repeats", "outputs", "rank", "keep"} <= fields


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "name a study"),
        (("missing.toml",), "cannot read"),
        (
            ("study.toml", "--cluster", "slurm"),
            "--cluster and ANNELID_CLUSTER are no more: leave them out",
        ),
        (("study.toml", "--scheduler", "here", "--jobs", "2"), "--jobs is for processes of this machine"),
        (("study.toml", "--samples", "8"), "has no effect on design = 'grid'"),
        (("study.toml", "-o", "study.toml"), "study.toml is a file"),
    ],
)
def test_bad_input_ends_in_one_sentence_before_anything_runs(
    annelid: Command, arguments: tuple[str, ...], says: str
) -> None:
    Path("study.toml").write_text(SHORT)
    done = annelid("sweep", *arguments)
    assert done.exit_code == 2
    assert says in " ".join(done.err.split())
    assert [path.name for path in Path().iterdir()] == ["study.toml"]


MANY = """
preset = "riddle2022-planar"
design = "sobol"
samples = 200
set.duration_s = 0.3
[[vary]]
field = "controller.gate_time_constant_ms"
from = 100.0
to = 600.0
[[vary]]
field = "sensor.tolerance_m"
from = 0.001
to = 0.02
log = true
"""


@contextmanager
def started(*words: str | Path, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A process with its own session, of which nothing is left in the end."""
    with (folder / f"{Path(words[1]).name}.log").open("ab") as log:
        process = subprocess.Popen(words, cwd=folder, stdout=log, stderr=log, start_new_session=True)
        try:
            yield process
        finally:
            kill_all(process)


def kill_all(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait(60)


def n_done(folder: Path) -> int:
    return len(list(folder.glob(f"out/runs/[!.]*/{OUTCOME_NAME}")))


def wait_for(condition: Callable[[], bool], limit_s: float) -> None:
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.05)


@pytest.mark.slow
def test_two_hundred_runs_outlive_their_worker_their_scheduler_and_their_sweep(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(MANY)
    tool = str(Path(sys.executable).with_name("dask"))
    sweep = [sys.executable, "-m", "annelid", "sweep", "study.toml", "-o", "out"]
    with ExitStack() as stack:
        scheduler_words = [tool, "scheduler", "--port", "0", "--dashboard-address", ":0", "--scheduler-file", "at.json"]
        scheduler = stack.enter_context(started(*scheduler_words, folder=tmp_path))
        wait_for((tmp_path / "at.json").exists, 60)
        worker = [tool, "worker", "--scheduler-file", "at.json", "--nthreads", "1", "--no-dashboard"]
        workers = [stack.enter_context(started(*worker, folder=tmp_path)) for _ in range(2)]
        first = stack.enter_context(started(*sweep, "--scheduler", "at.json", folder=tmp_path))
        wait_for(lambda: n_done(tmp_path) >= 30, 200)
        # The process that computes, not the one that watches over it and starts another.
        psutil.Process(workers[0].pid).children(recursive=True)[-1].kill()
        wait_for(lambda: n_done(tmp_path) >= 80, 200)
        kill_all(scheduler)
        assert first.wait(60) == 2
    log = (tmp_path / "-m.log").read_text()
    assert "the workers are gone: what is done is kept" in log
    assert 80 <= n_done(tmp_path) < 200
    before = written(tmp_path)

    with started(*sweep, "--jobs", "2", folder=tmp_path) as second:
        wait_for(lambda: n_done(tmp_path) >= 140, 200)
        kill_all(second)
    assert 140 <= n_done(tmp_path) < 200
    before |= written(tmp_path)

    third = subprocess.run(
        [*sweep, "--jobs", "2", "--quiet"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=600
    )
    assert third.returncode == 0, third.stderr
    data = xr.load_dataset(tmp_path / "out" / "sweep.nc", engine="h5netcdf")
    assert data.sizes["sample"] == 200
    assert set(data.status.values) == {"complete"}
    assert len(set(data.run.values)) == 200
    assert {path.name for path in (tmp_path / "out" / "runs").iterdir() if path.is_dir()} == set(data.run.values)
    assert not list((tmp_path / "out" / "runs").glob(DRAFTS))
    after = written(tmp_path)
    assert {name: after[name] for name in before} == before, "a finished run was computed again"
    assert bool(np.isfinite(data.elongation_mean_max_m).all())


def written(folder: Path) -> dict[str, int]:
    """When each finished run's file was last written."""
    return {
        path.parent.name: path.with_name("run.nc").stat().st_mtime_ns
        for path in folder.glob(f"out/runs/[!.]*/{OUTCOME_NAME}")
    }

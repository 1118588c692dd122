"""The command `sweep`: what it writes and says."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
import xarray as xr

from annelid.cli.entry import EXIT_SOME_FAILED
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
def test_a_check_says_which_runs_are_resolved_in_rows_words_and_json(
    annelid: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of three complete runs the first and the last are checked; half the step moves them by 1 % and by 5 %."""
    monkeypatch.setattr("annelid.experiment.convergence.RESOLVED", 0.03)
    monkeypatch.setattr("annelid.experiment.sweep.sweep_figure", lambda *_: Path("sweep.png"))
    grid, _, _ = SHORT.replace("1.0, 1e4", "0.3, 1.0, 1.4, 1e4").rpartition("[[vary]]")
    Path("study.toml").write_text(grid)
    words = ("sweep", "study.toml", "-o", "out", "--jobs", "1", "--check", "2")
    assert "Checked 2 of 4 runs: not resolved: run 2; sweep.csv says what moves.\n" in annelid(*words).out
    results = json.loads(annelid(*words, "--json").out)["results"]
    first, second, third, fourth = [row["check"] for row in results["sweep.csv"]]
    assert (first, second, fourth) == ("resolved", None, None)
    assert third.startswith("these numbers move by more than 3 %: ")
    assert "elongation (4.8 %)" in third
    assert {number: one["resolved"] for number, one in results["check"].items()} == {"0": True, "2": False}


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

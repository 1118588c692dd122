"""Tasks of a newcomer, each with what one page says and nothing else, in an empty home and an empty folder."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from doc_commands import Command, Script, Written, commands_of, steps_of

from annelid.simulation.runfile import open_run
from annelid_lab.logs.agreement import run_series


@dataclass(frozen=True)
class Task:
    """What a newcomer wants, and how the page says it is done."""

    page: str
    commands: tuple[str, ...] = ()  # As they stand in the page, RUN being the run first
    python: bool = False  # Whether the page's Python is executed too, its blocks one after another
    first_block: bool = False  # Whether only the first of these is
    gives: tuple[str, ...] = ()  # Files that are there afterwards
    prints: str = ""
    own: Callable[[Path], object] | None = None  # Brings what is the newcomer's own, behind the first command


def own_log(folder: Path) -> None:
    """A log as the page's map describes one: of another clock, with noise."""
    run = open_run(folder / "walk")
    clock = np.arange(0.0, 7.0, 0.02)
    columns = {"t_ms": 1e3 * clock + 12_345.0}
    signals = ("s1_left_mm", "stretch_length[1, left]", 1e3, 0.0), ("s2_mm", "stretch_length[2, mean]", 1e3, 0.0)
    angle = "motor_deg", "ring_length[ring_0]", -np.degrees(1 / 0.02), 40.0
    for name, signal, scale, offset in (*signals, ("force (N)", "muscle_force[ring_0]", 1.0, 0.0), angle):
        time_s, values, _ = run_series(run, signal)
        noise = np.random.default_rng(1).normal(0.0, 0.01, len(clock))
        columns[name] = scale * (np.interp(clock + 2.0, time_s, values) + noise * np.std(values)) + offset
    table = np.column_stack([*columns.values()])
    np.savetxt(folder / "robot.csv", table, delimiter=",", header=",".join(columns), comments="")


TASKS = {
    "a first run": Task(
        "docs/start.md",
        (
            "annelid run -o first",
            "annelid show first",
            "annelid draw first -o lengths.png",
            "annelid draw first --time 1.5 -o contracted.png",
        ),
        python=True,
        gives=("first/run.nc", "lengths.png", "contracted.png"),
        prints="period",
    ),
    "sweep and plot": Task(
        "docs/sweeps.md",
        ("annelid sweep --example > study.toml", "annelid sweep study.toml -o sweep"),
        gives=("sweep/sweep.csv", "sweep/sweep.png"),
    ),
    "export and open elsewhere": Task(
        "docs/data_out.md",
        (
            "annelid run -o first",
            "annelid export RUN --to csv",
            "annelid export RUN --to mat",
            "annelid export RUN --to parquet -o parquet",
            "annelid export RUN --to html",
        ),
        python=True,
        first_block=True,
        gives=("first/csv/time_muscle.csv", "first/run.mat", "parquet/time_muscle.parquet", "first/report.html"),
    ),
    "Gymnasium": Task("docs/environments.md", python=True, first_block=True, prints="["),
    "own data": Task(
        "docs/how_to/measured_data.md",
        (
            "annelid run riddle2023-rods --duration 10 -o walk",
            "annelid compare walk robot.csv --map robot.toml -o robot",
        ),
        gives=("robot/agreement.json", "robot/agreement.png"),
        prints="lag -10.3",
        own=own_log,
    ),
    "own size": Task(
        "docs/how_to/own_size.md",
        (
            "annelid new small.toml --radius 0.05 --segments 5 --helices 8 --length 0.4",
            "annelid check small.toml",
            "annelid run small.toml -o small",
        ),
        gives=("small.toml", "small/run.nc", "small/figure7.png"),
        prints="no doubts",
    ),
    "ring force": Task(
        "docs/how_to/ring_force.md", ("annelid study load-frame --diameter-share 0.5 -o frame",), prints="2.29"
    ),
    "five segments and a speed": Task(
        "docs/how_to/speed.md",
        ("annelid run riddle2023-rods --segments 5 --duration 20 -o five", "annelid show five"),
        prints="body lengths/s",
    ),
    "one synapse and its potentials": Task(
        "docs/how_to/change_a_synapse.md",
        (
            "annelid run riddle2023-rods -o before",
            "annelid export-network riddle2023-rods --to toml -o network.toml",
            "annelid run riddle2023-rods --network network.toml -o after",
            "annelid compare before after -o both",
        ),
        gives=("after/figure7.png", "both/lengths.png"),
    ),
    "sloped pipe": Task(
        "docs/tutorials/pipes.md",
        (
            "annelid run crawler --arena pipe --set arena.slope_deg=10 --duration 6 -o uphill",
            "annelid draw uphill --time 3 --camera side -o uphill/side.png",
        ),
        gives=("uphill/side.png",),
    ),
}
FAST = ("Gymnasium",)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in FAST)) for name in TASKS])
def test_a_newcomer_does_it_from_one_page(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    task = TASKS[name]
    home, folder = tmp_path / "home", tmp_path / "work"
    home.mkdir()
    folder.mkdir()
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.defpath])
    kept = {word: os.environ[word] for word in ("MUJOCO_GL", "LANG") if word in os.environ}
    environment = {"HOME": str(home), "PATH": programs, "TERM": "dumb", **kept}
    told: list[str] = []

    def do(*words: str) -> None:
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{words[-1]}\n{done.stdout}\n{done.stderr}"
        assert "Traceback" not in done.stderr
        told.append(done.stdout)

    began = time.monotonic()
    steps = steps_of(task.page)
    for step in steps:
        if isinstance(step, Written):
            (folder / step.name).write_text(step.text, encoding="utf-8")
    for command in task.commands:
        typed = Command(tuple(shlex.split(command.partition(" > ")[0])))
        assert typed in commands_of(task.page), f"{task.page} does not say {command}"
        do("sh", "-c", command.replace("RUN", "first"))
        if task.own and command == task.commands[0]:
            task.own(folder)
    if task.python:
        blocks = [step.code for step in steps if isinstance(step, Script)][: 1 if task.first_block else None]
        do(sys.executable, "-c", "import matplotlib; matplotlib.use('Agg')\n" + "\n".join(blocks))
    for path in task.gives:
        assert (folder / path).stat().st_size > 0, path
    assert task.prints in "".join(told)
    with capsys.disabled():
        print(f"{name}: {time.monotonic() - began:.0f} s")

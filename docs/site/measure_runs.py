"""Runs a list of commands and writes the numbers of every run as a row of one table.

    python docs/site/measure_runs.py docs/results/wang.toml

writes ``docs/results/wang.csv``. The list has a table ``[runs]`` of commands ``annelid run ..`` by names; the numbers
are those of ``annelid show RUN --json``, but for times of computing.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import annelid
from annelid.output import write_csv

LEFT_OUT = ("name", "onsets_s", "warnings", "real_time_factor", "rhythm_reason")


def measured(command: str) -> dict[str, Any]:
    """Runs a command line, and returns the numbers of its run by name; one a segment where there is one for each.

    Raises:
        subprocess.CalledProcessError: The command failed. A run that a guard stops is no failure.
    """
    with TemporaryDirectory() as folder:
        words = [*shlex.split(command)[1:], "--no-video", "--quiet", "--out", f"{folder}/run"]
        # Pictures are not looked at.
        environment = {**os.environ, "MUJOCO_GL": "disable"}
        whole = [sys.executable, "-m", "annelid", *words]
        done = subprocess.run(whole, stdout=subprocess.DEVNULL, env=environment, check=False)
        if done.returncode not in (0, 3):
            done.check_returncode()
        run = annelid.open_run(f"{folder}/run")
        step_s = run.config.clock.physics_timestep_s
        numbers = {"step_s": step_s, **annelid.summary(run).to_dict()}
    return {name: value for name, value in _flat(numbers) if name not in LEFT_OUT}


def _flat(numbers: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in numbers.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}_")
        elif name == "order":
            yield name, "-".join(map(str, value))
        elif isinstance(value, list) and name not in LEFT_OUT:
            yield from _flat({str(segment): each for segment, each in enumerate(value, start=1)}, f"{prefix}{name}_")
        else:
            yield prefix + name, f"{value:.10g}" if isinstance(value, float) else value


def main(path: Path) -> None:
    """Measures all runs of a list, as many at a time as there are cores."""
    runs = tomllib.loads(path.read_text(encoding="utf-8"))["runs"]
    rows: list[dict[str, Any]] = []
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        for (name, command), numbers in zip(runs.items(), threads.map(measured, runs.values()), strict=True):
            print(command, flush=True)
            rows.append({"run": name, "command": command, **numbers})
    columns = dict.fromkeys(name for row in rows for name in row)
    print(write_csv(path.with_suffix(".csv"), columns, ([row.get(name) for name in columns] for row in rows)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""Identifies worms from their walks, blind, and counts how often the intervals hold the truth (docs/evidence).

Each robot is a coarse worm of drawn size, stiffness, damping, friction and tolerance. Its log has three stretch sensors
with noise, a slow error, gaps, and another zero of time. Stiffness and damping time are fitted.
Run ``python benchmarks/identify_walks.py RESULTS.csv``; a minute of two cores for each of 50. It continues where it
was stopped.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from identify_recovery import slow, summary, write_log
from numpy.typing import NDArray

from annelid import load_config, simulate
from annelid.experiment import SHEAR_OVER_YOUNG
from annelid.output import write_csv
from annelid_lab.calibration import Simulations, identify, load_identify_study
from annelid_lab.logs import run_series

WALKS = 50
SPAN_S, RUN_S = 5.4, 6.0
SIGNALS = [f"stretch_length[{segment}, mean]" for segment in (1, 2, 3)]
DRAWN = {"young_modulus": (0.2e9, 0.4e9), "damping_time": (0.08, 0.2)}
"""Ranges that the fitted parameters are drawn from, equal ratios alike."""
HEADS = ("robot", "parameter", "truth", "value", "low", "high", "rms", "rms_truth", "tests", "warnings")


def make_walk(number: int, folder: Path) -> tuple[dict[str, Any], dict[str, float]]:
    """Draws a robot, writes the log of its walk into a folder, and returns what is known of it, and the truth."""
    rng = np.random.default_rng([2027, number])
    truth = {name: float(np.exp(rng.uniform(*np.log(ends)))) for name, ends in DRAWN.items()}
    known = {
        "duration_s": RUN_S,
        "body.mesh.elements_per_side": 1,
        "body.mesh.radius_m": float(f"{0.16 * np.exp(rng.uniform(-0.05, 0.05)):.4g}"),
        "arena.friction": float(f"{rng.uniform(0.3, 1.0):.3g}"),
        "sensor.tolerance_m": float(f"{rng.uniform(0.013, 0.02):.3g}"),
    }
    secret = {
        "body.strands.young_modulus_Pa": truth["young_modulus"],
        "body.strands.shear_modulus_Pa": truth["young_modulus"] * SHEAR_OVER_YOUNG,
        "body.strands.damping_time_s": truth["damping_time"],
    }
    run = simulate(load_config("riddle2023-rods", known | secret), folder / "robot", progress=False)
    clock = np.arange(0.0, SPAN_S, 0.02)
    noise_m, slow_m, shift_s = rng.uniform(2e-4, 8e-4), rng.uniform(0.0, 3e-4), rng.uniform(0.1, RUN_S - SPAN_S)
    lengths: list[NDArray[np.float64]] = []
    for signal in SIGNALS:
        time_s, length_m, _ = run_series(run, signal)
        error_m = rng.normal(0.0, noise_m, len(clock)) + slow(rng, clock, slow_m, 1.0)
        lengths.append(np.interp(clock + shift_s, time_s, length_m) + error_m)
    return write_walk(folder, clock, lengths, known, rng), truth


def write_walk(
    folder: Path,
    clock: NDArray[np.float64],
    lengths: Sequence[NDArray[np.float64]],
    known: dict[str, Any],
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Writes a log of lengths, m, and its map into a folder, and returns a study of it."""
    log = {"time_s": clock} | {f"s{segment}_mm": 1e3 * one for segment, one in enumerate(lengths, start=1)}
    write_log(folder / "walk.csv", log, rng)
    rows = [f's{segment}_mm = "{signal}"' for segment, signal in enumerate(SIGNALS, start=1)]
    (folder / "map.toml").write_text("\n".join(['time = "time_s"', "[map]", *rows]))
    return {
        "preset": "riddle2023-rods",
        "set": known,
        "parameters": {"young_modulus": {"start": 3e8}, "damping_time": {"start": 0.145}},
        "experiments": [{"kind": "walk", "name": "walk", "data": "walk.csv", "map": "map.toml"}],
    }


def rows_of(number: int, executor: ProcessPoolExecutor) -> list[list[object]]:
    """Identifies one robot; a row for each parameter."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study, truth = make_walk(number, folder)
        found = identify(load_identify_study(study), folder, Simulations(None, executor))
        model, (part,) = found.fit.emulator.model, found.fit.parts
        true = model.run([np.log([*truth.values()])])[0]
        off = np.nan if true is None else float(np.sqrt(((model.measured(true)[0] - part.data.values) ** 2).mean()))
    ends = found.intervals.profile.tolist()
    return [
        [number, name, truth[name], value, *ends[i], part.rms, off, found.fit.n_tests, len(found.warnings)]
        for i, (name, value) in enumerate(found.fit.values.items())
    ]


def main(path: Path, walks: int, first: int, jobs: int) -> None:
    """Identifies the robots that a table of results lacks."""
    if not path.exists():
        path.write_text(",".join(HEADS) + "\n", encoding="utf-8")
    with path.open(encoding="utf-8") as file:
        done = {int(row["robot"]) for row in csv.DictReader(file)}
    with ProcessPoolExecutor(jobs, get_context("spawn")) as executor:
        for number in range(first, walks):
            if number in done:
                continue
            rows = [
                [f"{cell:.6g}" if isinstance(cell, float) else cell for cell in row]
                for row in rows_of(number, executor)
            ]
            with path.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows(rows)
            print(f"walk {number} of {walks}", flush=True)
    columns = ("parameter", "n", "inside", "bias", "half_width", "error")
    table = write_csv(path.with_stem(f"{path.stem}_table"), columns, summary(path, DRAWN))
    print(table.read_text(encoding="utf-8"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("csv", type=Path, help="file for the numbers, which goes on where it ended")
    parser.add_argument("--first", type=int, default=0, help="number of the first robot")
    parser.add_argument("--walks", type=int, default=WALKS, help="number past the last robot")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="runs at a time")
    given = parser.parse_args()
    main(given.csv, given.walks, given.first, given.jobs)

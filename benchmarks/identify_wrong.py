"""Identifies robots that the model cannot be, and counts how many of them are noticed (docs/evidence/calibration.md).

Every robot walks as the worm of ``annelid calibrate --example walk``, but for one thing that the study does not know.
Modulus and damping time are fitted. The first robot is as the study says and should bring no warning.
Run ``python benchmarks/identify_wrong.py RESULTS.csv``; two minutes of two cores for each of 12. It continues where it
was stopped, and keeps the runs beside the results.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from identify_recovery import slow
from identify_walks import RUN_S, SIGNALS, SPAN_S, write_walk

from annelid import load_config, simulate
from annelid.experiment import SHEAR_OVER_YOUNG
from annelid_lab.calibration import Simulations, identify, load_identify_study
from annelid_lab.logs import run_series

KNOWN = {"duration_s": RUN_S, "body.mesh.elements_per_side": 1}
YOUNG_PA, DAMPING_S, NOISE_M, SHIFT_S = 0.24e9, 0.11, 5e-4, 0.5
HEADS = ("robot", "young_modulus", "damping_time", "rms", "tests", "warnings")


class Robot(NamedTuple):
    """What the study does not know of a robot.

    Attributes:
        fields: Of its worm.
        gains: Of its sensors.
        slow_m: Size of a slow error of its sensors.
    """

    fields: dict[str, Any]
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    slow_m: float = 0.0


STIFFER = [YOUNG_PA, 1.3 * YOUNG_PA, YOUNG_PA]
ROBOTS = {
    "as the study says": Robot({}),
    "middle segment 30 % stiffer": Robot(
        {
            "body.strands.young_modulus_Pa": STIFFER,
            "body.strands.shear_modulus_Pa": [SHEAR_OVER_YOUNG * one for one in STIFFER],
        }
    ),
    "slipping floor": Robot({"arena.friction": 0.1}),
    "friction of the crossings": Robot({"body.joints.viscous_friction_Nms_per_rad": 0.2}),
    "radius 5 % larger": Robot({"body.mesh.radius_m": 0.168}),
    "tolerance of 18 mm, not 15 mm": Robot({"sensor.tolerance_m": 0.018}),
    "slower gates": Robot({"controller.gate_time_constant_ms": 400.0}),
    "gain of one sensor 5 % high": Robot({}, gains=(1.0, 1.05, 1.0)),
    "slow error of 2 mm": Robot({}, slow_m=2e-3),
    "twice as many elements": Robot({"body.mesh.elements_per_side": 2}),
    "strands 50 % heavier": Robot({"body.strands.linear_density_kg_per_m": 0.0194}),
    "first muscle 10 % weaker": Robot({"body.rings.peak_force_N": [105.8, 117.57, 117.57]}),
}


def write_log_of(robot: Robot, folder: Path) -> dict[str, Any]:
    """Writes the log of a robot's walk into a folder, and returns the study."""
    material = {
        "body.strands.young_modulus_Pa": YOUNG_PA,
        "body.strands.shear_modulus_Pa": SHEAR_OVER_YOUNG * YOUNG_PA,
        "body.strands.damping_time_s": DAMPING_S,
    }
    config = load_config("riddle2023-rods", KNOWN | material | robot.fields)
    run = simulate(config, folder / "robot", progress=False)
    rng, clock = np.random.default_rng(2028), np.arange(0.0, SPAN_S, 0.02)
    lengths = []
    for signal, gain in zip(SIGNALS, robot.gains, strict=True):
        time_s, length_m, _ = run_series(run, signal)
        error_m = rng.normal(0.0, NOISE_M, len(clock))
        if robot.slow_m:
            error_m += slow(rng, clock, robot.slow_m, 1.0)
        lengths.append(gain * np.interp(clock + SHIFT_S, time_s, length_m) + error_m)
    return write_walk(folder, clock, lengths, KNOWN, rng)


def main(path: Path, jobs: int) -> None:
    """Identifies the robots that a table of results lacks."""
    if not path.exists():
        path.write_text(",".join(HEADS) + "\n", encoding="utf-8")
    with path.open(encoding="utf-8") as file:
        done = {row["robot"] for row in csv.DictReader(file)}
    with ProcessPoolExecutor(jobs, get_context("spawn")) as executor:
        for name, robot in ROBOTS.items():
            if name in done:
                continue
            with tempfile.TemporaryDirectory() as place:
                study = load_identify_study(write_log_of(robot, Path(place)))
                runs = Simulations(path.with_name(f"{path.stem}_runs"), executor)
                found = identify(study, Path(place), runs)
            (part,) = found.fit.parts
            numbers = [f"{one:.6g}" for one in (*found.fit.values.values(), part.rms)]
            with path.open("a", encoding="utf-8", newline="") as file:
                row = [name, *numbers, found.fit.n_tests, " | ".join(found.warnings)]
                csv.writer(file, lineterminator="\n").writerow(row)
            print(f"{name}: {' | '.join(found.warnings) or 'no warning'}", flush=True)
    with path.open(encoding="utf-8") as file:
        noticed = {row["robot"]: bool(row["warnings"]) for row in csv.DictReader(file)}
    wrong = [noticed[name] for name in list(ROBOTS)[1:] if name in noticed]
    print(f"noticed: {sum(wrong)} of {len(wrong)}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("csv", type=Path, help="file for the numbers, which goes on where it ended")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="runs at a time")
    given = parser.parse_args()
    main(given.csv, given.jobs)

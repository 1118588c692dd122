"""Identifies synthetic robots blind, and counts how often the intervals hold the truth (docs/calibration.md).

Each robot is a coarse worm of drawn parameters. A tensile test of its tube, a loop of its load frame and a ring-down
of a strand are made, with noise, a slow error that the model does not know, rows that are missing and cells that are
empty. Run ``python benchmarks/identify_recovery.py RESULTS.csv``; it takes a quarter of an hour of one core for all 50.
It continues where it was stopped.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid import load_config
from annelid.experiment import SHEAR_OVER_YOUNG
from annelid.output import write_csv
from annelid_lab.calibration import Loop, cable_force, identify, load_identify_study
from annelid_lab.calibration.kinds.load_frame import FrameTest
from annelid_lab.calibration.kinds.ring_down import RingDown
from annelid_lab.calibration.kinds.tensile import Tensile

ROBOTS = 50
REACH_M = 0.24
DRAWN = {
    "young_modulus": (0.15e9, 0.6e9),
    "softening_strain": (0.004, 0.02),
    "dry_friction": (0.004, 0.02),
    "cable_friction": (0.8, 2.5),
    "damping_time": (0.03, 0.15),
}
"""Ranges that parameters are drawn from, equal ratios alike."""
STUDY: dict[str, Any] = {
    "preset": "riddle2023-rods",
    "set": {
        "body.strands.radius_m": 0.00299,
        "body.strands.linear_density_kg_per_m": 0.01605,
        "body.mesh.elements_per_side": 1,
        "body.mesh.n_helices": 6,
        "body.springs.stiffness_N_per_m": 24.5,
    },
    "parameters": {
        "young_modulus": {"start": 0.3e9},
        "softening_strain": {},
        "dry_friction": {"start": 0.008},
        "cable_friction": {},
        "damping_time": {"start": 0.07},
    },
    "experiments": [
        {
            "kind": "tensile",
            "name": "tube",
            "data": "tube.csv",
            "length_m": 0.034,
            "outer_diameter_m": 0.00635,
            "inner_diameter_m": 0.004318,
            "points": 30,
        },
        {"kind": "load-frame", "name": "frame", "data": "frame.csv", "points": 12, "haste": 16.0},
        {"kind": "ring-down", "name": "strand", "data": "strand.csv", "length_m": 1.2, "points": 100},
    ],
}
HEADS = ("robot", "parameter", "truth", "value", "low", "high")


def slow(rng: np.random.Generator, at: NDArray[np.float64], size: float, length: float) -> NDArray[np.float64]:
    """Draws an error that is correlated over a length."""
    covariance = size**2 * np.exp(-np.abs(at[:, None] - at) / length) + 1e-12 * size**2 * np.eye(len(at))
    return np.linalg.cholesky(covariance) @ rng.normal(size=len(at))


def write_log(path: Path, columns: Mapping[str, NDArray[np.float64]], rng: np.random.Generator) -> None:
    """Writes a table that lacks a tenth of its rows, a stretch of them, and some cells of its last column."""
    table = np.column_stack([*columns.values()])
    kept = rng.random(len(table)) > 0.05
    begin = rng.integers(len(table) // 5, 3 * len(table) // 5)
    kept[begin : begin + max(len(table) // 40, 1)] = False
    kept[[0, -1]] = True
    empty = rng.random(len(table)) < 0.02
    lines = [",".join(columns)]
    for row, is_kept, is_empty in zip(table.tolist(), kept, empty, strict=True):
        if is_kept:
            lines.append(",".join([*(f"{value:.6g}" for value in row[:-1]), "" if is_empty else f"{row[-1]:.6g}"]))
    path.write_text("\n".join(lines) + "\n")


def make_robot(number: int, folder: Path) -> dict[str, float]:
    """Draws a robot, writes what was measured of it into a folder, and returns the truth."""
    rng = np.random.default_rng([2026, number])
    truth = {name: float(np.exp(rng.uniform(*np.log(ends)))) for name, ends in DRAWN.items()}
    young, damping = truth["young_modulus"], truth["damping_time"]
    fields = {
        "body.strands.young_modulus_Pa": young,
        "body.strands.shear_modulus_Pa": young * SHEAR_OVER_YOUNG,
        "body.strands.damping_time_s": damping,
        "body.joints.dry_friction_Nm": truth["dry_friction"],
    }
    worm = load_config(STUDY["preset"], STUDY["set"] | fields)
    tube, _, strand = load_identify_study(STUDY).experiments
    assert isinstance(tube, Tensile)
    assert isinstance(strand, RingDown)

    elongation_m = np.linspace(0.0, 1.1e-3, 240)
    strain = elongation_m / tube.length_m
    force_N = tube.model_copy(update={"softening_strain": truth["softening_strain"]}).tension(worm, strain)
    force_N += rng.normal(0.0, 0.6, len(strain)) + slow(rng, strain, 0.5, 0.004)
    log = {"time_s": 0.1 * np.arange(len(strain)), "elongation_mm": 1e3 * elongation_m, "force_N": force_N}
    write_log(folder / "tube.csv", log, rng)

    found = FrameTest(REACH_M, 0.01, 16.0).run(worm)
    loop = cable_force(Loop(found["displacement_m"], found["tension_N"]), truth["cable_friction"])
    way, cable_N = loop.displacement_m, loop.force_N.copy()
    for branch in (slice(None, loop.turn + 1), slice(loop.turn + 1, None)):
        cable_N[branch] += slow(rng, way[branch], 0.04, 0.03)
    cable_N += rng.normal(0.0, 0.05, len(way))
    log = {"time_s": 0.1 * np.arange(len(way)), "displacement_mm": 1e3 * way, "force_N": cable_N}
    write_log(folder / "frame.csv", log, rng)

    time_s = np.arange(0.0, 6.0, 0.01)
    frequency, rate = strand.mode(worm)
    tip_m = 0.05 * np.exp(-rate * time_s) * np.cos(np.sqrt(max(frequency**2 - rate**2, 0.0)) * time_s)
    tip_m += rng.normal(0.0, 5e-4, len(time_s)) + slow(rng, time_s, 2e-4, 0.2)
    write_log(folder / "strand.csv", {"time_s": time_s, "displacement_mm": 1e3 * tip_m}, rng)
    return truth


def rows_of(number: int) -> list[list[object]]:
    """Identifies one robot; a row for each parameter."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        truth = make_robot(number, folder)
        found = identify(load_identify_study(STUDY), folder)
    known = found.intervals
    return [
        [number, name, truth[name], value, *known.profile[i].tolist()]
        for i, (name, value) in enumerate(found.fit.values.items())
    ]


def summary(path: Path, drawn: Iterable[str] = DRAWN) -> list[list[object]]:
    """How often intervals hold the truth, bias over mean width, median half width and median error, by parameter."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    found: list[list[object]] = []
    for name in (*drawn, "all"):
        mine = [row for row in rows if name in (row["parameter"], "all")]
        ends = {head: np.array([float(row[head]) for row in mine]) for head in HEADS[2:6]}
        truth = ends["truth"]
        held = np.mean((ends["low"] <= truth) & (truth <= ends["high"]))
        width = np.log(ends["high"] / ends["low"])
        bias = np.mean(np.log(ends["value"] / truth)) / np.mean(width)
        error = np.median(np.abs(ends["value"] / truth - 1.0))
        numbers = (held, bias, np.exp(np.median(width) / 2) - 1, error)
        found.append([name, len(mine), *(f"{value:.4f}" for value in numbers)])
    return found


def main(path: Path, robots: int = ROBOTS) -> None:
    """Identifies the robots that a table of results lacks."""
    if not path.exists():
        path.write_text(",".join(HEADS) + "\n", encoding="utf-8")
    with path.open(encoding="utf-8") as file:
        done = {int(row["robot"]) for row in csv.DictReader(file)}
    for number in range(robots):
        if number in done:
            continue
        rows = [[f"{cell:.6g}" if isinstance(cell, float) else cell for cell in row] for row in rows_of(number)]
        with path.open("a", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(rows)
        print(f"robot {number} of {robots}", flush=True)
    columns = ("parameter", "n", "inside", "bias", "half_width", "error")
    print(write_csv(path.with_stem(f"{path.stem}_table"), columns, summary(path)).read_text(encoding="utf-8"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("csv", type=Path, help="file for the numbers, which goes on where it ended")
    parser.add_argument("--robots", type=int, default=ROBOTS, help="how many robots")
    given = parser.parse_args()
    main(given.csv, given.robots)

"""How far worms that should stand still creep: bodies at rest on a slope of half the friction angle, for a minute.

The engine's friction is a function of the speed of sliding, so what bears load creeps. Each row is a preset's body with
a controller that never contracts: its speed down the slope over the last 40 s, and that at half the step. Beside it
stands what creep does to a walk: travel with friction ten times as hard (`friction_impedance_ratio`) over travel as
it is. Rows are kept, so the command goes on where it was killed. Takes half an hour on one core:

    python benchmarks/creep.py docs/results/creep.csv
"""

from __future__ import annotations

import argparse
import csv
from math import atan, degrees, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from annelid import load_config, simulate
from annelid.arena.kinds.floor import Ground
from annelid.body.formulations.rods import Rods
from annelid.body.worm import WormBody
from annelid.output import write_csv
from annelid.simulation.runfile import Run

PRESETS = (
    *("riddle2023", "riddle2023-rods", "riddle2023-fast", "wang", "riddle2025", "riddle2025-3x1", "riddle2025-2x2"),
    *("riddle2025-muscles", "riddle2025-adaptive", "riddle2025-steered", "crawler", "crawler-servo", "crawler-timed"),
)
STILL_S, SETTLED_S = 60.0, 20.0
HARDER, RATIO = 10.0, "body.formulation.friction_impedance_ratio"


def path_m(run: Run, from_s: float) -> float:
    """How far the mean of all crossings has moved along the ground since a time, m; forwards is positive."""
    position = run.data["crossing_position"]
    x, time = position.isel(axis=0).mean("crossing").values, position[position.dims[0]].values
    return float(x[np.searchsorted(time, from_s)] - x[-1])


def row(preset: str, folder: Path) -> dict[str, Any]:
    """The numbers of one preset."""
    config = load_config(preset)
    assert isinstance(config.body, WormBody)
    assert isinstance(config.arena, Ground)
    slope_deg = degrees(atan(config.arena.friction)) / 2
    found: dict[str, Any] = {"preset": preset, "slope_deg": slope_deg}
    still = {"duration_s": STILL_S, "controller": {"kind": "program", "contractions": []}, "arena.slope_deg": slope_deg}
    for steps, name in ((1, "creep_mm_per_s"), (2, "creep_half_step_mm_per_s")):
        step = {"clock.physics_timestep_s": config.clock.physics_timestep_s / steps}
        run = simulate(load_config(preset, still | step), folder / name)
        found[name] = -1e3 * path_m(run, SETTLED_S) / (STILL_S - SETTLED_S)
    walk = path_m(simulate(config, folder / "walk"), config.duration_s / 3)
    harder = nan
    if isinstance(config.body.formulation, Rods):
        ratio = {RATIO: HARDER * config.body.formulation.friction_impedance_ratio}
        harder = path_m(simulate(load_config(preset, ratio), folder / "harder"), config.duration_s / 3) / walk
    return found | {"travel_m": walk, "travel_harder_over_it": harder}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("csv", type=Path, help="file to write, or to go on with")
    path: Path = parser.parse_args().csv
    rows: list[dict[str, Any]] = []
    if path.exists():
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    for preset in PRESETS:
        if preset not in {row["preset"] for row in rows}:
            with TemporaryDirectory() as folder:
                rows.append(row(preset, Path(folder)))
            print("  ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
            write_csv(path, rows[0], (each.values() for each in rows))


if __name__ == "__main__":
    main()

"""A worm squeezes into a narrowing pipe: the same network with and without the drive that pressed backs give.

    python examples/through_a_taper.py [folder]

The bore narrows from 0.18 m to 0.13 m over half a metre, the worm is 0.16 m wide at rest. As backs are pressed, a
descending neuron makes turns shorter: a squeezed segment's stroke is short, and needs less time. A few minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from annelid import load_config, simulate
from annelid.analysis.pipe_passage import passage_of

GAITS = {"fixed": {}, "adaptive": {"controller.descending.lift": 0.45}}


def main(folder: Path, duration_s: float = 40.0) -> None:
    """Runs both worms and lays their ways side by side."""
    table = Table("time (s)", *(f"{name}: front (m)" for name in GAITS), "bore at the front (m)", "drive")
    ways = []
    for name, changes in GAITS.items():
        config = load_config(
            "riddle2025-muscles",
            {
                "controller.kind": "sns-robust",
                "controller.motor_time_constant_s": 0.35,
                **changes,
                "arena.narrowest": 0.13,
                "duration_s": duration_s,
            },
            arena="pipe.taper",
        )
        run = simulate(config, folder / name, overwrite=True)
        ways.append(passage_of(run))
    drive = np.interp(ways[-1].time_s, run.data["time"].values, run.data["drive"].values)
    for k in np.linspace(0, len(ways[-1].time_s) - 1, 9).astype(int):
        fronts = (f"{way.front_m[k]:.2f}" for way in ways)
        table.add_row(f"{ways[-1].time_s[k]:.0f}", *fronts, f"{ways[-1].bore_m[k, 0]:.3f}", f"{drive[k]:.2f}")
    Console().print(table)


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))

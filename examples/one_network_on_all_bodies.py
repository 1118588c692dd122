"""One synthetic nervous system on four bodies: kinematic, in a pipe, with bending sides, and in 3D.

    python examples/one_network_on_all_bodies.py [folder]

The paper's network is the same everywhere, down to its conductances. Only what joins it to a body is each preset's own:
how long the sensor of segment 1 is held off at the start, how near to rest a segment's sensor switches, and how
activation follows from the half-centre. Takes about a minute; the run files are kept if you name a folder.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from annelid import load_config, simulate, summary

DURATION_S = 6.0
BODIES = {
    "riddle2022-planar": "body.n_segments",
    "daltorio2013": "body.n_segments",
    "boxerbaum2012": "body.n_segments",
    "riddle2023-rods": "body.mesh.n_segments",
}


def main(folder: Path) -> None:
    """Runs the network on every body with three segments, and prints what came of it."""
    table = Table("body", "period (s)", "order", "elongation (cm)", "travel (mm)", "slip (J)", box=None)
    for preset, segments in BODIES.items():
        config = load_config(preset, {segments: 3, "duration_s": DURATION_S})
        run = simulate(config, folder / preset)
        numbers = summary(run)
        stretch = run.data["stretch_length"].mean("sensor")
        elongation = 100 * (stretch.max("time") - stretch.min("time")).values
        slip = float(run.data["slip_loss"][-1].sum()) if "slip_loss" in run.data else None
        table.add_row(
            preset,
            "-" if numbers.period_s is None else f"{numbers.period_s:.3f}",
            "-".join(map(str, numbers.order)),
            " / ".join(f"{value:.1f}" for value in elongation),
            "-" if numbers.travel_m is None else f"{1000 * numbers.travel_m:.1f}",
            "-" if slip is None else f"{slip:.3f}",
        )
    Console().print(table)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with TemporaryDirectory() as temporary:
            main(Path(temporary))

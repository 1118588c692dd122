"""Eight worms on eight floors, all at once: how far does each crawl, and how fast is its rhythm?

    python examples/friction_sweep.py [folder]

The worms differ in the floor's friction only. Each has a run file of its own, which plots, videos and summaries take
like that of any other run. Takes about a minute on two cores.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table

from annelid import load_config, simulate_batch, summary

FRICTIONS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5)
SETTINGS = {"duration_s": 12.0, "record.frames_interval_s": 0.2}


def main(folder: Path) -> None:
    """Simulates the worms and tells how each did."""
    configs = [load_config("riddle2023-rods", SETTINGS | {"arena.friction": friction}) for friction in FRICTIONS]
    result = simulate_batch(configs, folder)
    table = Table("friction", "ended", "period (s)", "travel (mm)")
    for worm, friction in enumerate(FRICTIONS):
        if worm in result.failed:
            table.add_row(f"{friction:g}", result.messages[worm], "", "")
            continue
        run = result[worm]
        numbers = summary(run)
        period = "none" if numbers.period_s is None else f"{numbers.period_s:.2f}"
        table.add_row(f"{friction:g}", run.status, period, f"{1000 * (numbers.travel_m or 0.0):.0f}")
    Console().print(table)
    simulated_s = len(FRICTIONS) * SETTINGS["duration_s"]
    print(f"{simulated_s / result.wall_time_s:.1f} worm-seconds a second")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with TemporaryDirectory() as temporary:
            main(Path(temporary))

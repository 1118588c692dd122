"""Runs a slow toy simulation in a process of its own: ``python child.py OUT DURATION_S PAUSE_S``.

It prints "started" with the first step and, once it is over, the run's status.
"""

from __future__ import annotations

import sys

from toy import SavedToyPlant, ToyController, toy_config

from annelid.simulation import simulate


def main() -> None:
    out, duration_s, pause_s = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
    print("started", flush=True)
    run = simulate(
        toy_config(duration_s=duration_s, record__signals_interval_s=0.001),
        out,
        plant=SavedToyPlant(pause_s=pause_s),
        controller=ToyController(),
        progress=False,
    )
    print(run.status, flush=True)


main()

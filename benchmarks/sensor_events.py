"""When sensors switch and segments contract under the paper's controller: in order, and where order breaks.

Prints, for the paper's robot with pins that hold, every switch of a stretch sensor and every contraction with the
segments' lengthening, mm: as the preset is, at low friction, with a small tolerance and with a large one
(docs/robust.md). Run ``python benchmarks/sensor_events.py``; it takes about half a minute.
"""

from __future__ import annotations

import tempfile
from typing import Any

import numpy as np

from annelid import Run, load_config, simulate
from annelid.analysis import rhythm_score
from annelid.studies.case import PAPERS_MESH

CASES: dict[str, dict[str, Any]] = {
    "as it is": {},
    "friction 0.05": {"arena.friction": 0.05},
    "tolerance 5 mm": {"sensor.tolerance_m": 0.005},
    "tolerance 30 mm": {"sensor.tolerance_m": 0.03},
}
DURATION_S, SHOWN_S = 6.0, 3.7


def events(run: Run) -> list[tuple[float, str]]:
    """Times, s, and what happens, in order."""
    data = run.data
    time = data["time"].values
    lengthening_mm = 1e3 * (data["stretch_length"] - data["stretch_rest_length"]).mean("sensor").values
    found = []
    for name, states in (
        ("sensor {} on", data["sensor_on"].values > 0.5),
        ("sensor {} off", data["sensor_on"].values < 0.5),
        ("{} contracts", data["activation"].values >= 0.5),
        ("{} lets go", data["activation"].values < 0.5),
    ):
        for sample, segment in zip(*np.nonzero(states[1:] & ~states[:-1]), strict=True):
            longer = " ".join(f"{value:5.0f}" for value in lengthening_mm[sample + 1])
            found.append((float(time[sample + 1]), f"{name.format(segment + 1):14} {longer}"))
    return sorted(found)


def main() -> None:
    for name, changes in CASES.items():
        settings = {"clock.physics_timestep_s": 0.005, "duration_s": DURATION_S, "record.signals_interval_s": 0.005}
        config = load_config("riddle2023-rods", {**PAPERS_MESH, **settings, **changes})
        with tempfile.TemporaryDirectory() as folder:
            run = simulate(config, folder, progress=False, overwrite=True)
            found = rhythm_score(run)
            print(f"{name}: {found.reason}, period {found.period_s and round(found.period_s, 2)} s; lengthening, mm:")
            for time_s, what in events(run):
                if time_s <= SHOWN_S:
                    print(f"  {time_s:5.2f} s  {what}")


if __name__ == "__main__":
    main()

"""When sensors switch and segments contract under the paper's controller: in order, and where order breaks.

Prints, for the paper's robot with rigid crossings, every switch of a stretch sensor and every contraction with the
segments' lengthening, mm: as the preset is, with small and large tolerances, with stiff strands, and without the
damping across the bend (docs/evidence/robust.md). Takes about two minutes. With ``--windows`` it measures, under a
timed wave, what `WormBody.tolerance_window_m` estimates: how far neighbours lift a segment at rest, and
the length at which the releasing and the next segment are equally long. With ``--walks`` it runs the paper's network
with tolerances about the edges of the window.

    python benchmarks/sensor_events.py
    python benchmarks/sensor_events.py --windows --csv docs/results/tolerance_windows.csv
    python benchmarks/sensor_events.py --windows --step-ms 1
    python benchmarks/sensor_events.py --walks --csv docs/results/tolerance_walks.csv
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from annelid import Run, load_config, simulate
from annelid.analysis import rhythm_score
from annelid.analysis.rhythm import DESIGN_INTERVAL_S
from annelid.body import worm_of
from annelid.experiment.case import SHEAR_OVER_YOUNG
from annelid.output import write_csv
from annelid_studies.robustness import WAVE
from annelid_studies.standard_cases import PAPERS_RODS


def strands(modulus_GPa: float) -> dict[str, Any]:
    """Changes to strands of another Young's modulus, GPa."""
    moduli = {"young": 1e9 * modulus_GPa, "shear": SHEAR_OVER_YOUNG * 1e9 * modulus_GPa}
    return {f"body.strands.{name}_modulus_Pa": value for name, value in moduli.items()}


CASES: dict[str, dict[str, Any]] = {
    "as it is": {},
    "tolerance 1 mm": {"sensor.tolerance_m": 0.001},
    "tolerance 65 mm": {"sensor.tolerance_m": 0.065},
    "0.8 GPa, friction 0.1": {**strands(0.8), "arena.friction": 0.1},
    "0.8 GPa, friction 0.1, tolerance 26 mm": {**strands(0.8), "arena.friction": 0.1, "sensor.tolerance_m": 0.026},
}
WINDOWS = [
    *((modulus, friction, 0.145) for modulus in (0.3, 0.45, 0.8) for friction in (1.0, 0.3, 0.05)),
    *((1.2, friction, 0.145) for friction in (1.0, 0.3)),
    *((2.0, friction, 0.145) for friction in (1.0, 0.05)),
    *((modulus, 0.3, damping) for damping in (0.05, 0.36) for modulus in (0.3, 0.8, 2.0)),
    *((modulus, 1.0, 0.05) for modulus in (0.3, 0.8, 2.0)),
    *((modulus, friction, damping) for modulus in (0.3, 0.8) for friction in (1.0, 0.3) for damping in (0.08, 0.1)),
]
"""Young's modulus, GPa, friction, and damping time, s."""
WALKS = {
    (0.3, 1.0): (8, 10, 12, 15, 25, 35, 45, 55, 65),
    (0.8, 1.0): (12, 15, 18, 22, 40, 55, 65),
    (0.8, 0.3): (15, 18, 21, 25, 35, 45, 55, 65),
    (1.2, 1.0): (22, 26, 30, 34, 38, 49, 55, 65),
    (2.0, 1.0): (31, 36, 42, 48, 55, 65),
}
"""Tolerances, mm, that are tried with rods of a modulus, GPa, and friction."""
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


def window_mm(run: Run) -> tuple[float, float]:
    """Lift of segments whose turn it is not, and length in passing of those that hand over, from the second cycle."""
    data = run.data
    time = data["time"].values
    length = 1e3 * (data["stretch_length"] - data["stretch_rest_length"]).mean("sensor").values
    n = length.shape[1]
    lifts, passings = [], []
    for turn in range(n, int(time[-1] / DESIGN_INTERVAL_S)):
        start = turn * DESIGN_INTERVAL_S
        own = length[:, turn % n]
        waiting = (time >= start - 1.5 * DESIGN_INTERVAL_S) & (time < start - 1e-9)
        lifts.append(own[waiting].max())
        handing_over = (time >= start - 1e-9) & (time < start + 0.6 * DESIGN_INTERVAL_S)
        passings.append(np.minimum(own, length[:, (turn - 1) % n])[handing_over].max())
    return max(lifts), min(passings)


def print_windows(path: Path | None, step_s: float) -> None:
    rows = []
    for modulus, friction, damping in WINDOWS:
        settings = {
            "body.mesh.elements_per_side": 2,
            "clock.physics_timestep_s": step_s,
            "record.signals_interval_s": 0.01,
            "controller": WAVE,
            "duration_s": 6.6,
            "arena.friction": friction,
            "body.strands.damping_time_s": damping,
        }
        config = load_config("riddle2023-rods", {**strands(modulus), **settings})
        with tempfile.TemporaryDirectory() as folder:
            measured = window_mm(simulate(config, folder, progress=False, overwrite=True))
        estimated = worm_of(config).tolerance_window_m(friction)
        assert estimated is not None
        print(
            f"{modulus:4} GPa, friction {friction:4}, {damping:5} s: {measured[0]:5.1f} to {measured[1]:5.1f} mm, "
            f"estimated {1e3 * estimated[0]:5.1f} to {1e3 * estimated[1]:5.1f} mm",
            flush=True,
        )
        rows.append([modulus, friction, damping, *measured, *(1e3 * edge for edge in estimated)])
    if path:
        heads = ["modulus_GPa", "friction", "damping_time_s", "lift_mm", "passing_mm", "lower_mm", "upper_mm"]
        write_csv(path, heads, rows)


def print_walks(path: Path | None) -> None:
    rows = []
    for (modulus, friction), tolerances_mm in WALKS.items():
        fields = {**strands(modulus), "arena.friction": friction, "duration_s": 8.0}
        walks, lost = [], []
        for tolerance_mm in tolerances_mm:
            config = load_config("riddle2023-rods", {**fields, "sensor.tolerance_m": tolerance_mm / 1e3})
            with tempfile.TemporaryDirectory() as folder:
                found = rhythm_score(simulate(config, folder, progress=False, overwrite=True))
            in_time = found.period_s is not None and abs(found.period_s / (3 * DESIGN_INTERVAL_S) - 1.0) < 0.1
            (walks if found.verdict == "ordered" and in_time else lost).append(tolerance_mm)
        window = worm_of(load_config("riddle2023-rods", fields)).tolerance_window_m(friction)
        assert window is not None
        print(
            f"{modulus} GPa, friction {friction}: walks with {walks}, not with {lost} mm, window {window}", flush=True
        )
        rows.append(
            [modulus, friction, *(", ".join(map(str, one)) for one in (lost, walks)), *(1e3 * e for e in window)]
        )
    if path:
        write_csv(path, ["modulus_GPa", "friction", "lost_mm", "walks_mm", "lower_mm", "upper_mm"], rows)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--windows", action="store_true", help="measure windows of the tolerance")
    parser.add_argument("--walks", action="store_true", help="run the paper's network about the windows' edges")
    parser.add_argument("--csv", type=Path, help="file for these")
    parser.add_argument("--step-ms", type=float, default=10.0, help="of these runs, ms")
    given = parser.parse_args()
    if given.walks:
        print_walks(given.csv)
        return
    if given.windows:
        print_windows(given.csv, given.step_ms / 1e3)
        return
    for name, changes in CASES.items():
        settings = {"clock.physics_timestep_s": 0.005, "duration_s": DURATION_S, "record.signals_interval_s": 0.005}
        config = load_config("riddle2023-rods", {**PAPERS_RODS, **settings, **changes})
        with tempfile.TemporaryDirectory() as folder:
            run = simulate(config, folder, progress=False, overwrite=True)
            found = rhythm_score(run)
            print(f"{name}: {found.reason}, period {found.period_s and round(found.period_s, 2)} s; lengthening, mm:")
            for time_s, what in events(run):
                if time_s <= SHOWN_S:
                    print(f"  {time_s:5.2f} s  {what}")


if __name__ == "__main__":
    main()

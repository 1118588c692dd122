"""What a step could gain without another engine: where its solver starts from, and how long steps may be.

    python benchmarks/step_floor.py [seconds]
    python benchmarks/step_floor.py creep

Steps the closed loop of `riddle2023-rods` without recording, at 20, 40 and 60 ms. The solver starts from the last
acceleration, as the engine has it, from none, from the last two extrapolated, and from the one that would stop the
worm. Prints times real time, milliseconds a step and iterations of the solver. Run it where nothing else computes.

The second prints how fast the resting worm creeps on a slope of 12 degrees, by step and impedance ratio of friction.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from annelid import load_config, simulate
from annelid.morphology import Array
from annelid.simulation import Simulation, WormPlant, build_controller, start

Start = Callable[[Array, Array, Array], Array]
STARTS: dict[str, Start | None] = {
    "the engine's": None,
    "none": lambda last, before, stop: 0.0 * last,
    "extrapolated": lambda last, before, stop: 2.0 * last - before,
    "stop": lambda last, before, stop: stop,
}
"""Guesses of the acceleration, from the last, the one before, and the one that would stop the worm."""


def stepped(step_s: float, begin: Start | None, seconds: float) -> tuple[float, float, float]:
    """Returns times real time, milliseconds a step, and iterations of the solver a step."""
    changes = {"clock.physics_timestep_s": step_s, "record.signals_interval_s": step_s, "duration_s": seconds}
    config = load_config("riddle2023-rods", changes)
    plant = WormPlant(config)
    simulation: Simulation = start(config, plant, build_controller(config, plant), None)
    data, iterations = plant.data, []
    before: Array | None = None
    began = perf_counter()
    while simulation.sensation.time_s < seconds - 1e-9:
        time = data.time
        if begin is not None:
            last = data.qacc_warmstart.copy()
            data.qacc_warmstart[:] = begin(last, last if before is None else before, -data.qvel / step_s)
            before = last
        simulation.advance()
        if data.time != time:
            iterations.append(int(data.solver_niter[0]))
    spent = perf_counter() - began
    return seconds / spent, 1e3 * spent / len(iterations), float(np.mean(iterations))


def creep() -> None:
    """Prints the speed of the resting worm on a slope, mm/s."""
    rest = {"kind": "program", "contractions": [{"segment": 1, "start_s": 5.9, "stop_s": 5.95}]}
    for step_s in (0.04, 0.02, 0.005):
        for ratio in (1.0, 10.0, 100.0):
            numerics = {"clock.physics_timestep_s": step_s, "body.formulation.friction_impedance_ratio": ratio}
            changes = {
                "duration_s": 6.0,
                "record.signals_interval_s": max(step_s, 0.02),
                "controller": rest,
                **numerics,
            }
            config = load_config("riddle2023-rods", {"arena.slope_deg": 12.0, **changes})
            with TemporaryDirectory() as folder:
                resting = simulate(config, folder, progress=False, overwrite=True).data.sel(time=slice(2.0, 5.8))
                way = np.ptp(resting["center_of_mass"].values[:, 0]) / np.ptp(resting["time"].values)
            print(f"{1e3 * step_s:g} ms, ratio {ratio:g}: {1e3 * way:.3f} mm/s")


if __name__ == "__main__":
    if sys.argv[1:] == ["creep"]:
        creep()
        sys.exit()
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 16.0
    for milliseconds in (20, 40, 60):
        for name, begin in STARTS.items():
            speed, cost, iterations = stepped(milliseconds / 1e3, begin, duration)
            print(f"{milliseconds} ms, {name:14} {speed:5.2f} x real time, {cost:.2f} ms, {iterations:.2f} iterations")

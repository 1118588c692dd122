"""What a step could gain without another engine: where its solver starts from, and how long steps may be.

    python benchmarks/step_floor.py [seconds]
    python benchmarks/step_floor.py creep
    python benchmarks/step_floor.py jump

Steps the closed loop of `riddle2023-rods` without recording, at 20, 40 and 60 ms. The solver starts from the last
acceleration, as the engine has it, from none, from the last two extrapolated, and from the one that would stop the
worm. Prints times real time, milliseconds a step and iterations of the solver. Run it where nothing else computes.

The second prints how fast the resting worm creeps on a slope of 12 degrees, by step and impedance ratio of friction.
The third repeats the muscles' commands of a run at steps of 5 ms, as they were and smoothed over up to 40 ms.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from annelid import load_config, simulate
from annelid.morphology import Array
from annelid.protocols import Sensation
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


def jump() -> None:
    """Prints the travel of two cycles under the same commands, with muscles that act at once and others that do not."""
    config = load_config("riddle2023-rods", {"clock.physics_timestep_s": 0.005, "duration_s": 8.0})
    config = config.model_copy(update={"record": config.record.model_copy(update={"signals_interval_s": 0.005})})
    with TemporaryDirectory() as folder:
        data = simulate(config, folder, progress=False, overwrite=True).data
        times_s, commands = data["activation"]["time"].values, data["activation"].values
    for over_s in (0.0, 0.01, 0.02, 0.04):
        width = max(round(over_s / 0.005), 1)
        rows = [np.convolve(np.pad(one, width, "edge"), np.ones(width) / width, "same") for one in commands.T]
        smooth = np.array(rows)[:, width:-width]

        def command(sensed: Sensation, smooth: Array = smooth) -> Array:
            return np.array([np.interp(sensed.time_s, times_s, row) for row in smooth])

        with TemporaryDirectory() as folder:
            run = simulate(config, folder, controller=command, progress=False, overwrite=True)
            way = run.data["center_of_mass"].values[:, 0]
        ahead = -np.diff(np.interp([2.627, 5.254, 7.881], times_s, way))
        print(f"smoothed over {1e3 * over_s:g} ms: {1e3 * ahead[0]:.0f} and {1e3 * ahead[1]:.0f} mm a cycle")


if __name__ == "__main__":
    if sys.argv[1:] == ["jump"]:
        jump()
        sys.exit()
    if sys.argv[1:] == ["creep"]:
        creep()
        sys.exit()
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 16.0
    for milliseconds in (20, 40, 60):
        for name, begin in STARTS.items():
            speed, cost, iterations = stepped(milliseconds / 1e3, begin, duration)
            print(f"{milliseconds} ms, {name:14} {speed:5.2f} x real time, {cost:.2f} ms, {iterations:.2f} iterations")

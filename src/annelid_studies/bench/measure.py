"""One case, measured in a process of its own: only there its peak memory is its own."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from annelid.config import RunConfig, load_config
from annelid.errors import SimulationStopped

if TYPE_CHECKING:
    from annelid.simulation import Run

ENGINE_S, ENGINE_WALL_S = 2.7, 5.0
"""The engine's timers run for a cycle of the paper's worm, but no longer than the second on the clock, s."""
_MB = 1e6


def measure_alone(config: Mapping[str, Any], perturbed: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Measures a case, given as configurations, on one core; called in a fresh process."""
    keep_to_one_core()
    return measure(load_config(config), [load_config(one) for one in perturbed])


def keep_to_one_core() -> None:
    """Pins the process to the last core that it may use, where the system can do so."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def measure(config: RunConfig, perturbed: Sequence[RunConfig] = ()) -> dict[str, Any]:
    """Runs the closed loop of a 3D worm with its recording and returns its times, shares, memory and results.

    Perturbed runs are computed after it, of which the results count and not the times.

    Returns:
        Numbers with their units in the keys, ready for JSON. A run that a guard stopped is measured as far as it came.

    Raises:
        ConfigError: The body cannot be built.
    """
    import numpy as np

    from annelid.analysis import rhythm_score, summary
    from annelid.body import build_spec, compile_spec
    from annelid.simulation import WormPlant, build_controller, open_run, simulate, start
    from annelid_studies.bench.timing import Stopwatch, engine_times, laps_s, shares

    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    plant = WormPlant(config)
    controller = build_controller(config, plant)
    stepping = Stopwatch(plant, "step", "stride", reading=lambda: plant.data.time)
    watching, controlling = Stopwatch(plant, "alarm"), Stopwatch(controller, "step", "stride")

    def finished(number: int, config: RunConfig, folder: str, **parts: Any) -> Run:
        path = Path(folder) / str(number)
        try:
            run = simulate(config, path, progress=False, **parts)
        except SimulationStopped:
            run = open_run(path)
        if run.status == "interrupted":
            raise KeyboardInterrupt
        return run

    with tempfile.TemporaryDirectory() as folder:
        run = finished(0, config, folder, plant=plant, controller=controller)
        peak = peak_memory_bytes()
        numbers, rhythm = summary(run), rhythm_score(run)
        others = [summary(finished(number, one, folder)) for number, one in enumerate(perturbed, 1)]
    total_s = run.wall_time_s
    plant_s, control_s = stepping.seconds + watching.seconds, controlling.seconds
    simulated_s = numbers.duration_s or 0.0
    # From one movement to the next the whole loop goes round, recording included.
    laps_ms = 1e3 * laps_s(stepping.ends, stepping.readings, config.clock.physics_timestep_s)
    again = start(config, plant, controller, None)
    engine = engine_times(again, plant, stepping, min(ENGINE_S, config.duration_s), ENGINE_WALL_S)
    began = perf_counter()
    spec = build_spec(config)
    built = perf_counter()
    compile_spec(spec)
    compiled = perf_counter()
    return {
        "status": run.status,
        "message": run.message,
        "wall_s": total_s,
        "cpu_s": run.cpu_time_s,
        "real_time_factor": numbers.real_time_factor,
        "simulated_s": simulated_s,
        "step_median_ms": float(np.median(laps_ms)) if laps_ms.size else None,
        "step_mean_ms": float(np.mean(laps_ms)) if laps_ms.size else None,
        "shares": shares(total_s, plant_s, control_s, engine),
        "peak_memory_MB": None if peak is None else peak / _MB,
        "build_s": built - began,
        "compile_s": compiled - built,
        "velocities": int(plant.model.nv),
        "constraint_rows_mean": float(np.mean(engine.constraints or 0)),
        "solver_iterations_mean": float(np.mean(engine.iterations or 0)),
        "solver_iterations_max": max(engine.iterations, default=0),
        "rhythm": {"verdict": rhythm.verdict, "reason": rhythm.reason},
        "summary": numbers.to_dict(),
        "perturbed": [other.to_dict() for other in others],
        "load_average_1min": load,
    }


def peak_memory_bytes() -> int | None:
    """Largest resident memory of this process so far, bytes; None where the system does not tell.

    Linux counts it a memory map (``VmHWM``); its ``ru_maxrss`` would also hold the peak of the process that started
    this one. Elsewhere ``ru_maxrss`` is all there is: in bytes on macOS, in KiB on other systems.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        for line in status.read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("VmHWM:"):
                return 1024 * int(line.split()[1])
    try:
        import resource
    except ImportError:
        return None
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)

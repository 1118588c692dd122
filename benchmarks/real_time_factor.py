"""Closed-loop speed of the presets side by side in one run: ms a physics step, its shares, times real time.

Run it on an otherwise idle machine, pinned to one core: ``taskset -c 1 python benchmarks/real_time_factor.py``.
Absolute times differ between machines and hours; the ratios to the paper's formulation hold.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

from annelid import load_config, simulate
from annelid.simulation import build_controller, build_plant

CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("riddle2023", {"duration_s": 0.5}),
    ("riddle2023-fast", {"duration_s": 4.0}),
    ("riddle2023-rods", {"duration_s": 4.0, "clock.physics_timestep_s": 0.002, "record.frames_interval_s": 0.04}),
    ("riddle2023-rods", {"duration_s": 4.0}),
    ("riddle2023-rods", {"duration_s": 4.0, "clock.physics_timestep_s": 0.010, "record.signals_interval_s": 0.01}),
    ("riddle2023-rods", {"duration_s": 4.0, "body.mesh.n_segments": 6}),
    ("riddle2022-planar", {"duration_s": 4.0}),
)


class Stopwatch:
    """Hands calls on to a part of the simulation and adds up the time they take."""

    def __init__(self, part: Any) -> None:
        self._part = part
        self.seconds = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._part, name)

    def step(self, argument: Any) -> Any:
        began = perf_counter()
        result = self._part.step(argument)
        self.seconds += perf_counter() - began
        return result


def main() -> None:
    heading = ("preset", "segments", "physics step", "ms a step", "body", "network", "loop + file", "x real time")
    print("{:18} {:>8} {:>13} {:>10} {:>6} {:>8} {:>12} {:>12} {:>10}".format(*heading, "x paper"))
    paper = None
    for preset, changes in CASES:
        config = load_config(preset, changes)
        plant = Stopwatch(build_plant(config))
        controller = Stopwatch(build_controller(config, plant))  # type: ignore[arg-type]
        with tempfile.TemporaryDirectory() as folder:
            run = simulate(config, Path(folder) / "run", plant=plant, controller=controller, progress=False)  # type: ignore[arg-type]
            total, factor = run.wall_time_s, run.real_time_factor
        assert factor is not None
        paper = paper or factor
        step_s = config.clock.physics_timestep_s
        shares = [part / total for part in (plant.seconds, controller.seconds)]
        ms = 1e3 * total * step_s / config.duration_s
        print(
            f"{preset:18} {plant.n_segments:8d} {1e3 * step_s:10.0f} ms {ms:10.2f}"
            f" {shares[0]:6.0%} {shares[1]:8.0%} {1 - sum(shares):12.0%} {factor:12.3f} {factor / paper:10.1f}"
        )


if __name__ == "__main__":
    main()

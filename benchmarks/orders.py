"""What a run's numbers owe to its step, cause by cause: the same number at four steps, and the order of convergence.

    python benchmarks/orders.py

writes ``docs/results/orders.csv``. The order is that of the steps of 20, 10 and 5 ms: ``log2 ((a - b) / (b - c))``.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from annelid.analysis import Gait, gait
from annelid.config import load_config
from annelid.control import CircuitController
from annelid.control.sns import Sns
from annelid.experiment import Processes
from annelid.output import write_csv
from annelid.protocols import Array, Controller, Sensation
from annelid.simulation import simulate

STEPS_MS = (20, 10, 5, 2)
TARGET = Path(__file__).parent.parent / "docs" / "results" / "orders.csv"
AT_ONCE = {"body.rings.activation_dynamics": False}
FLIGHT = {"arena.gravity_m_per_s2": 0.0, "arena.floor_gap_m": 1.0, "guard.height_m": 5.0, "duration_s": 4.0}
SLOW = {
    "controller.rise_s": 0.492,
    "controller.hold_s": 1.185,
    "controller.fall_s": 0.339,
    "controller.interval_s": 0.516,
    "duration_s": 12.0,
}
LOOP = {"arena.friction": 0.3, "duration_s": 10.0}


class HeldSensors(CircuitController):
    """The paper's network; between two movements of the body it takes the last lengths, not those carried on."""

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `annelid.protocols.StridingController.stride`."""
        return super().stride(replace(sensation, stretch_rate_m_per_s=np.zeros((0, 0))), n_steps)


class Worm(NamedTuple):
    """One worm, with something switched, and the numbers that are read from it."""

    name: str
    preset: str
    changes: dict[str, Any]
    numbers: tuple[str, ...]
    held: bool = False


READ: dict[str, Callable[[Gait], float | None]] = {
    "muscles' work (J)": lambda found: None if found.energy is None else found.energy.muscle_work_J,
    "travel a cycle (mm)": lambda found: None if found.stride_m is None else 1e3 * found.stride_m,
    "period (s)": lambda found: found.period_s,
}
WORK, TRAVEL, PERIOD = READ
WORMS = (
    Worm("no feedback, free flight", "crawler-timed", FLIGHT, (WORK,)),
    Worm("the same, muscles at once", "crawler-timed", {**FLIGHT, **AT_ONCE}, (WORK,)),
    Worm("no feedback, on the ground", "crawler-timed", {}, (TRAVEL,)),
    Worm("the same, muscles at once", "crawler-timed", AT_ONCE, (TRAVEL,)),
    Worm("the same, friction 0.3", "crawler-timed", {"arena.friction": 0.3}, (TRAVEL,)),
    Worm("the same, a wave three times as slow", "crawler-timed", SLOW, (TRAVEL,)),
    Worm("with feedback", "riddle2025-muscles", LOOP, (PERIOD, TRAVEL)),
    Worm("the same, sensors held between movements", "riddle2025-muscles", LOOP, (PERIOD, TRAVEL), held=True),
    Worm("the same, muscles at once", "riddle2025-muscles", {**LOOP, **AT_ONCE}, (PERIOD, TRAVEL)),
)


def measured(number: int, step_ms: int) -> list[float]:
    """Returns the numbers of a worm at a step."""
    one, step_s = WORMS[number], step_ms / 1000
    timing = {"clock.physics_timestep_s": step_s, "record.signals_interval_s": step_s}
    config = load_config(one.preset, {**timing, **one.changes})
    controller: Controller | None = None
    if one.held:
        n = config.body.n_segments
        assert isinstance(config.controller, Sns)
        controller = HeldSensors(config.controller.circuit(config, n), n, config.clock.control_timestep_s)
    with tempfile.TemporaryDirectory() as folder:
        found = gait(simulate(config, folder, controller=controller, progress=False))
    values = [READ[name](found) for name in one.numbers]
    return [math.nan if value is None else value for value in values]


def main() -> None:
    """Measures all worms."""
    rows = []
    with Processes() as pool:
        runs = [[pool.submit(measured, number, step_ms) for step_ms in STEPS_MS] for number in range(len(WORMS))]
        for worm, its in zip(WORMS, runs, strict=True):
            for name, values in zip(worm.numbers, zip(*(run.result() for run in its), strict=True), strict=True):
                a, b, c = values[:3]
                order = f"{math.log2((a - b) / (b - c)):.2f}" if (a - b) * (b - c) > 0 else ""
                rows.append([f"{worm.name}: {name}", *(f"{value:.7g}" for value in values), order])
                print(*rows[-1], sep="  ", flush=True)
    print(write_csv(TARGET, ["line", *(f"at_{step_ms}_ms" for step_ms in STEPS_MS), "order"], rows))


if __name__ == "__main__":
    main()

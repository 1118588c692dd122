"""What a run's numbers owe to its step, cause by cause: the same number at four steps, and the order of convergence.

    python benchmarks/orders.py

writes ``docs/results/orders.csv``. The order is that of the steps of 20, 10 and 5 ms: ``log2 |(a - b) / (b - c)|``.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from annelid.analysis import gait
from annelid.config import load_config
from annelid.control import SnsController
from annelid.control.sns import Sns
from annelid.output import write_csv
from annelid.protocols import Array, Controller, Sensation
from annelid.simulation import Run, simulate

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


class HeldSensors(SnsController):
    """The paper's network; between two movements of the body it takes the last lengths, not those carried on."""

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `annelid.protocols.StridingController.stride`."""
        return super().stride(replace(sensation, stretch_rate_m_per_s=np.zeros((0, 0))), n_steps)


class Line(NamedTuple):
    """One number of one worm, with something switched."""

    name: str
    preset: str
    changes: dict[str, Any]
    number: Callable[[Run], float | None]
    scale: float = 1.0
    held: bool = False


def work_J(run: Run) -> float | None:
    """Work of the muscles, J."""
    energy = gait(run).energy
    return None if energy is None else energy.muscle_work_J


def travel_m(run: Run) -> float | None:
    """Travel in a cycle, m."""
    return gait(run).stride_m


def period_s(run: Run) -> float | None:
    """Period, s."""
    return gait(run).period_s


LINES = (
    Line("no feedback, free flight: muscles' work (J)", "crawler-timed", FLIGHT, work_J),
    Line("the same, muscles at once", "crawler-timed", {**FLIGHT, **AT_ONCE}, work_J),
    Line("no feedback, on the ground: travel a cycle (mm)", "crawler-timed", {}, travel_m, 1e3),
    Line("the same, muscles at once", "crawler-timed", AT_ONCE, travel_m, 1e3),
    Line("the same, friction 0.3", "crawler-timed", {"arena.friction": 0.3}, travel_m, 1e3),
    Line("the same, a wave three times as slow", "crawler-timed", SLOW, travel_m, 1e3),
    Line("with feedback: period (s)", "riddle2025-muscles", LOOP, period_s),
    Line("the same, sensors held between movements", "riddle2025-muscles", LOOP, period_s, held=True),
    Line("the same, muscles at once", "riddle2025-muscles", {**LOOP, **AT_ONCE}, period_s),
    Line("with feedback: travel a cycle (mm)", "riddle2025-muscles", LOOP, travel_m, 1e3),
    Line("the same, sensors held between movements", "riddle2025-muscles", LOOP, travel_m, 1e3, held=True),
)


def measured(line: int, step_ms: int) -> float:
    """Returns the number of a line at a step."""
    one, step_s = LINES[line], step_ms / 1000
    timing = {"clock.physics_timestep_s": step_s, "record.signals_interval_s": step_s}
    config = load_config(one.preset, {**timing, **one.changes})
    controller: Controller | None = None
    if one.held:
        n = config.body.n_segments
        assert isinstance(config.controller, Sns)
        controller = HeldSensors(config.controller, config.sensor, n, n, config.clock.control_timestep_s)
    with tempfile.TemporaryDirectory() as folder:
        value = one.number(simulate(config, folder, controller=controller, progress=False))
    return math.nan if value is None else one.scale * value


def main() -> None:
    """Measures all lines."""
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        found = [[pool.submit(measured, line, step_ms) for step_ms in STEPS_MS] for line in range(len(LINES))]
        rows = []
        for line, values in zip(LINES, found, strict=True):
            a, b, c, d = (value.result() for value in values)
            order = math.log2(abs((a - b) / (b - c))) if (a - b) * (b - c) > 0 else None
            rows.append(
                [line.name, *(f"{value:.7g}" for value in (a, b, c, d)), "" if order is None else f"{order:.2f}"]
            )
            print(*rows[-1], sep="  ", flush=True)
    print(write_csv(TARGET, ["line", *(f"at_{step_ms}_ms" for step_ms in STEPS_MS), "order"], rows))


if __name__ == "__main__":
    main()

"""Where the time of a step goes: stopwatches round the parts of a closed loop, and the engine's own timers."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from functools import partial
from time import perf_counter
from typing import Any, NamedTuple

import mujoco
import numpy as np

from annelid.errors import SimulationStopped
from annelid.simulation import Simulation, WormPlant

ENGINE_PHASES = ("position", "velocity", "actuation", "constraint", "advance")
"""The engine's timers that together make up a step, but for a rest."""
PHASES = (*ENGINE_PHASES, "engine, rest", "plant", "network and control", "recording and loop")
"""All parts of a step of the closed loop, from the engine outwards."""


class Stopwatch:
    """Times the calls of some methods of one object; one that another of them calls is not counted twice."""

    def __init__(
        self,
        owner: Any,
        *methods: str,
        reading: Callable[[], float] | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        """Puts itself in the places of those methods that the owner has."""
        self.seconds = 0.0
        # When each call ended, s on the clock, and what was read after it.
        self.ends, self.readings = array("d"), array("d")
        within = False

        def timed(method: Callable[..., Any], *arguments: Any) -> Any:
            nonlocal within
            if within:
                return method(*arguments)
            within = True
            began = clock()
            try:
                return method(*arguments)
            finally:
                ended = clock()
                within = False
                self.seconds += ended - began
                if reading is not None:
                    self.ends.append(ended)
                    self.readings.append(reading())

        for method in methods:
            if hasattr(owner, method):
                setattr(owner, method, partial(timed, getattr(owner, method)))


def laps_s(ends: Sequence[float], times: Sequence[float], step_s: float) -> np.ndarray:
    """Wall-clock time of a physics step, from each movement of the body to the next, s.

    From the ends of the plant's calls, s on the clock, and the simulated times after them, s, which stay the same where
    the body did not move.
    """
    moved = np.flatnonzero(np.diff(times, prepend=0.0) > 0.5 * step_s)
    n_steps = np.round(np.diff(np.asarray(times)[moved]) / step_s)
    return np.diff(np.asarray(ends)[moved]) / n_steps


class EngineTimes(NamedTuple):
    """What the engine spent on a stretch of steps."""

    phase_s: tuple[float, ...]  # Time in each of `ENGINE_PHASES`, s
    step_s: float  # Time in whole steps, s
    plant_s: float  # Time in the plant's own steps, which call the engine, s
    iterations: tuple[int, ...]  # Iterations of the constraint solver, at each movement of the body
    constraints: tuple[int, ...]  # Rows of the constraint problem, likewise


def engine_times(
    simulation: Simulation, plant: WormPlant, stepping: Stopwatch, simulated_s: float, longest_s: float
) -> EngineTimes:
    """Runs a closed loop from its start with the engine's timers on, which by default stand still.

    For a simulated time, but at most for a time on the clock, s; ``stepping`` is round the worm's steps.
    """
    data = plant.data
    iterations, constraints = [], []
    mujoco.set_mjcb_time(perf_counter)
    try:
        before, plant_before_s = np.array(data.timer.duration), stepping.seconds
        began, time = perf_counter(), data.time
        while simulation.sensation.time_s < simulated_s and perf_counter() - began < longest_s:
            try:
                simulation.advance()
            except SimulationStopped:
                break
            if data.time != time:
                time = data.time
                iterations.append(int(data.solver_niter[: max(1, int(data.nisland))].max()))
                constraints.append(int(data.nefc))
        spent = np.array(data.timer.duration) - before
    finally:
        mujoco.set_mjcb_time(None)
    *phases, step = (
        float(spent[int(getattr(mujoco.mjtTimer, f"mjTIMER_{name.upper()}"))]) for name in (*ENGINE_PHASES, "step")
    )
    if not plant.mechanics.ahead_s:
        # Of rods, position and velocity are computed by calls of their own.
        step += phases[0] + phases[1]
    plant_s = stepping.seconds - plant_before_s
    return EngineTimes(tuple(phases), step, plant_s, tuple(iterations), tuple(constraints))


def shares(total_s: float, plant_s: float, control_s: float, engine: EngineTimes) -> dict[str, float]:
    """Splits the wall-clock time of a run, s, into shares of `PHASES`, which add up to 1.

    The engine's times say how that in the plant is divided.
    """
    of_plant, control = plant_s / total_s, control_s / total_s
    phases = [of_plant * seconds / engine.plant_s for seconds in engine.phase_s]
    rest = of_plant * (engine.step_s - sum(engine.phase_s)) / engine.plant_s
    around = of_plant * (1.0 - engine.step_s / engine.plant_s)
    return dict(zip(PHASES, [*phases, rest, around, control, 1.0 - of_plant - control], strict=True))

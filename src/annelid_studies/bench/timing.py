"""Where the time of a step goes: stopwatches round the parts of a closed loop, and the engine's own timers."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.errors import SimulationStopped

if TYPE_CHECKING:
    import mujoco

    from annelid.simulation import Simulation, WormPlant

ENGINE_PHASES = ("position", "velocity", "actuation", "constraint", "advance")
"""The engine's timers that together make up a step, but for a rest."""
PHASES = (*ENGINE_PHASES, "engine, rest", "plant", "network and control", "recording and loop")
"""All parts of a step of the closed loop, from the engine outwards."""


class Stopwatch:
    """Times the calls of some methods of one object; one that another of them calls is not counted twice.

    Attributes:
        seconds: Time spent in the calls, s.
        ends: When each call ended, s on the clock.
        readings: What was read after each call.
    """

    def __init__(
        self,
        owner: Any,
        *methods: str,
        reading: Callable[[], float] | None = None,
        clock: Callable[[], float] = perf_counter,
    ) -> None:
        """Puts itself in the methods' places.

        Args:
            owner: The object.
            *methods: Names of its methods; one that it lacks is left out.
            reading: What to read after each call; None for nothing.
            clock: Tells the time, s.
        """
        self.seconds = 0.0
        self.ends, self.readings = array("d"), array("d")
        self._clock, self._reading = clock, reading
        self._within = False
        for method in methods:
            if hasattr(owner, method):
                setattr(owner, method, self._timed(getattr(owner, method)))

    def _timed(self, method: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any) -> Any:
            if self._within:
                return method(*arguments)
            self._within = True
            began = self._clock()
            try:
                return method(*arguments)
            finally:
                ended = self._clock()
                self._within = False
                self.seconds += ended - began
                if self._reading is not None:
                    self.ends.append(ended)
                    self.readings.append(self._reading())

        return timed


def laps_s(ends: Sequence[float], times: Sequence[float], step_s: float) -> np.ndarray:
    """Wall-clock time of a physics step, from each movement of the body to the next, s.

    Args:
        ends: When each call of the plant ended, s.
        times: Simulated time of the engine after it, s; the same as before where the body did not move.
        step_s: Physics step, s.
    """
    moved = np.flatnonzero(np.diff(times, prepend=0.0) > 0.5 * step_s)
    n_steps = np.round(np.diff(np.asarray(times)[moved]) / step_s)
    return np.diff(np.asarray(ends)[moved]) / n_steps


@dataclass(frozen=True, slots=True)
class EngineTimes:
    """What the engine spent on a stretch of steps.

    Attributes:
        phase_s: Time in each of `ENGINE_PHASES`, s.
        step_s: Time in whole steps, s.
        plant_s: Time in the plant's own steps, which call the engine, s.
        iterations: Iterations of the constraint solver, at each movement of the body.
        constraints: Rows of the constraint problem, likewise.
    """

    phase_s: tuple[float, ...]
    step_s: float
    plant_s: float
    iterations: tuple[int, ...]
    constraints: tuple[int, ...]


def engine_times(
    simulation: Simulation, plant: WormPlant, stepping: Stopwatch, simulated_s: float, longest_s: float
) -> EngineTimes:
    """Runs a closed loop with the engine's timers on, which by default stand still.

    Args:
        simulation: The loop, at its start.
        plant: Its worm.
        stepping: Stopwatch round the worm's steps.
        simulated_s: How long to run, s of simulated time.
        longest_s: How long to run at most, s of wall-clock time.
    """
    import mujoco

    data = plant.data
    iterations, constraints = [], []
    mujoco.set_mjcb_time(perf_counter)
    try:
        before, plant_before_s = _timers(data), stepping.seconds
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
        spent = _timers(data) - before
    finally:
        mujoco.set_mjcb_time(None)
    return EngineTimes(
        tuple(float(spent[_timer(phase)]) for phase in ENGINE_PHASES),
        float(spent[_timer("step")]),
        stepping.seconds - plant_before_s,
        tuple(iterations),
        tuple(constraints),
    )


def shares(total_s: float, plant_s: float, control_s: float, engine: EngineTimes) -> dict[str, float]:
    """Splits the time of a run into `PHASES`.

    Args:
        total_s: Wall-clock time of the run, s.
        plant_s: Time of it in the plant, s.
        control_s: Time of it in the controller, s.
        engine: How the engine divides the time in the plant.

    Returns:
        The share of each phase; they add up to 1.
    """
    of_plant = plant_s / total_s
    phases = [of_plant * seconds / engine.plant_s for seconds in engine.phase_s]
    rest = of_plant * (engine.step_s - sum(engine.phase_s)) / engine.plant_s
    around = of_plant * (1.0 - engine.step_s / engine.plant_s)
    control = control_s / total_s
    parts: Sequence[float] = [*phases, rest, around, control, 1.0 - of_plant - control]
    return dict(zip(PHASES, parts, strict=True))


def _timers(data: mujoco.MjData) -> np.ndarray:
    return np.array(data.timer.duration)


def _timer(name: str) -> int:
    import mujoco

    return int(getattr(mujoco.mjtTimer, f"mjTIMER_{name.upper()}"))

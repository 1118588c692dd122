"""How the cost of a step grows with the worm's length, phase by phase, under the engine's factor order and annelid's.

A wave contracts every third ring, so that each segment has as much to do at any length. Both orders are stepped in
turn in one process, and times are the thread's own, so that other load disturbs both alike. Run
``taskset -c 1 python benchmarks/growth.py [--elements 3] [--segments 3 6 12 24]``; it takes some minutes, and half
an hour with 48 segments of three elements, where the engine orders nothing (``docs/upstream/sparse_ordering.md``).

Then several worms of twelve segments are stepped in turn. Each does the same arithmetic as alone, but finds the caches
filled by the others, as the parts of a long worm do: what a step takes longer is the caches' share of the growth. Last,
how long a worm of 48 segments takes to build and compile.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from time import thread_time

import mujoco
import numpy as np

from annelid import load_config
from annelid.body import build_spec, compile_spec
from annelid.body.elimination import SHORT_TUBE, order_elimination

TIMESTEP_S = 0.01
SETTLING_STEPS = 10
STEPS_A_STROKE = 20
ACTIVATION = 0.5
TIMER = mujoco.mjtTimer
PHASES = {"kinematics": TIMER.mjTIMER_POSITION, "forces": TIMER.mjTIMER_VELOCITY, "solver": TIMER.mjTIMER_CONSTRAINT}


@dataclass
class Worm:
    """One compiled worm and what its steps cost."""

    order: str
    model: mujoco.MjModel
    data: mujoco.MjData = field(init=False)
    milliseconds: list[float] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    entries: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Starts at rest."""
        self.data = mujoco.MjData(self.model)

    def step(self, number: int) -> None:
        """Steps once under the wave and books the cost, leaving out the first steps from rest."""
        stroke = number // STEPS_A_STROKE
        self.data.ctrl[:] = ACTIVATION * ((np.arange(self.model.nu) + stroke) % 3 == 0)
        if number == SETTLING_STEPS:
            for timer in self.data.timer:
                timer.duration, timer.number = 0.0, 0
        began = thread_time()
        mujoco.mj_step(self.model, self.data)
        if number >= SETTLING_STEPS:
            self.milliseconds.append(1e3 * (thread_time() - began))
            self.iterations.append(int(self.data.solver_niter[0]))
            self.entries.append(int(self.data.solver_nnz[0]))

    def phases(self) -> dict[str, float]:
        """Mean milliseconds of each phase of a step; what is left of the whole is the factor of the implicit step."""
        timer = self.data.timer
        mean = {name: timer[phase].duration / timer[phase].number for name, phase in PHASES.items()}
        forward = timer[TIMER.mjTIMER_FORWARD]
        return mean | {"implicit": forward.duration / forward.number - sum(mean.values())}

    def cost(self) -> dict[str, float]:
        """The row of the table."""
        numbers = {"ms": self.milliseconds, "iterations": self.iterations, "entries": self.entries}
        return {name: float(np.mean(values)) for name, values in numbers.items()} | self.phases()


def spec_of(n_segments: int, elements: int) -> mujoco.MjSpec:
    """Builds the rods preset at a length."""
    changes = {
        "body.mesh.n_segments": n_segments,
        "body.mesh.elements_per_side": elements,
        "clock.physics_timestep_s": TIMESTEP_S,
        "clock.control_timestep_s": TIMESTEP_S,
        "record.signals_interval_s": TIMESTEP_S,
        "record.frames_interval_s": TIMESTEP_S,
    }
    return build_spec(load_config("riddle2023-rods", changes))


def exponent(cost: dict[int, float], first: int, last: int) -> float:
    """Slope of the straight line through the logarithms of cost against length, from one length to another."""
    lengths = [length for length in cost if first <= length <= last]
    return float(np.polyfit(np.log(lengths), np.log([cost[length] for length in lengths]), 1)[0])


def in_turn(n_segments: int, elements: int, n_worms: int, steps: int) -> float:
    """Median milliseconds a step of each of several worms that are stepped in turn."""
    worms = [Worm("dissected", compile_spec(spec_of(n_segments, elements))) for _ in range(n_worms)]
    for number in range(steps):
        for worm in worms:
            worm.step(number)
    return float(np.median([spent for worm in worms for spent in worm.milliseconds]))


def main() -> None:
    """Prints the table, the exponents, the caches' share and the time of compilation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--segments", type=int, nargs="+", default=[3, 6, 12, 24])
    parser.add_argument("--elements", type=int, default=3)
    parser.add_argument("--steps", type=int, default=80)
    parser.add_argument("--in-turn", type=int, nargs="+", default=[1, 2, 4], help="numbers of worms of 12 segments")
    parser.add_argument("--compile", type=int, default=48, help="segments of the worm whose compilation is timed")
    arguments = parser.parse_args()
    mujoco.set_mjcb_time(lambda: 1e3 * thread_time())
    columns = ("ms", "kinematics", "forces", "implicit", "solver", "iterations", "entries")
    print(("{:>4} {:10} {:>6} {:>6} {:>8}" + " {:>10}" * len(columns)).format("N", "order", "nv", "rows", "", *columns))
    costs: dict[str, dict[int, dict[str, float]]] = {"engine": {}, "dissected": {}}
    for n_segments in arguments.segments:
        worms = [Worm(order, spec_of(n_segments, arguments.elements).compile()) for order in costs]
        order_elimination(worms[1].model)
        for number in range(arguments.steps):
            for worm in worms if number % 2 else worms[::-1]:
                worm.step(number)
        for worm in worms:
            costs[worm.order][n_segments] = row = worm.cost()
            shown = "short" if worm is worms[1] and (worm.model.efmC_perm >= 0).sum() < SHORT_TUBE else ""
            numbers = " ".join(f"{row[name]:10.0f}" if name == "entries" else f"{row[name]:10.2f}" for name in columns)
            print(
                f"{n_segments:4d} {worm.order:10} {worm.model.nv:6d} {worm.data.nefc:6d} {shown:>8} {numbers}",
                flush=True,
            )
    for first in (arguments.segments[0], 12):
        last = arguments.segments[-1]
        if first >= last:
            continue
        for order, rows in costs.items():
            slopes = {name: exponent({n: row[name] for n, row in rows.items()}, first, last) for name in columns}
            print(
                f"exponent {first}-{last} {order:10}",
                ", ".join(f"{name} {slope:.2f}" for name, slope in slopes.items()),
            )
    for n_worms in arguments.in_turn:
        spent = in_turn(12, arguments.elements, n_worms, arguments.steps)
        print(f"{n_worms} worms of 12 segments in turn: {spent:.2f} ms a step of each")
    began = thread_time()
    spec = spec_of(arguments.compile, arguments.elements)
    built = thread_time()
    compile_spec(spec)
    print(
        f"{arguments.compile} segments, {arguments.elements} elements a side: built in {built - began:.2f} s, "
        f"compiled in {thread_time() - built:.2f} s"
    )


if __name__ == "__main__":
    main()

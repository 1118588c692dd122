"""Throughput of many worms at once: simulated worm-seconds per wall-clock second, recording on.

    python benchmarks/batch_throughput.py [worms] [simulated seconds] [rounds]

Compares `simulate_batch` on one and on two threads with a loop of `simulate`, in turn within one process, and gives
the ratios of every round: absolute figures differ between machines and hours. Networks, reading, recording and the
loop run on one thread; their share of the processor time is given as serial. Where other programs share the cores
only the last column means anything: the ratio that processor times would make of wall-clock times on idle cores.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from time import process_time, thread_time
from typing import Any
from unittest.mock import patch

from mujoco.batch import Batch

from annelid import RunConfig, load_config, simulate, simulate_batch
from annelid.simulation.batch import loop

SETTINGS: dict[str, Any] = {
    "clock.physics_timestep_s": 0.02,
    "body.mesh.elements_per_side": 2,
    "record.signals_interval_s": 0.02,
    "record.frames_interval_s": 0.2,
}


@dataclass(frozen=True, slots=True)
class Cost:
    """What a batch took, s: wall-clock time, processor time of all threads, and of it that outside the engine."""

    wall: float
    processor: float
    serial: float


@contextmanager
def engine_clock() -> Iterator[list[float]]:
    """Collects the calling thread's processor time inside the engine's batch, s."""
    step, spent = Batch.step, []

    def timed(batch: Batch, ids: Any = None, nstep: int = 1) -> None:
        began = thread_time()
        step(batch, ids, nstep)
        spent.append(thread_time() - began)

    with patch.object(Batch, "step", timed):
        yield spent


@contextmanager
def loop_clock() -> Iterator[list[float]]:
    """Collects processor time of the loop of a batch, s: of all threads, and of the calling one."""
    run, spent = loop._Loop.run, []

    def timed(batch: Any) -> float:
        began = process_time(), thread_time()
        wall = run(batch)
        spent.extend((process_time() - began[0], thread_time() - began[1]))
        return wall

    with patch.object(loop._Loop, "run", timed):
        yield spent


def batched(configs: list[RunConfig], threads: int) -> Cost:
    """What a batch takes on some threads."""
    with tempfile.TemporaryDirectory() as folder, engine_clock() as engine, loop_clock() as whole:
        result = simulate_batch(configs, folder, threads=threads, progress=False)
        assert set(result.statuses) == {"complete"}, result.messages
    return Cost(result.wall_time_s, whole[0], whole[1] - sum(engine))


def one_by_one(configs: list[RunConfig]) -> float:
    """Wall-clock time of the same runs one after another, s."""
    with tempfile.TemporaryDirectory() as folder:
        return sum(
            simulate(config, Path(folder) / str(i), progress=False).wall_time_s for i, config in enumerate(configs)
        )


def main(n_worms: int, duration_s: float, rounds: int) -> None:
    base = load_config("riddle2023-rods", SETTINGS | {"duration_s": duration_s})
    configs = [base.model_copy(update={"seed": seed}) for seed in range(n_worms)]
    work = n_worms * duration_s
    print(f"{n_worms} worms of {duration_s:g} s; worm-seconds per wall-clock second")
    heading = ("load", "1 thread", "2 threads", "simulate()", "2 : 1", "2 : loop", "serial", "2 : 1 undisturbed")
    print("{:>5} {:>10} {:>10} {:>11} {:>6} {:>9} {:>7} {:>18}".format(*heading))
    for _ in range(rounds):
        load = os.getloadavg()[0]
        one, two = batched(configs, 1), batched(configs, 2)
        # A few are enough for a mean.
        few = configs[: max(1, n_worms // 8)]
        alone = one_by_one(few) * n_worms / len(few)
        undisturbed = one.processor / (two.serial + (two.processor - two.serial) / 2)
        print(
            f"{load:5.1f} {work / one.wall:10.2f} {work / two.wall:10.2f} {work / alone:11.2f} "
            f"{one.wall / two.wall:6.2f} {alone / two.wall:9.2f} {one.serial / one.processor:7.1%} {undisturbed:18.2f}"
        )
    print(f"peak memory {getrusage(RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    n, seconds, times = [*sys.argv[1:], *("32", "2", "3")[len(sys.argv) - 1 :]]
    main(int(n), float(seconds), int(times))

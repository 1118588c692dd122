"""Throughput of many worms at once: simulated worm-seconds per wall-clock second, recording on.

    python benchmarks/batch_throughput.py [worms] [simulated seconds] [rounds] [docs/results/batch_throughput.csv]

Compares `simulate_batch` on one and on two threads with a loop of `simulate`, in turn within one process, and gives
the ratios of every round: absolute figures differ between machines and hours. Run it where nothing else computes.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from typing import Any

from annelid import RunConfig, load_config, simulate, simulate_batch
from annelid.output import write_csv

SETTINGS: dict[str, Any] = {
    "record.frames_interval_s": 0.2,
}


def batched(configs: list[RunConfig], threads: int) -> float:
    """Wall-clock time of a batch on some threads, s."""
    with tempfile.TemporaryDirectory() as folder:
        result = simulate_batch(configs, folder, threads=threads, progress=False)
        assert set(result.statuses) == {"complete"}, result.messages
    return result.wall_time_s


def one_by_one(configs: list[RunConfig]) -> float:
    """Wall-clock time of the same runs one after another, s."""
    with tempfile.TemporaryDirectory() as folder:
        return sum(
            simulate(config, Path(folder) / str(i), progress=False).wall_time_s for i, config in enumerate(configs)
        )


def main(n_worms: int, duration_s: float, rounds: int, path: str) -> None:
    base = load_config("riddle2023-rods", SETTINGS | {"duration_s": duration_s})
    configs = [base.model_copy(update={"seed": seed}) for seed in range(n_worms)]
    work = n_worms * duration_s
    print(f"{n_worms} worms of {duration_s:g} s; worm-seconds per wall-clock second")
    heading = ("load", "1 thread", "2 threads", "simulate()", "2 : 1", "2 : loop")
    print("{:>5} {:>10} {:>10} {:>11} {:>6} {:>9}".format(*heading))
    rows = []
    for _ in range(rounds):
        load = os.getloadavg()[0]
        one, two = batched(configs, 1), batched(configs, 2)
        # A few are enough for a mean.
        few = configs[: max(1, n_worms // 8)]
        alone = one_by_one(few) * n_worms / len(few)
        print(
            f"{load:5.1f} {work / one:10.2f} {work / two:10.2f} {work / alone:11.2f} "
            f"{one / two:6.2f} {alone / two:9.2f}"
        )
        rows.append((load, work / one, work / two, work / alone))
    if path:
        write_csv(Path(path), ["load", "one_thread", "two_threads", "loop"], rows)
    print(f"peak memory {getrusage(RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    n, seconds, times, csv = [*sys.argv[1:], *("32", "2", "3", "")[len(sys.argv) - 1 :]]
    main(int(n), float(seconds), int(times), csv)

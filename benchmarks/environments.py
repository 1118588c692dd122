"""Environments: steps a second with random actions on one thread and on two, and what a coarse worm costs in accuracy.

    python benchmarks/environments.py throughput [worms] [steps] [rounds]
    python benchmarks/environments.py share [worms] [steps]
    python benchmarks/environments.py fidelity [docs/results/environments.csv]

The first compares one and two threads in turn within one process and gives the ratio of every round: absolute figures
differ between machines and hours, so run it where nothing else computes. The second tells how much of a thread's CPU
time goes to the engine, which steps without Python's lock. The third lets the same wave act on worms of different
resolution, on open ground and in pipes; its speeds are those of the worm, its times CPU times.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter, process_time, thread_time
from typing import Any
from unittest.mock import patch

import gymnasium
import mujoco
import numpy as np

import annelid.environments  # noqa: F401 -- registers them
from annelid.environments.single import INTERVAL_S
from annelid.output import write_csv

FIDELITIES = (("preset's own", None, {}), ("fast", "fast", {}), ("coarse", "coarse", {}), ("preview", "preview", {}))
COARSER = ("coarse, 40 ms", "coarse", {"clock.physics_timestep_s": 0.04})
STAGES = "mj_fwdPosition", "mj_fwdVelocity", "mj_step2"
"""What a step of rods calls of the engine."""
TURN_S = 0.27
"""Time from one segment to the next, about that of the paper's network on this body."""


def random_steps_per_s(threads: int, n_worms: int, n_steps: int) -> float:
    """Steps of single worms a second of wall-clock time, with actions drawn at random; compilation not counted."""
    envs = gymnasium.make_vec("annelid/Worm-v0", num_envs=n_worms, threads=threads)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    actions = [envs.action_space.sample() for _ in range(n_steps)]
    began = perf_counter()
    for action in actions:
        envs.step(action)
    seconds = perf_counter() - began
    envs.close()
    return n_worms * n_steps / seconds


def throughput(n_worms: int, n_steps: int, rounds: int) -> None:
    """Prints steps a second on one thread and on two."""
    print(f"{n_worms} worms, {n_steps} steps of {INTERVAL_S:g} s, random actions")
    print("{:>5} {:>10} {:>10} {:>6}".format("load", "1 thread", "2 threads", "2 : 1"))
    for _ in range(rounds):
        load = os.getloadavg()[0]
        one, two = (random_steps_per_s(threads, n_worms, n_steps) for threads in (1, 2))
        print(f"{load:5.1f} {one:10.1f} {two:10.1f} {two / one:6.2f}", flush=True)


@contextmanager
def timed_engine() -> Iterator[list[float]]:
    """Collects the CPU times of the engine's calls in a step of rods, s."""
    spent: list[float] = []

    def timed(call: Callable[..., Any]) -> Callable[..., Any]:
        def called(*arguments: Any) -> Any:
            began = thread_time()
            result = call(*arguments)
            spent.append(thread_time() - began)
            return result

        return called

    with ExitStack() as stack:
        for name in STAGES:
            stack.enter_context(patch.object(mujoco, name, timed(getattr(mujoco, name))))
        yield spent


def share(n_worms: int, n_steps: int) -> None:
    """Prints how much of the CPU time of steps with random actions is the engine's, on one thread."""
    envs = gymnasium.make_vec("annelid/Worm-v0", num_envs=n_worms, threads=1)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    with timed_engine() as spent:
        began = thread_time()
        for _ in range(n_steps):
            envs.step(envs.action_space.sample())
        seconds = thread_time() - began
    of_one_ms = 1e3 * seconds / (n_worms * n_steps)
    print(f"{of_one_ms:.1f} ms of CPU time a step of a worm, {sum(spent) / seconds:.0%} in the engine")


def timed_wave(time_s: float, n: int) -> np.ndarray:
    """Activation of a wave in which every ring rises, holds and falls for a turn each, a turn after its neighbour."""
    since = (time_s / TURN_S - np.arange(n)) % n
    return np.clip(np.minimum(since, 3.0 - since), 0.0, 1.0)


def wave_speed(env_id: str, **options: object) -> tuple[float, float, str]:
    """Speed of a worm under the timed wave, body lengths/s; CPU time a simulated second; and how it ended."""
    env = gymnasium.make(env_id, start_activation=0.0, **options)
    env.reset(seed=0)
    info, ended, began = {"time_s": 0.0}, False, process_time()
    n = env.action_space.shape[0]
    while not ended:
        action = timed_wave(info["time_s"] + env.unwrapped.task.interval_s, n)
        _, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    seconds = process_time() - began
    word = info["stopped"] or ("passed" if info["is_success"] else "")
    return info["travel"] / info["time_s"], seconds / info["time_s"], word


def fidelity(path: str = "") -> None:
    """Prints what worms of different resolution do under the same wave, and writes it as CSV where a path is given."""
    rows: dict[str, dict[str, object]] = {}
    print(f"{'':32}{'body lengths/s':>15}{'CPU s per s':>13}")
    for name, level, changes in (*FIDELITIES, COARSER):
        speed, cost, word = wave_speed("annelid/Worm-v0", fidelity=level, changes=changes)
        print(f"{'open ground, ' + name:32}{speed:15.3f}{cost:13.3f}  {word}", flush=True)
        rows[name] = {"worm": name, "open": speed, "cpu_s_per_s": cost}
    for name, level, changes in FIDELITIES[:3]:
        for arena in ("pipe.taper", "pipe.bend"):
            options = {"arena": arena, "changes": {"arena.radius": 0.8, **changes}, "episode_s": 30.0}
            speed, cost, word = wave_speed("annelid/WormPipe-v0", fidelity=level, **options)
            print(f"{arena + ', ' + name:32}{speed:15.3f}{cost:13.3f}  {word}", flush=True)
            rows[name][arena] = speed
    if path:
        columns = ["worm", "open", "pipe.bend", "pipe.taper", "cpu_s_per_s"]
        write_csv(Path(path), columns, ([row.get(column) for column in columns] for row in rows.values()))


if __name__ == "__main__":
    what, *numbers = sys.argv[1:] or ["throughput"]
    if what == "fidelity":
        fidelity(*numbers)
    elif what == "share":
        share(*map(int, [*numbers, *("8", "15")[len(numbers) :]]))
    else:
        n, steps, times = [*numbers, *("16", "25", "5")[len(numbers) :]]
        throughput(int(n), int(steps), int(times))

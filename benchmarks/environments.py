"""Environments: steps a second of many worms in one process and in many, and what a coarse worm costs in accuracy.

    python benchmarks/environments.py throughput [vector_environments.csv]
    python benchmarks/environments.py fidelity [docs/results/environments.csv]
    python benchmarks/environments.py learning [docs/results/learning.csv]

Steps a second differ between machines and hours: run the first where nothing else computes, with OMP_NUM_THREADS=1. The
second lets the same wave act on worms of different resolution, on open ground and in pipes; its speeds are those of the
worm, its times CPU times. The third compares a body for learning with the fine one, under waves of the controller
`timed`, and takes the time of both in turn, in one process on one core.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import gymnasium
import numpy as np

import annelid.environments  # noqa: F401 -- registers them
from annelid.config import load_config
from annelid.output import write_csv

FIDELITIES = (("preset's own", None, {}), ("fast", "fast", {}), ("coarse", "coarse", {}), ("preview", "preview", {}))
COARSER = ("coarse, 40 ms", "coarse", {"clock.physics_timestep_s": 0.04})
MODES = ("sync", "async")
TURN_S = 0.27
"""Time from one segment to the next, about that of the paper's network on this body."""
FINE, FOR_LEARNING = "riddle2023-rods", "riddle2023-rods-coarse"
BODIES = ((FINE, 4), (FOR_LEARNING, 40), (FINE, 10), (FINE, 2), (FOR_LEARNING, 20))
"""Bodies and their steps, ms: those of the benchmark of controllers, for learning and of the preset; half of the first
two."""
TIMED, ROUNDS = 3, 5
"""How many of these are timed, and how often: the least time counts."""
FRICTION = 0.6
CASES = ((FRICTION, 0.16), (FRICTION, 0.24), (FRICTION, 0.4), (0.3, 0.24), (1.0, 0.24))
"""Friction, and the time for which each segment rises, holds and falls, s; the next begins twice as much later."""
LEARNING_INTERVAL_S, LEARNING_EPISODE_S, SETTLING_S = 0.08, 8.0, 2.0


def steps_per_s(mode: str, n_worms: int, seconds: float) -> float:
    """Steps of single worms a second of wall-clock time, with actions drawn at random; the start is not counted."""
    envs = gymnasium.make_vec("annelid/Worm-v0", num_envs=n_worms, vectorization_mode=mode)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    envs.step(envs.action_space.sample())
    began, n_steps = perf_counter(), 0
    while perf_counter() < began + seconds:
        envs.step(envs.action_space.sample())
        n_steps += 1
    rate = n_worms * n_steps / (perf_counter() - began)
    envs.close()
    return rate


def throughput(path: Path | None) -> None:
    """Prints steps a second of worms in this process and in processes of their own; writes a path as CSV."""
    rows: list[list[object]] = []
    print("{:>5} {:>6} {:>8} {:>8}".format("load", "worms", *MODES))
    for n_worms in (1, 8, 64):
        load = os.getloadavg()[0]
        rows.append([n_worms, *(steps_per_s(mode, n_worms, 12.0) for mode in MODES)])
        print("{:5.1f} {:6} {:8.1f} {:8.1f}".format(load, *rows[-1]), flush=True)
    if path:
        write_csv(path, ["worms", *(f"{mode}_per_s" for mode in MODES)], rows)


def timed_wave(time_s: float, n: int) -> np.ndarray:
    """Activation of a wave in which every ring rises, holds and falls for a turn each, a turn after its neighbour."""
    since = (time_s / TURN_S - np.arange(n)) % n
    return np.clip(np.minimum(since, 3.0 - since), 0.0, 1.0)


def wave_speed(env_id: str, **options: Any) -> tuple[float, float, str]:
    """Speed of a worm under the timed wave, body lengths/s; CPU time a simulated second; and how it ended."""
    env: Any = gymnasium.make(env_id, start_activation=0.0, **options)
    env.reset(seed=0)
    info: dict[str, Any] = {"time_s": 0.0}
    ended, began = False, process_time()
    n = env.action_space.shape[0]
    while not ended:
        action = timed_wave(info["time_s"] + env.unwrapped.task.interval_s, n)
        _, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    seconds = process_time() - began
    word = info["stopped"] or ("passed" if info["is_success"] else "")
    return info["travel"] / info["time_s"], seconds / info["time_s"], word


def fidelity(path: Path | None) -> None:
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
        write_csv(path, columns, ([row.get(column) for column in columns] for row in rows.values()))


def walk(env: Any, rise_s: float) -> tuple[float, float, float]:
    """Walks for an episode under a wave by the clock.

    Returns:
        Speed after the first seconds, cm/s; greatest elongation of a segment then, mean over the segments, cm; and CPU
        time of a step, ms. NaN where the simulation broke down.
    """
    ramps = {"rise_s": rise_s, "hold_s": rise_s, "fall_s": rise_s, "interval_s": 2.0 * rise_s}
    wave: Any = load_config(FINE, {"controller": {"kind": "timed", **ramps}}).controller
    worm, interval_s = env.unwrapped, env.unwrapped.task.interval_s
    env.reset(seed=0)
    places_m, longer_m, over, spent_s = list[float](), list[np.ndarray](), False, 0.0
    while not over:
        action = wave.activation((len(places_m) + 1) * interval_s, env.action_space.shape[0])
        began = process_time()
        *_, broken, over, info = env.step(action)
        spent_s += process_time() - began
        if broken:
            return float("nan"), float("nan"), float("nan")
        places_m.append(info["travel"] * worm.worm.geometry.length_m)
        longer_m.append((worm.sensation.stretch_m - worm.sensation.rest_stretch_m).mean(axis=1))
    settled = round(SETTLING_S / interval_s)
    speed = (places_m[-1] - places_m[settled]) / (LEARNING_EPISODE_S - (settled + 1) * interval_s)
    elongation = float(np.mean(np.max(longer_m[settled:], axis=0)))
    return 100.0 * speed, 100.0 * elongation, 1e3 * spent_s / len(places_m)


def learning(path: Path | None) -> None:
    """Prints what the body for learning does beside the fine one, and what a step costs; writes a path as CSV."""
    rows: list[list[object]] = []
    for number, (friction, rise_s) in enumerate(CASES):
        bodies = BODIES if friction == FRICTION else BODIES[:TIMED]
        envs = [
            gymnasium.make(
                "annelid/Worm-v0",
                preset=preset,
                changes={"clock.physics_timestep_s": 1e-3 * step_ms, "arena.friction": friction},
                fidelity=None,
                interval_s=LEARNING_INTERVAL_S,
                episode_s=LEARNING_EPISODE_S,
                start_activation=0.0,
            )
            for preset, step_ms in bodies
        ]
        walks = [walk(env, rise_s) for env in envs]
        for _ in range(ROUNDS - 1 if number == 0 else 0):
            for i, env in enumerate(envs[:TIMED]):
                walks[i] = min(walks[i], walk(env, rise_s), key=lambda one: one[2])
        fine = walks[0]
        for (preset, step_ms), own in zip(bodies, walks, strict=True):
            speed, elongation, cost = (one / other for one, other in zip(own, fine, strict=True))
            beside = [speed - 1.0, elongation - 1.0, 1.0 / cost if number == 0 else ""]
            rows.append([preset, step_ms, friction, rise_s, *own, *beside])
            print("{:24}{:4} ms{:5.1f}{:6.2f} s{:7.2f} cm/s{:6.2f} cm{:8.2f} ms {:+.2f} {:+.2f} {}".format(*rows[-1]))
    if path:
        of_each = ["worm", "step_ms", "friction", "rise_s", "speed_cm_per_s", "elongation_cm", "cpu_ms"]
        write_csv(path, [*of_each, "speed_change", "elongation_change", "times_less_cpu"], rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    modes = {"throughput": throughput, "fidelity": fidelity, "learning": learning}
    parser.add_argument("what", choices=modes)
    parser.add_argument("csv", nargs="?", type=Path, help="file for the numbers")
    given = parser.parse_args()
    modes[given.what](given.csv)

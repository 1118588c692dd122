"""A worm learns to crawl: evolution finds a rhythm, the lag between neighbours, and a stretch reflex.

    python examples/learn_to_crawl.py [folder]

Every ring contracts by one rhythm, each a lag after its neighbour in front, and gives way or resists as its segment is
stretched: five numbers, found by CMA-ES (package cmaes). The start is a worm that contracts all over at once and stays
where it is. Takes about two minutes on two cores; needs pip install 'annelid[gym,tune]'.
"""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium
import numpy as np
from cmaes import CMA
from rich.progress import track

import annelid.environments  # noqa: F401 -- makes the worms known to gymnasium
from annelid.view.canvas import canvas, save

START = np.array([0.0, 0.0, 0.0, 0.0, 0.0])
WORMS, EPISODE_S = 8, 6.0


def activation(numbers: np.ndarray, time_s: float, stretch: np.ndarray) -> np.ndarray:
    """Activation of every ring, (worms, rings), from five numbers a worm and the strain of its segments."""
    pace, lag, rest, steepness, reflex = numbers.T[:, :, np.newaxis]
    turn = time_s * 0.6 * np.exp(0.5 * pace) - 0.2 * lag * np.arange(stretch.shape[1])
    drive = np.cos(2.0 * np.pi * turn) - 0.5 * rest + reflex * stretch
    return 1.0 / (1.0 + np.exp(-4.0 * np.exp(0.5 * steepness) * drive))


def returns(envs: gymnasium.vector.VectorEnv, numbers: np.ndarray) -> np.ndarray:
    """Sum of rewards of one episode of every worm, each with five numbers of its own, (worms, 5)."""
    observations, _ = envs.reset(seed=0)
    total, going, time_s = np.zeros(len(numbers)), np.ones(len(numbers), dtype=bool), 0.0
    while going.any():
        stretch = envs.unwrapped.layout.named(observations)["stretch_strain"].mean(axis=-1)
        observations, rewards, over, late, infos = envs.step(activation(numbers, time_s, stretch))
        total, going, time_s = total + going * rewards, going & ~(over | late), float(infos["time_s"].max())
    return total


def main(folder: Path, generations: int = 25, **worm: object) -> tuple[float, float]:
    """Learns, prints and draws; returns what the start and the best worm got."""
    envs = gymnasium.make_vec("annelid/Worm-v0", num_envs=WORMS, **{"episode_s": EPISODE_S, **worm})
    search = CMA(mean=START, sigma=0.5, population_size=WORMS, seed=1)
    start = float(returns(envs, np.tile(START, (WORMS, 1)))[0])
    best, found, curve = start, START, []
    for _ in track(range(generations), description="generations"):
        asked = np.stack([search.ask() for _ in range(WORMS)])
        got = returns(envs, asked)
        search.tell(list(zip(asked, -got, strict=True)))
        if got.max() > best:
            best, found = float(got.max()), asked[got.argmax()]
        curve.append((got.mean(), best))
    envs.close()
    print(f"return of the start {start:.2f}, learned {best:.2f}, with {np.round(found, 2)}")
    with canvas(3.0) as figure:
        axes = figure.subplots()
        axes.plot(range(1, generations + 1), curve, label=["mean of a generation", "best so far"])
        axes.axhline(start, color="0.6", linestyle=":", label="start")
        axes.set(xlabel="generation", ylabel="return")
        axes.legend()
        save(figure, folder / "learning_curve.png")
    return start, best


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))

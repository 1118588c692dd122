"""A worm learns to crawl: evolution finds a rhythm, the lag between neighbouring rings, and a stretch reflex.

At first it contracts all over at once and stays where it is. Takes minutes on two cores.

    pip install 'annelid[gym]' cmaes && python examples/learn_to_crawl.py [folder]
"""

import sys
from pathlib import Path

import gymnasium
import numpy as np
from cmaes import CMA
from rich.progress import track

from annelid.draw.canvas import canvas, save

NAME, START, WORMS = "annelid.environments:annelid/Worm-v0", np.zeros(5), 8


def activation(numbers: np.ndarray, time_s: float, stretch: np.ndarray) -> np.ndarray:
    """Activation of the rings, (worms, rings), from five numbers a worm, (worms, 5), and the strain of segments."""
    pace, lag, rest, steepness, reflex = numbers.T[:, :, np.newaxis]
    turn = time_s * 0.6 * np.exp(0.5 * pace) - 0.2 * lag * np.arange(stretch.shape[1])
    drive = np.cos(2.0 * np.pi * turn) - 0.5 * rest + reflex * stretch
    return 1.0 / (1.0 + np.exp(-4.0 * np.exp(0.5 * steepness) * drive))


def returns(envs: gymnasium.vector.SyncVectorEnv | gymnasium.vector.AsyncVectorEnv, numbers: np.ndarray) -> np.ndarray:
    """Sum of rewards of one episode of every worm, each with five numbers of its own, (worms, 5)."""
    layout, (observations, _), total, going, time_s = envs.get_attr("layout")[0], envs.reset(seed=0), 0.0, True, 0.0
    while np.any(going):
        stretch = layout.named(observations)["stretch_strain"].mean(axis=-1)
        observations, rewards, over, late, infos = envs.step(activation(numbers, time_s, stretch))
        total, going, time_s = total + going * rewards, going & ~(over | late), infos["time_s"].max()
    return total


def main(folder: Path, generations: int = 25, **worm: object) -> tuple[float, float]:
    """Learns, prints and draws; returns what eight worms got on average at the start and in the end."""
    envs = gymnasium.make_vec(NAME, WORMS, vectorization_mode="async", **{"episode_s": 6.0, **worm})
    search = CMA(mean=START, sigma=0.5, population_size=WORMS, seed=1)
    curve = [returns(envs, np.tile(START, (WORMS, 1)))]
    for _ in track(range(generations), description="generations"):
        asked = np.stack([search.ask() for _ in range(WORMS)])
        curve.append(returns(envs, asked))
        search.tell(list(zip(asked, -curve[-1], strict=True)))
    start, learned = curve[0].mean(), returns(envs, np.tile(search.mean, (WORMS, 1))).mean()
    print(f"return of the start {start:.2f}, learned {learned:.2f}, with {np.round(search.mean, 3).tolist()}")
    with canvas(3.0) as figure:
        axes = figure.subplots(subplot_kw={"xlabel": "generation", "ylabel": "return"})
        dots = axes.plot(curve, "o", color="0.7", markersize=3)
        mean = axes.plot(np.mean(curve, axis=1))
        axes.legend([dots[0], mean[0]], ["one worm", "mean of a generation"], loc="lower right")
        save(figure, folder / "learning_curve.png")
    return start, learned


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))

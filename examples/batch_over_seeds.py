"""How much does noise scatter a rhythm? Eight worms with the same noise on their sensors, each from another seed.

    python examples/batch_over_seeds.py [noise in mm]

All worms run as one batch, each bit for bit as if alone. Takes half a minute on two cores.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from annelid import load_config, simulate_batch, summary
from annelid.analysis import rhythm_score


def main(folder: Path, noise_m: float = 0.025, duration_s: float = 8.0, seeds: Sequence[int] = range(8)) -> None:
    """Runs the batch, scores every worm, and tells the scatter of their periods."""
    config = load_config("riddle2023-rods", {"sensor.noise_m": noise_m, "duration_s": duration_s})
    batch = simulate_batch(config, folder, seeds=seeds)
    periods_s = []
    for seed, run in zip(seeds, batch, strict=True):
        score = rhythm_score(run)
        print(f"seed {seed}: {score.verdict or 'too short'}, {score.reason}")
        period_s = summary(run).period_s
        if period_s is not None:
            periods_s.append(period_s)
    if periods_s:
        print(
            f"period {np.mean(periods_s):.3f} s, scatter {1000 * np.std(periods_s):.0f} ms over {len(periods_s)} worms"
        )


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(temporary), float(sys.argv[1]) / 1000 if len(sys.argv) > 1 else 0.025)

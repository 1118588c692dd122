"""How much does noise scatter a rhythm? Eight worms with the same noise on their sensors, each from another seed.

    python examples/scatter_over_seeds.py [noise in mm]

The worms run in processes, one for every core.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from annelid.experiment import Case, Store


def main(folder: Path, noise_m: float = 0.025, duration_s: float = 8.0, seeds: Sequence[int] = range(8)) -> None:
    """Runs the worms, and tells the verdict on every rhythm and the scatter of their periods."""
    changes = {"sensor.noise_m": noise_m, "duration_s": duration_s}
    cases = [Case("riddle2023-rods", {**changes, "seed": seed}) for seed in seeds]
    store = Store(folder)
    store.compute(cases)
    periods_s = []
    for seed, case in zip(seeds, cases, strict=True):
        score = store[case].rhythm
        print(f"seed {seed}: {score.verdict or 'too short'}, {score.reason}")
        period_s = store[case].summary.period_s
        if period_s is not None:
            periods_s.append(period_s)
    if periods_s:
        print(
            f"period {np.mean(periods_s):.3f} s, scatter {1000 * np.std(periods_s):.0f} ms over {len(periods_s)} worms"
        )


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(temporary), float(sys.argv[1]) / 1000 if len(sys.argv) > 1 else 0.025)

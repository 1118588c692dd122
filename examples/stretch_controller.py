"""A controller of your own in closed loop: a segment is let go once it is long enough, and the next one contracts.

    python examples/stretch_controller.py [folder]

Ask for less stretch, and the wave goes faster. Ask for more than the muscles can give, and the first segment stays
contracted for ever: a closed loop waits, which a clock cannot. Takes a quarter of a minute.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import annelid


class HandOver:
    """Contracts a segment until it is long enough, then the next."""

    def __init__(self, enough_m: float) -> None:
        """Remembers how much longer than at rest a segment must get."""
        self.enough_m = enough_m

    def reset(self, seed: int) -> None:
        """Begins at the front."""
        self.active = 0

    def step(self, sensation: annelid.Sensation) -> np.ndarray:
        """Returns the activation of every ring muscle."""
        lengthening_m = (sensation.stretch_m - sensation.rest_stretch_m).mean(axis=1)
        if lengthening_m[self.active] > self.enough_m:
            self.active = (self.active + 1) % len(lengthening_m)
        return (np.arange(len(lengthening_m)) == self.active).astype(float)


def main(folder: Path, duration_s: float = 4.0) -> None:
    """Runs the worm with three lengths to reach, and tells the pace of each."""
    config = annelid.load_config("riddle2025-muscles", {"duration_s": duration_s})
    for enough_m in (0.03, 0.05, 0.08):
        run = annelid.simulate(config, folder / f"{enough_m}", controller=HandOver(enough_m), progress=False)
        numbers = annelid.summary(run)
        period = "no period" if numbers.period_s is None else f"one cycle in {numbers.period_s:.2f} s"
        print(f"{100 * enough_m:.0f} cm: {len(numbers.order)} contractions, {period}")


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))

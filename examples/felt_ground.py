"""A controller of your own that feels the ground: the wave goes on only when what it has left behind stands firm.

Segments take turns from front to rear. The contracted one hands over to the next when it has lengthened by 5 cm and the
segment two places before it has come down and bears a newton, so that the worm never hangs in the air.
"""

from __future__ import annotations

import tempfile

import numpy as np

import annelid


class Wave:
    """Contracts one segment after another, paced by stretch and touch."""

    def reset(self, seed: int) -> None:
        """Begins at the front."""
        self.active = 0

    def step(self, sensation: annelid.Sensation) -> np.ndarray:
        """Returns the activation of every ring."""
        n = len(sensation.ring_length_m)
        long_enough = (sensation.stretch_m - sensation.rest_stretch_m)[self.active].mean() > 0.05
        firm = sensation.touch_N[self.active - 2].sum() > 1.0
        if long_enough and firm:
            self.active = (self.active + 1) % n
        return (np.arange(n) == self.active).astype(float)


def main(duration_s: float = 6.0) -> None:
    """Runs it on the six-segment body and prints what its gait is worth."""
    config = annelid.load_config("riddle2025-muscles", {"duration_s": duration_s})
    with tempfile.TemporaryDirectory() as folder:
        run = annelid.simulate(config, folder, controller=Wave())
        slip = run.data["slip_loss"].values[-1].sum()
        numbers = annelid.summary(run)
    print(f"{numbers.full_cycles} waves, {100 * (numbers.travel_m or 0.0):.1f} cm in {duration_s:g} s")
    print(f"{slip:.2f} J lost to slip")


if __name__ == "__main__":
    main()

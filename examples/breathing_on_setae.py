"""A worm that only breathes: all segments contract and let go together, without any wave.

On ground where friction is the same in both directions it stays where it is. With setae, which let the skin slide
forwards and hold it backwards, the same breathing carries it away.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import annelid


def breathe(sensation: annelid.Sensation) -> np.ndarray:
    """Contracts all rings slowly and lets them go as slowly, once in two seconds."""
    return np.full(len(sensation.ring_length_m), 0.5 - 0.5 * np.cos(np.pi * sensation.time_s))


def travel_m(friction: float, backward_friction: float | None, duration_s: float, folder: Path) -> float:
    """Returns how far the worm gets towards its front, m."""
    ground = {"arena.friction": friction, "arena.backward_friction": backward_friction}
    config = annelid.load_config("riddle2023-rods", {**ground, "duration_s": duration_s})
    run = annelid.simulate(config, folder, controller=breathe)
    travelled = annelid.summary(run).travel_m
    assert travelled is not None
    return travelled


def main(duration_s: float = 6.0) -> None:
    """Prints the travel on even ground and with setae."""
    with tempfile.TemporaryDirectory() as folder:
        even = travel_m(0.6, None, duration_s, Path(folder) / "even")
        setae = travel_m(0.2, 1.0, duration_s, Path(folder) / "setae")
    print(f"the same friction both ways:  {100 * even:6.1f} cm in {duration_s:g} s")
    print(f"setae, five times as much:    {100 * setae:6.1f} cm")


if __name__ == "__main__":
    main()

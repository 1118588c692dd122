"""A run in two parts is the run in one: the second part goes on from the first one's last checkpoint, bit for bit.

    python examples/resume_a_run.py [folder]

Takes a few seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr

from annelid import load_config, simulate


def main(folder: Path, duration_s: float = 4.0) -> None:
    """Computes a run at once and in two parts, joins the parts, and compares."""
    whole_config = load_config("riddle2023-rods", {"duration_s": duration_s, "sensor.noise_m": 0.001})
    half_config = load_config(whole_config.model_dump(), {"duration_s": duration_s / 2})

    whole = simulate(whole_config, folder / "whole")
    first = simulate(half_config, folder / "first")
    second = simulate(whole_config, folder / "second", resume=first)
    print(f"the second part begins at {second.start_s:g} s")

    signals = ["stretch_length", "potential", "center_of_mass"]
    joined = xr.concat([first.data[signals], second.data[signals]], dim="time")
    same = all(np.array_equal(joined[name], whole.data[name]) for name in signals)
    print("the two parts are the whole, bit for bit" if same else "the two parts differ from the whole")


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))

"""A simulated segment on the load frame beside the measured one: force against diameter, and the work lost.

    python examples/compare_with_measured_data.py [picture.png]

The measurement is the authors' (src/annelid/data). A file of yours has the same three columns: cable displacement in
mm, force in N, time in s. What the simulated loop lacks is friction: docs/calibration.md. Takes half a minute.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from annelid import load_config
from annelid.draw.canvas import canvas, save
from annelid_lab.calibration import Loop, load_frame, read_loop

WORM = {"body.mesh.n_segments": 3}


def main(picture: Path, measured: Loop, displacement_m: float = 0.3, speed_m_per_s: float = 0.01) -> None:
    """Draws both loops and tells how far apart they are."""
    config = load_config("riddle2025", WORM | {"body.rings.force_limit_N": 13.0})
    simulated = load_frame(config, displacement_m=displacement_m, speed_m_per_s=speed_m_per_s)
    at_m = np.linspace(0.1, 0.9, 9) * min(displacement_m, measured.displacement_m.max())
    difference_N = simulated.branches(at_m) - measured.branches(at_m)
    print(f"{np.sqrt(np.mean(difference_N**2)):.1f} N root mean square over both ways")
    with canvas(3.6) as figure:
        axes = figure.subplots()
        for label, loop, style in (("measured", measured, "0.5"), ("simulated", simulated, "#c2410c")):
            axes.plot(100 * loop.displacement_m / 3, loop.force_N, color=style, label=label)
        axes.set_xlabel("change of the diameter (cm)")
        axes.set_ylabel("cable force (N)")
        axes.legend()
        print(save(figure, picture))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "load_frame.png"), read_loop())

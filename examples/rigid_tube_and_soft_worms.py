"""Ring length against segment length: Huang's tube of rigid sides in closed form, and two worms that bend.

    python examples/rigid_tube_and_soft_worms.py [picture.png]

Segment 2 of each worm is contracted in open loop. A uniform rigid tube follows a quarter of an ellipse, whatever the
forces; a worm leaves it, since only one ring contracts, sides bend, and pins may give. Takes a few seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from annelid import load_config, simulate
from annelid.draw.canvas import canvas, save

PROGRAM = {"kind": "program", "contractions": [{"segment": 2, "start_s": 0.0, "stop_s": 0.8}]}
WORMS = {
    "riddle2023-rods": ("rods with rigid crossings", "#c2410c", "--"),
    "riddle2023-fast": ("rods with soft crossings", "0.45", ":"),
}
REST_RING_M, REST_SEGMENT_M, N_PER_PLANE = 0.960, 0.0748, 6


def segment_length(ring_m: np.ndarray, side_m: float, n_per_plane: int) -> np.ndarray:
    """Length of a segment of the rigid tube, m, in closed form: with the width w of a rhombus, l^2 + w^2 = 4 s^2."""
    width_m = ring_m / (n_per_plane * np.cos(np.pi / (2 * n_per_plane)))
    return np.sqrt((2.0 * side_m) ** 2 - width_m**2)


def main(picture: Path) -> None:
    """Draws both worms' contractions beside the closed form."""
    width = REST_RING_M / (N_PER_PLANE * np.cos(np.pi / (2 * N_PER_PLANE)))
    side = np.hypot(REST_SEGMENT_M, width) / 2
    ring = np.linspace(0.3, REST_RING_M, 100)
    with canvas(3.6) as figure, TemporaryDirectory() as folder:
        axes = figure.subplots()
        rigid = segment_length(ring, side, N_PER_PLANE)
        axes.plot(100 * ring, 100 * rigid, color="#1b2a6b", label="rigid tube, closed form")
        for preset, (label, color, line) in WORMS.items():
            changes = {"controller": PROGRAM, "duration_s": 0.8, "record.signals_interval_s": 0.01}
            data = simulate(load_config(preset, changes), Path(folder) / preset).data
            lengths = data["ring_length"][:, 1], data["stretch_length"][:, 1].mean("sensor")
            axes.plot(*(100 * length.values for length in lengths), line, color=color, label=label)
        axes.plot(100 * REST_RING_M, 100 * REST_SEGMENT_M, "o", color="k", label="at rest")
        axes.set_xlabel("length of the ring (cm)")
        axes.set_ylabel("length of the segment (cm)")
        axes.legend()
        print(save(figure, picture))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "rigid_tube.png"))

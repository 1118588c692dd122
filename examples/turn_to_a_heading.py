"""Turning to a heading: the worm is told a direction, and its descending neurons bring it there.

    python examples/turn_to_a_heading.py [heading in degrees] [folder]

Positive headings are to the worm's left. Takes about half a minute.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from annelid import load_config, simulate
from annelid.analysis.track import track_of
from annelid.draw.figures.track import track_figure


def main(folder: Path, heading_deg: float = 30.0, duration_s: float = 20.0) -> None:
    """Runs the worm, prints its heading every two seconds and draws its track."""
    config = load_config("riddle2025-steered", {"turning.heading_deg": heading_deg, "duration_s": duration_s})
    run = simulate(config, folder)
    track = track_of(run)
    turned_deg = np.degrees(track.heading_rad - track.heading_rad[0])
    for time_s in np.arange(0.0, duration_s + 0.01, 2.0):
        print(f"{time_s:4.0f} s: {np.interp(time_s, track.time_s, turned_deg):6.1f} degrees")
    print(track_figure(run, folder / "track.png"))


if __name__ == "__main__":
    wanted = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[2] if len(sys.argv) > 2 else temporary), wanted)

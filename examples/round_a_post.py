"""Steering by a nervous system: a worm with half-rings goes round a post and is seen from above.

    python examples/round_a_post.py [folder]

Two descending neurons scale the left and the right half of every ring, so that the foremost ring comes within 30 cm of
one waypoint after another. Writes run.nc and track.png. Takes about half a minute.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from annelid import gait, load_config, simulate
from annelid.draw.figures.track import track_figure

COURSE = {
    "arena.posts": [[-2.2, 0.0, 0.15]],
    "turning": {"kind": "course", "waypoints": [[-2.0, -0.7], [-4.4, 0.0]], "shares": [1, 1, -1, -1, 1, 1]},
}


def main(folder: Path, duration_s: float = 42.0) -> None:
    """Simulates the course, draws the track and tells how fast it went."""
    config = load_config("riddle2025-steered", COURSE | {"duration_s": duration_s})
    run = simulate(config, folder)
    print(track_figure(run, folder / "track.png"))
    speed = gait(run).speed_m_per_s
    front = run.data["center_of_mass"].values[-1]
    print(f"after {duration_s:g} s at x = {front[0]:.2f} m, y = {front[1]:.2f} m", end="")
    print(f", {100 * speed:.1f} cm/s" if speed is not None else "")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with TemporaryDirectory() as temporary:
            main(Path(temporary))

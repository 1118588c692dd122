"""A pipe of your own: an S of two curves with a waist, and how far two gaits get in it.

    python examples/pipe_of_your_own.py [folder]

The arena is a table of a configuration: any field of docs/arenas.md can be set. Takes a minute or two.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from annelid import load_config, simulate
from annelid.analysis.pipe_passage import passage_of
from annelid.draw.figures.track import track_figure

PIPE = """
[arena]
kind = "pipe"
course = "s"
turn_deg = 40.0
radius_m = 0.7
bore_m = 0.18
profile = "hourglass"
narrowest_m = 0.145
profile_start_m = 0.3
profile_length_m = 0.6
contact_time_constant_s = 0.01
"""


def main(folder: Path, duration_s: float = 12.0) -> None:
    """Writes the pipe, sends two worms through it and draws their tracks."""
    arena = folder / "drain.toml"
    arena.write_text(PIPE, encoding="utf-8")
    for preset in ("crawler", "riddle2025-adaptive"):
        config = load_config(preset, {"duration_s": duration_s}, arena=str(arena))
        run = simulate(config, folder / preset)
        way = passage_of(run)
        print(f"{preset}: {100 * (way.front_m[-1] - way.front_m[0]):.0f} cm in {duration_s:g} s", end="")
        print(f", front where the bore is {100 * way.bore_m[-1, 0]:.1f} cm, {'through' if way.passed else 'inside'}")
        print(track_figure(run, folder / f"{preset}.png"))


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else temporary))

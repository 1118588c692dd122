"""A figure and an export format of your own: forces over time, and a plain text of the numbers.

    python examples/extend/own_outputs.py [folder]

In an installed package, `annelid draw RUN --figure forces` finds the figure by an entry point `annelid.kinds`, and
`annelid export RUN --to txt` the format by one of `annelid.formats`. Takes a few seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib.figure import Figure

import annelid
from annelid.draw.figures import RUN_FIGURES
from annelid.draw.render import Progress
from annelid.export import FORMATS, Format


def forces(run: annelid.Run, path: Path) -> Path:
    """Draws the tension of every ring over time."""
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    axes = figure.subplots()
    axes.plot(run.data["time"], run.data["muscle_force"])
    axes.set_xlabel("time (s)")
    axes.set_ylabel("force (N)")
    figure.savefig(path)
    return path


def text(run: annelid.Run, path: Path, progress: Progress) -> list[Path]:
    """Writes the final length of every ring, one a line."""
    path.write_text("\n".join(f"{length:.6f}" for length in run.data["ring_length"].values[-1]) + "\n")
    return [path]


RUN_FIGURES.add("forces", forces)
FORMATS.add("txt", Format("txt", "rings.txt", ".txt", frozenset(), text))

if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else temporary)
        run = annelid.simulate(annelid.load_config("riddle2023-fast", {"duration_s": 0.2}), folder / "run")
        print(RUN_FIGURES.find("forces")(run, folder / "forces.png"))
        print(*FORMATS.find("txt").write(run, folder / "rings.txt", lambda done, total: None))

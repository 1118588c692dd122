"""What finer or graded elements change of the rods with rigid crossings.

    python benchmarks/finer_meshes.py points 36 52      points of the sample of `annelid robustness --segments 3`
    python benchmarks/finer_meshes.py graded 0.75 1.3   outer elements so many times as long as the inner one

Points are walked by the paper's controller with the tolerance that the body needs, at their own mesh and step and with
six elements at 2 ms, a minute or two each. Of graded meshes, three elements a side, the elongation in 8 s at steps of
5 ms is printed.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np

from annelid import Run, load_config, open_run, simulate, summary
from annelid.analysis import lengthening_score, rhythm_score
from annelid.config import RunConfig
from annelid.errors import SimulationStopped
from annelid.morphology import Array
from annelid_studies.robustness import SETTLING_S, judge, points

FINE = {"body.mesh.elements_per_side": 6, "clock.physics_timestep_s": 0.002}


def run(config: RunConfig) -> tuple[Run, str]:
    """Runs, and returns the run with the sentence of the guard that stopped it, if one did."""
    with TemporaryDirectory() as folder:
        try:
            return simulate(config, folder, progress=False), ""
        except SimulationStopped as stop:
            return open_run(folder), str(stop)


def compare(number: int) -> None:
    """Prints how a point of the sample goes by its own mesh and step, and by finer ones."""
    point = replace(points()[number], n_segments=3)
    for name, changes in (("own", {}), ("fine", FINE)):
        done, stop = run(point.case("sns-tolerance").but(changes).config)
        scores = rhythm_score(done, SETTLING_S), lengthening_score(done, SETTLING_S)
        found = judge(number, point, "sns-tolerance", *scores, stop)
        print(f"{number} {name}: in time {found.in_time}, {found.period_s} s, {found.reason}")
        print(f"  segments lengthened in order: {found.lengthened}")


def spaced(
    plane_x: Array,
    overhang: float,
    half: int,
    radius: float,
    rate: float,
    offset: float,
    n: int,
    ends: int,
    ratio: float,
) -> Array:
    """Samples strands as `annelid.morphology` does, but the outer elements ``ratio`` times as long as the inner."""
    share = np.array([ratio, *[1.0] * (n - 2), ratio])
    places = np.concatenate([[0.0], np.cumsum(share)[:-1]]) / share.sum()
    front = np.linspace(0.0, plane_x[0], ends, endpoint=False)
    inner = (plane_x[:-1, None] + np.diff(plane_x)[:, None] * places).ravel()
    x = np.concatenate([front, inner, np.linspace(plane_x[-1], plane_x[-1] + overhang, ends + 1)])
    phase = (2 * np.pi / half) * np.arange(half)[:, None]
    angle = np.concatenate([rate * x + phase, offset - rate * x - phase])
    return np.stack([np.broadcast_to(x, angle.shape), radius * np.cos(angle), radius + radius * np.sin(angle)], axis=-1)


def graded(ratio: float) -> None:
    """Prints how far the segments of a graded mesh elongate."""
    with patch("annelid.morphology._strands", partial(spaced, ratio=ratio)):
        done, _ = run(load_config("riddle2023-rods", {"clock.physics_timestep_s": 0.005, "duration_s": 8.0}))
    lengths = [f"{100 * (each or np.nan):.2f}" for each in summary(done).elongation_mean_max_m or ()]
    print(f"outer elements {ratio:g} times the inner: {' / '.join(lengths)} cm")


if __name__ == "__main__":
    kind, *values = sys.argv[1:] or ["graded", "1"]
    for value in values:
        compare(int(value)) if kind == "points" else graded(float(value))

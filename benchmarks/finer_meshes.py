"""What finer or graded elements change of the rods with rigid crossings.

    python benchmarks/finer_meshes.py points 36 52      points of the sample of `annelid robustness --segments 3`
    python benchmarks/finer_meshes.py graded 0.75 1.3   outer elements so many times as long as the inner one
    python benchmarks/finer_meshes.py arcs 2 3          so many elements as chords, and together as long as their arc

Points are walked by the paper's controller with the tolerance that the body needs, at their own mesh and step and with
six elements at 2 ms, a minute or two each. Of graded meshes, three elements a side, the elongation in 8 s at steps of
5 ms is printed; of arcs the same at 20 ms.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from scipy.optimize import brentq

from annelid import Run, load_config, open_run, simulate, summary
from annelid.analysis import lengthening_score, rhythm_score
from annelid.config import RunConfig
from annelid.errors import SimulationStopped
from annelid.morphology import MeshGeometry, helical_mesh, norm
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


def reshaped(geometry: MeshGeometry, ratio: float, outwards: float) -> MeshGeometry:
    """Returns a mesh of one radius whose vertices between crossings lie elsewhere on their strands.

    Args:
        geometry: The mesh.
        ratio: The outer elements of a side are so many times as long as its inner ones.
        outwards: At 1 a side's elements are together as long as the arc that they stand for, at 0 they are its chords.
    """
    crossing = geometry.crossing_vertex
    n, rate, radius = int(np.diff(crossing)[0]), geometry.angular_rate_rad_per_m, geometry.radius_m
    share = np.array([ratio, *[1.0] * (n - 2), ratio]) if n > 1 else np.ones(1)
    places = np.cumsum(share)[:-1] / share.sum()
    spacing = float(np.diff(geometry.plane_x_m)[0])
    at = np.array([0.0, *places, 1.0]) * spacing

    def excess(factor: float) -> float:
        radii = radius * np.array([1.0, *[factor] * (n - 1), 1.0])
        points = np.stack([at, radii * np.cos(rate * at), radii * np.sin(rate * at)], axis=-1)
        return float(norm(np.diff(points, axis=0)).sum()) - np.hypot(1.0, radius * rate) * spacing

    factor = 1.0 + outwards * (brentq(excess, 0.99, 1.1) - 1.0) if outwards else 1.0
    vertices = geometry.vertices_m.copy()
    turning = np.where(np.arange(geometry.n_strands) < geometry.n_per_plane, rate, -rate)
    for first in crossing[:-1]:
        for k, place in enumerate(places, 1):
            start = geometry.vertices_m[:, first]
            turn = np.exp(1j * turning * place * spacing) * (start[:, 1] + 1j * (start[:, 2] - radius)) * factor
            vertices[:, first + k] = np.stack([start[:, 0] + place * spacing, turn.real, radius + turn.imag], axis=-1)
    return replace(geometry, vertices_m=vertices)


def shaped(n_elements: int, step_s: float, ratio: float = 1.0, outwards: float = 0.0) -> None:
    """Prints how far the segments of such a mesh elongate."""
    mesh = {"body.mesh.elements_per_side": n_elements, "body.formulation.curvature": "constant"}
    changes = {**mesh, "clock.physics_timestep_s": step_s, "duration_s": 8.0}
    with patch("annelid.body.assemble.helical_mesh", lambda *a, **k: reshaped(helical_mesh(*a, **k), ratio, outwards)):
        done, _ = run(load_config("riddle2023-rods", changes))
    lengths = [f"{100 * (each or np.nan):.2f}" for each in summary(done).elongation_mean_max_m or ()]
    print(f"{n_elements} elements, {ratio:g}, {outwards:g}: {' / '.join(lengths)} cm")


if __name__ == "__main__":
    kind, *values = sys.argv[1:] or ["graded", "1"]
    for value in values:
        if kind == "points":
            compare(int(value))
        elif kind == "graded":
            shaped(3, 0.005, ratio=float(value))
        else:
            shaped(int(value), 0.02)
            shaped(int(value), 0.02, outwards=1.0)

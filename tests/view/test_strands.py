from __future__ import annotations

import mujoco
import numpy as np
import pytest

from annelid.body.worm import worm_of
from annelid.config import load_config
from annelid.draw.drawn_worm import DrawnWorm
from annelid.draw.strands import POINTS_PER_SIDE, strand_curves
from annelid.morphology import helical_mesh


@pytest.mark.parametrize("n", [2, 3, 6])
def test_a_rod_that_is_bent_at_its_crossings_is_drawn_as_the_beam_that_it_stands_for(n: int) -> None:
    mesh = helical_mesh(3, elements_per_side=n, elements_per_end=n)
    n_crossings, side, fine = len(mesh.crossing_vertex), 0.1, 60
    # Linear from crossing to crossing and none at the free ends: what forces at crossings do.
    knots = np.arange(n_crossings + 2)
    moments = np.random.default_rng(7).normal(size=len(knots)) * 0.05
    moments[[0, 1, -2, -1]] = 0.0
    place = np.linspace(0.0, knots[-1], (len(knots) - 1) * n * fine + 1)
    curvature = np.interp(place, knots, moments)
    slope = np.concatenate([[0.0], np.cumsum(curvature[1:] + curvature[:-1]) / 2]) * place[1]
    beam = side * np.concatenate([[0.0], np.cumsum(slope[1:] + slope[:-1]) / 2]) * place[1]
    # The rod of n elements a side whose vertices are as stiff as `net_stiffness` says.
    stiffness = np.full(n * (len(knots) - 1) + 1, 1.0 - 1.0 / n**2)
    stiffness[::n] = 1.0 + 1.0 / n
    bends = curvature[::fine] / n / stiffness
    rod = side / n * np.concatenate([[0.0], np.cumsum(np.cumsum(bends[:-1]))])
    assert np.abs(rod[n:-n:n] - beam[n * fine : -n * fine : n * fine]).max() < 1e-3 * np.abs(beam).max()
    vertices = np.zeros_like(mesh.vertices_m)
    vertices[..., 0], vertices[..., 2] = side * np.arange(len(rod)) / n, rod
    drawn = strand_curves(vertices, mesh)[0][0]
    wanted = np.interp(drawn[:, 0], side * place, beam)
    assert np.abs(drawn[:, 2] - wanted).max() < 2e-3 * np.abs(beam).max()


@pytest.mark.parametrize("preset", ["riddle2023", "riddle2023-rods"])
def test_tubes_of_a_worm_at_rest_follow_its_helices(preset: str) -> None:
    config = load_config(preset)
    body = worm_of(config)
    mesh = body.geometry()
    worm = DrawnWorm(config)
    worm.pose(worm.model.qpos0)
    scene = mujoco.MjvScene(worm.model, maxgeom=1000)
    worm.complete(scene)
    points = np.reshape(scene.skinvert, (mesh.n_strands, -1, 8, 3)).mean(axis=2)[:, 1:-1]
    assert points.shape[1] == POINTS_PER_SIDE * (len(mesh.crossing_vertex) + 1) + 1
    from_axis = np.hypot(points[..., 1], points[..., 2] - mesh.radius_m)
    np.testing.assert_allclose(from_axis, mesh.radius_m, rtol=2e-3)
    skin = np.reshape(scene.skinvert, (mesh.n_strands, -1, 8, 3))[:, 1:-1] - points[:, :, None]
    np.testing.assert_allclose(np.linalg.norm(skin, axis=-1), body.strands.radius_m, rtol=1e-4)

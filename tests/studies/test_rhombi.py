from __future__ import annotations

import numpy as np
import pytest

from annelid.morphology import MeshGeometry, helical_mesh
from annelid_studies.riddle2023.figures.rhombi import (
    actuated,
    deformation,
    distance_from_ring_m,
    plane_means,
    rhombus_diagonals,
    rhombus_plane,
)


@pytest.fixture(params=[{}, {"n_segments": 4, "n_helices": 8, "radius_m": 0.1, "planes_between_rings": 3}])
def mesh(request: pytest.FixtureRequest) -> MeshGeometry:
    return helical_mesh(**({"n_segments": 3} | request.param))


def test_rhombi_at_rest_are_all_alike(mesh: MeshGeometry) -> None:
    axial, lateral = rhombus_diagonals(mesh.crossings_m, mesh.rhombi)
    # Over two planes, and between neighbours on a circle.
    np.testing.assert_allclose(axial, 2 * (mesh.plane_x_m[1] - mesh.plane_x_m[0]))
    np.testing.assert_allclose(lateral, 2 * mesh.radius_m * np.sin(np.pi / mesh.n_per_plane))
    at_rest = deformation(mesh.crossings_m, mesh)
    np.testing.assert_allclose(at_rest.axial, 0.0, atol=1e-12)
    np.testing.assert_allclose(at_rest.lateral, 0.0, atol=1e-12)


def test_a_stretch_and_a_squeeze_change_one_diagonal_each(mesh: MeshGeometry) -> None:
    stretched = deformation(mesh.crossings_m * [1.3, 1.0, 1.0], mesh)
    np.testing.assert_allclose(stretched.axial, 0.3)
    np.testing.assert_allclose(stretched.lateral, 0.0, atol=1e-12)
    squeezed = deformation(mesh.crossings_m * [1.0, 0.5, 0.5], mesh)
    np.testing.assert_allclose(squeezed.axial, 0.0, atol=1e-12)
    np.testing.assert_allclose(squeezed.lateral, -0.5)


def test_a_turn_and_a_shift_deform_nothing(mesh: MeshGeometry) -> None:
    c, s = np.cos(0.4), np.sin(0.4)
    moved = mesh.crossings_m @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]) + [0.3, -0.2, 0.1]
    change = deformation(moved, mesh)
    np.testing.assert_allclose([change.axial, change.lateral], 0.0, atol=1e-12)


def pinched(mesh: MeshGeometry, segment: int, depth: float, reach_m: float) -> np.ndarray:
    """A mesh whose radius shrinks by a share around one ring, less and less with distance."""
    away = mesh.plane_x_m - mesh.plane_x_m[mesh.ring_planes[segment]]
    share = 1.0 - depth * np.exp(-((away / reach_m) ** 2))
    axis = np.array([0.0, 0.0, mesh.radius_m])
    scale = np.ones((mesh.n_crossings, 3))
    scale[:, 1:] = share[mesh.crossing_plane, None]
    return axis + (mesh.crossings_m - axis) * scale


def test_deformation_decays_with_distance_from_the_contracted_ring(mesh: MeshGeometry) -> None:
    segment, depth, reach_m = 1, 0.6, 0.1
    change = deformation(pinched(mesh, segment, depth, reach_m), mesh)
    distance = plane_means(distance_from_ring_m(mesh, segment), mesh)
    means = plane_means(change.lateral, mesh)
    np.testing.assert_allclose(means, -depth * np.exp(-((distance / reach_m) ** 2)), atol=1e-12)
    order = np.argsort(np.abs(distance))
    assert distance[order[0]] == 0.0
    assert np.all(np.diff(np.abs(means[order])) <= 1e-12)


def test_actuated_rhombi_are_those_that_a_ring_runs_across(mesh: MeshGeometry) -> None:
    on_ring = {crossing for ring in mesh.rings.tolist() for crossing in ring}
    expected = [int(left) in on_ring and int(right) in on_ring for _, left, _, right in mesh.rhombi]
    assert actuated(mesh).tolist() == expected
    assert actuated(mesh).sum() == mesh.rings.size
    for segment in range(mesh.n_segments):
        own = rhombus_plane(mesh) == mesh.ring_planes[segment]
        np.testing.assert_array_equal(distance_from_ring_m(mesh, segment)[own], 0.0)

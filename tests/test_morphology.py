"""Properties of the helical mesh, for any worm, and the dimensions of the two published ones."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.morphology import MeshGeometry, helical_mesh


@st.composite
def meshes(draw: st.DrawFn) -> MeshGeometry:
    return helical_mesh(
        draw(st.integers(3, 60)),
        n_helices=draw(st.sampled_from([6, 8, 10, 12, 14, 24])),
        radius_m=draw(st.floats(0.01, 1.0)),
        angular_rate_rad_per_m=draw(st.floats(1.0, 60.0)),
        elements_per_side=draw(st.integers(1, 6)),
        elements_per_end=draw(st.none() | st.integers(1, 6)),
        planes_between_rings=draw(st.integers(2, 6)),
        free_planes_at_ends=draw(st.integers(1, 4)),
    )


def vertex_of(mesh: MeshGeometry, which: int) -> np.ndarray:
    """Position of every crossing as the vertex of its clockwise (0) or counter-clockwise (1) strand."""
    return mesh.vertices_m[mesh.crossing_strands[:, which], mesh.crossing_vertex[mesh.crossing_plane]]


@settings(max_examples=60)
@given(meshes())
def test_every_crossing_lies_on_both_of_its_strands(mesh: MeshGeometry) -> None:
    size = mesh.radius_m + mesh.length_m
    assert np.abs(vertex_of(mesh, 0) - vertex_of(mesh, 1)).max() < 1e-11 * size
    assert np.allclose(vertex_of(mesh, 0), mesh.crossings_m, atol=1e-11 * size)


@settings(max_examples=60)
@given(meshes())
def test_all_meetings_of_strands_are_crossings(mesh: MeshGeometry) -> None:
    """Brute force: along each pair of strands the angle between them vanishes just at their crossings."""
    half = mesh.n_per_plane
    x = mesh.vertices_m[0, :, 0]
    angle = np.arctan2(mesh.vertices_m[..., 2] - mesh.radius_m, mesh.vertices_m[..., 1])
    for clockwise in range(0, half, 2):
        for counter in range(half, 2 * half, 3):
            apart = np.angle(np.exp(1j * (angle[clockwise] - angle[counter])))
            met = set(np.flatnonzero(np.abs(apart) < 1e-9).tolist())
            rows = np.all(mesh.crossing_strands == [clockwise, counter], axis=1)
            assert met == set(mesh.crossing_vertex[mesh.crossing_plane[rows]].tolist())
    assert np.all(np.diff(x) > 0)


@settings(max_examples=60)
@given(meshes())
def test_handedness_is_balanced_and_all_lie_on_the_cylinder(mesh: MeshGeometry) -> None:
    centred = mesh.vertices_m - [0, 0, mesh.radius_m]
    assert np.allclose(np.hypot(centred[..., 1], centred[..., 2]), mesh.radius_m)
    here, next_ = centred[:, :-1], centred[:, 1:]
    turned = here[..., 1] * next_[..., 2] - here[..., 2] * next_[..., 1]
    assert np.all(turned[: mesh.n_per_plane] > 0)
    assert np.all(turned[mesh.n_per_plane :] < 0)
    for pair in (0, 1):
        _, count = np.unique(mesh.crossing_strands[:, pair], return_counts=True)
        assert set(count) == {len(mesh.plane_x_m)}


@settings(max_examples=60)
@given(meshes())
def test_rings_close_round_the_body(mesh: MeshGeometry) -> None:
    corners = mesh.crossings_m[mesh.rings] - [0, 0, mesh.radius_m]
    assert np.ptp(corners[..., 0], axis=1).max() < 1e-12 * mesh.length_m + 1e-15
    angle = np.unwrap(np.arctan2(corners[..., 2], corners[..., 1]), axis=1)
    steps = np.diff(np.concatenate([angle, angle[:, :1] + 2 * pi], axis=1), axis=1)
    assert np.allclose(steps, 2 * pi / mesh.n_per_plane)
    assert np.allclose(mesh.ring_length_m, 2 * mesh.n_per_plane * mesh.radius_m * np.sin(pi / mesh.n_per_plane))


@settings(max_examples=60)
@given(meshes())
def test_springs_are_axial_and_sensor_springs_span_their_ring(mesh: MeshGeometry) -> None:
    ends = mesh.crossings_m[mesh.springs]
    assert np.abs(ends[:, 1, 1:] - ends[:, 0, 1:]).max() < 1e-11 * (mesh.radius_m + mesh.length_m)
    spacing = 2 * pi / (mesh.n_strands * mesh.angular_rate_rad_per_m)
    assert np.allclose(mesh.spring_length_m, 2 * spacing)
    assert len({tuple(pair) for pair in mesh.springs.tolist()}) == len(mesh.springs)
    planes = mesh.crossing_plane[mesh.springs[mesh.sensor_springs]]
    assert np.all(planes[..., 0] == mesh.ring_planes[:, None] - 1)
    assert np.all(planes[..., 1] == mesh.ring_planes[:, None] + 1)
    first_helix = mesh.springs[mesh.sensor_springs[:, 0], 0]
    assert np.all(mesh.crossing_strands[first_helix, 0] == 0)


@settings(max_examples=60)
@given(meshes())
def test_rhombi_have_four_equal_sides_along_strands(mesh: MeshGeometry) -> None:
    corners = mesh.crossings_m[mesh.rhombi]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    assert np.allclose(sides, sides[0, 0])
    front, left, rear, right = corners.swapaxes(0, 1)
    assert np.all((front[:, 0] < left[:, 0]) & (left[:, 0] < rear[:, 0]))
    across = np.cross(left - right, rear - front)
    outward = (front + rear) / 2 - [0, 0, mesh.radius_m]
    outward[:, 0] = 0
    assert len(set(np.sign(np.einsum("ij,ij->i", across, outward)))) == 1, "left and right are never exchanged"
    for corner in range(4):
        pair = mesh.crossing_strands[mesh.rhombi[:, [corner, (corner + 1) % 4]]]
        assert np.all((pair[:, 0] == pair[:, 1]).sum(axis=1) == 1), "neighbours share one strand"


def test_the_paper_s_robot() -> None:
    mesh = helical_mesh(3, rear_overhang_m=0.0177013)
    assert mesh.length_m == pytest.approx(0.56, abs=1e-5)
    assert (len(mesh.plane_x_m), mesh.n_crossings, len(mesh.springs)) == (15, 90, 42)
    assert mesh.ring_planes.tolist() == [3, 7, 11]
    assert np.diff(mesh.plane_x_m) == pytest.approx(0.0374, abs=1e-4)
    assert mesh.ring_length_m == pytest.approx(0.960)
    assert mesh.spring_length_m == pytest.approx(0.0748, abs=1e-5)
    front, side = mesh.crossings_m[mesh.rhombi[0, :2]]
    assert np.linalg.norm(front - side) == pytest.approx(0.0909, abs=1e-4)


def test_free_ends_and_sides_have_the_asked_number_of_elements() -> None:
    mesh = helical_mesh(3, elements_per_side=4, elements_per_end=2)
    assert mesh.crossing_vertex.tolist() == list(range(2, 2 + 4 * 15, 4))
    assert mesh.vertices_m.shape[1] == 2 + 4 * 14 + 2 + 1


def test_strands_follow_the_published_curves() -> None:
    """Clockwise (x, R + R cos(14x + p), ..) and counter-clockwise (x, R sin, R cos), each with six phases."""
    mesh = helical_mesh(3)
    x = mesh.vertices_m[0, :, 0]
    phases = np.radians(np.arange(0, 360, 60))[:, None]
    clockwise = np.stack([0.16 * np.cos(14 * x + phases), 0.16 + 0.16 * np.sin(14 * x + phases)], axis=-1)
    counter = np.stack([0.16 * np.sin(14 * x + phases), 0.16 + 0.16 * np.cos(14 * x + phases)], axis=-1)
    for published, ours in ((clockwise, mesh.vertices_m[:6, :, 1:]), (counter, mesh.vertices_m[6:, :, 1:])):
        for curve in published:
            assert np.abs(ours - curve).max(axis=(1, 2)).min() < 1e-12

"""The rigid-sided tube: every side has its length, and the closed form is that of the mesh at rest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.morphology import helical_mesh
from annelid_studies.planar.huang import segment_length

SIDE = 0.09


def tube(radii: list[float], side: float, n: int) -> np.ndarray:
    """Crossings of a tube whose planes may differ in their radii, ``(n_planes, n, 3)``, the first plane at x = 0."""
    radius = np.array(radii)
    across = radius[:-1] ** 2 + radius[1:] ** 2 - 2.0 * radius[:-1] * radius[1:] * np.cos(np.pi / n)
    x = np.concatenate([[0.0], np.cumsum(np.sqrt(side**2 - across))])
    angle = np.pi / n * (np.arange(len(radius))[:, None] % 2 + 2 * np.arange(n))
    y, z = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    return np.stack([np.broadcast_to(x[:, None], angle.shape), y, z], axis=-1)


@given(n=st.integers(3, 24), radius=st.floats(0.02, 0.12))
def test_a_uniform_tube_has_the_closed_form(n: int, radius: float) -> None:
    side = 2 * radius * np.sin(np.pi / (2 * n)) + 0.01
    crossings = tube([radius] * 3, side, n)
    ring = np.linalg.norm(np.roll(crossings[1], 1, axis=0) - crossings[1], axis=1).sum()
    length = crossings[2, 0, 0] - crossings[0, 0, 0]
    assert segment_length(ring, side, n) == pytest.approx(length, rel=1e-9)


@pytest.mark.parametrize(("n_helices", "radius_m", "rate"), [(6, 0.16, 14.0), (12, 0.16, 14.0), (24, 0.1, 9.0)])
def test_the_mesh_at_rest_lies_on_the_closed_form(n_helices: int, radius_m: float, rate: float) -> None:
    mesh = helical_mesh(3, n_helices=n_helices, radius_m=radius_m, angular_rate_rad_per_m=rate)
    front, left, _, right = mesh.crossings_m[mesh.rhombi[0]]
    side = float(np.linalg.norm(left - front))
    assert np.linalg.norm(right - front) == pytest.approx(side, rel=1e-12)
    predicted = segment_length(mesh.ring_length_m, side, mesh.n_per_plane)
    assert predicted == pytest.approx(np.full(3, mesh.spring_length_m[0]), rel=1e-9)


def test_the_planar_rhombus_is_the_limit_of_a_width_per_rhombus() -> None:
    width = 0.08
    assert segment_length(1000 * width, SIDE, 1000) ** 2 + width**2 == pytest.approx(4 * SIDE**2, rel=1e-5)


def test_sides_that_are_too_short_are_refused() -> None:
    with pytest.raises(ValueError, match="ring_length_m = 9"):
        segment_length(9.0, SIDE, 6)

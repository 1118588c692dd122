"""The mechanics of the dynamic planar worms: rigid links, and forces that are the energies' derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid_studies.planar.boxerbaum2012 import Boxerbaum2012Body, boxerbaum_linkage
from annelid_studies.planar.daltorio2013 import Daltorio2013Body, daltorio_linkage
from annelid_studies.planar.linkage import Linkage

WORMS = {
    "daltorio2013": daltorio_linkage(Daltorio2013Body(n_segments=4)),
    "boxerbaum2012": boxerbaum_linkage(Boxerbaum2012Body(n_segments=4)),
}
BOTH = pytest.mark.parametrize("worm", WORMS.values(), ids=WORMS.keys())


def posture_of(worm: Linkage, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q = 0.1 * worm.straight * (1 + 0.15 * rng.uniform(-1, 1, worm.n_coordinates))
    q[0] = rng.normal()
    return q, 0.3 * rng.normal(size=worm.n_coordinates)


def gradient(function, q: np.ndarray, step: float = 1e-6) -> np.ndarray:
    return np.array([(function(q + step * e) - function(q - step * e)) / (2 * step) for e in np.eye(len(q))])


@given(seed=st.integers(0, 10**6))
@BOTH
def test_links_are_rigid_and_joints_on_the_axis(worm: Linkage, seed: int) -> None:
    q, _ = posture_of(worm, seed)
    outline = worm.places(worm.posture(q))[worm.outline]
    lengths = np.linalg.norm(np.diff(outline, axis=0), axis=1)
    assert lengths == pytest.approx(np.full(len(lengths), worm.link_length_m[0]), rel=1e-12)
    joints = outline[:: (len(outline) - 1) // worm.n_segments]
    assert joints[:, 1] == pytest.approx(0.0, abs=1e-15)
    assert np.diff(joints[:, 0]) == pytest.approx(worm.lengths(worm.posture(q)), rel=1e-12)


@given(seed=st.integers(0, 10**6))
def test_daltorio_s_rhombi_obey_the_paper_s_relation(seed: int) -> None:
    worm = WORMS["daltorio2013"]
    q, _ = posture_of(worm, seed)
    squares = worm.lengths(worm.posture(q)) ** 2 + worm.heights(q) ** 2
    assert squares == pytest.approx(4 * 0.073**2, rel=1e-12)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=5, derandomize=True)
@BOTH
def test_velocities_and_kinetic_energy_are_those_of_the_lumps(worm: Linkage, seed: int) -> None:
    q, velocity = posture_of(worm, seed)
    moved = (worm.places(worm.posture(q + 1e-6 * velocity)) - worm.places(worm.posture(q - 1e-6 * velocity))) / 2e-6
    kinetic = 0.5 * worm.lump_mass_kg @ (moved**2).sum(axis=1)
    assert velocity @ worm.posture(q).mass @ velocity / 2 == pytest.approx(kinetic, rel=1e-7)


@given(seed=st.integers(0, 10**6))
@settings(max_examples=5, derandomize=True)
@BOTH
def test_forces_are_the_derivatives_of_the_energies(worm: Linkage, seed: int) -> None:
    q, velocity = posture_of(worm, seed)
    posture = worm.posture(q)
    walls = np.zeros_like(q)
    walls[1 : 1 + worm.n_segments] = worm.wall_force(q)
    elastic = gradient(lambda x: worm.elastic_energy(worm.posture(x)), q)
    assert walls - worm.spring_force(posture) == pytest.approx(elastic, rel=1e-5, abs=1e-6)
    kinetic = gradient(lambda x: 0.5 * velocity @ worm.posture(x).mass @ velocity, q)
    assert worm.kinetic_force(posture, velocity) == pytest.approx(kinetic, rel=1e-5, abs=1e-7)
    stiffness = gradient(lambda x: -worm.spring_force(worm.posture(x)), q)
    assert worm.spring_stiffness(posture) == pytest.approx(stiffness, rel=1e-4, abs=1e-3)


@given(before=st.floats(0.09, 0.11), after=st.floats(0.09, 0.11))
def test_the_mean_force_of_the_wall_does_the_work_that_it_stores(before: float, after: float) -> None:
    worm = WORMS["daltorio2013"]
    start, end = before * worm.straight, after * worm.straight
    mean, _ = worm.mean_wall_force(start, end)
    stored = (worm.wall_force(end) ** 2 - worm.wall_force(start) ** 2) / worm.wall_stiffness_N_per_m
    assert mean * (after - before) == pytest.approx(stored, abs=1e-12)


@given(height=st.floats(0.06, 0.12))
@BOTH
def test_the_straight_worm_is_straight(worm: Linkage, height: float) -> None:
    posture = worm.posture(height * worm.straight)
    assert worm.heights(posture.q) == pytest.approx(np.full(4, height))
    assert worm.hinges @ worm.slopes(posture) == pytest.approx(np.zeros(len(worm.hinges)), abs=1e-12)
    assert worm.lengths(posture) == pytest.approx(np.full(4, np.sqrt(0.146**2 - height**2)))

"""Coulomb friction: the complementarity conditions hold for any contacts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid_studies.planar import midpoint as friction


def problem(seed: int, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(n, n))
    limit = rng.exponential(size=n) * (rng.random(n) < 0.8)
    return factor @ factor.T + 0.1 * np.eye(n), rng.normal(size=n), limit


def assert_obeys_coulomb(mobility, free_slip, limit, force) -> None:
    slip = free_slip + mobility @ force
    assert np.all(np.abs(force) <= limit * (1 + 1e-9))
    sticks = np.abs(force) < limit * (1 - 1e-9)
    assert slip[sticks] == pytest.approx(0.0, abs=1e-8)
    assert np.all(slip[~sticks] * force[~sticks] <= 1e-8)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 12))
def test_every_contact_sticks_or_slides_against_its_slip(seed: int, n: int) -> None:
    given_ = problem(seed, n)
    assert_obeys_coulomb(*given_, friction.coulomb(*given_))


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 5))
def test_the_two_methods_agree(seed: int, n: int) -> None:
    given_ = problem(seed, n)
    np.testing.assert_allclose(friction._gauss_seidel(*given_), friction.coulomb(*given_), atol=1e-6)


def test_a_block_sticks_up_to_the_limit_and_no_further() -> None:
    mobility, limit = np.array([[0.5]]), np.array([2.0])
    assert friction.coulomb(mobility, np.array([0.9]), limit) == pytest.approx([-1.8])
    assert friction.coulomb(mobility, np.array([-1.5]), limit) == pytest.approx([2.0])

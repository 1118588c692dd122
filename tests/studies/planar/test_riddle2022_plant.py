"""The kinematic planar worm: geometry, actuator, clock and face."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.config import Clock
from annelid.errors import ConfigError
from annelid_studies.planar import Riddle2022Plant
from annelid_studies.planar.riddle2022 import PlanarBody

CLOCK = Clock(control_timestep_s=0.001, physics_timestep_s=0.001)


def plant(clock=CLOCK, **body) -> Riddle2022Plant:
    return Riddle2022Plant(PlanarBody(**body), clock)


@given(st.lists(st.lists(st.floats(0, 1), min_size=4, max_size=4), min_size=1, max_size=60))
def test_sides_stay_rigid_and_heights_within_their_range(activations):
    one = plant(n_segments=4, gain=100.0)
    one.reset(0)
    for activation in activations:
        felt = one.step(np.array(activation))
        height, length = felt.ring_length_m, felt.stretch_m[:, 0]
        np.testing.assert_allclose(height**2 + length**2, (2 * 0.073) ** 2, rtol=1e-12)
        assert np.all((height >= 0.065 - 1e-15) & (height <= 0.11 + 1e-15))
        assert np.all(length >= felt.rest_stretch_m[:, 0] - 1e-12)


@given(activation=st.lists(st.floats(0, 1), min_size=3, max_size=3), gain=st.floats(0.5, 5), steps=st.integers(1, 300))
def test_heights_approach_their_targets_as_the_paper_says(activation, gain, steps):
    one = plant(gain=gain)
    felt = one.reset(0)
    for _ in range(steps):
        felt = one.step(np.array(activation))
    # In the paper's units: cm and ms.
    target = 11.0 - np.array(activation) * (11.0 - 6.5)
    approach = gain * 2 * np.pi * 20 / 60 / 300
    expected = target + (np.array([6.5, 11.0, 11.0]) - target) * (1 - approach) ** steps
    np.testing.assert_allclose(felt.ring_length_m, expected / 100, rtol=1e-10)


def test_starts_with_segment_1_contracted_and_the_others_at_rest():
    felt = plant(n_segments=5).reset(3)
    assert felt.time_s == 0.0
    assert felt.ring_length_m.tolist() == [0.065, 0.11, 0.11, 0.11, 0.11]
    assert felt.stretch_m[0, 0] == pytest.approx(np.sqrt(0.146**2 - 0.065**2))
    assert np.array_equal(felt.stretch_m[1:], felt.rest_stretch_m[1:])
    assert felt.stretch_m.shape == felt.rest_stretch_m.shape == (5, 1)
    assert not felt.contact_force_N.any()
    assert np.isnan(felt.muscle_force_N).all()
    assert np.isnan(felt.center_of_mass_m).all()


def test_finer_physics_takes_several_steps_and_coarser_waits():
    pull = np.full(3, 1.0)
    rate = 1.3 * 2 * np.pi * 20 / 60 / 300 * 1e3

    def gap(felt):
        return (felt.ring_length_m[1] - 0.065) / 0.045

    fine = plant(Clock(control_timestep_s=0.001, physics_timestep_s=0.00025))
    assert gap(fine.step(pull)) == pytest.approx((1 - rate * 0.00025) ** 4)

    coarse = plant(Clock(control_timestep_s=0.001, physics_timestep_s=0.005))
    gaps = []
    for i in range(1, 11):
        felt = coarse.step(pull)
        assert felt.time_s == pytest.approx(i * 0.001)
        gaps.append(gap(felt))
    once, twice = 1 - rate * 0.005, (1 - rate * 0.005) ** 2
    assert gaps == pytest.approx([1, 1, 1, 1, once, once, once, once, once, twice])


def test_restored_plant_continues_bit_for_bit():
    clock = Clock(control_timestep_s=0.001, physics_timestep_s=0.003)
    rng = np.random.default_rng(0)
    drive = rng.random((100, 3))
    one = plant(clock)
    for a in drive[:50]:
        one.step(a)
    state = one.get_state()
    rest = [one.step(a) for a in drive[50:]]
    other = plant(clock)
    other.set_state(state)
    for a, felt in zip(drive[50:], rest, strict=True):
        again = other.step(a)
        assert np.array_equal(again.ring_length_m, felt.ring_length_m)
        assert again.time_s == felt.time_s


def test_a_step_that_would_overshoot_is_refused():
    with pytest.raises(ConfigError, match=r"physics_timestep_s = 0\.2 .* at most 0\.110"):
        plant(Clock(control_timestep_s=0.1, physics_timestep_s=0.2))

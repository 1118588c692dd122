"""Phase oscillators: the published drive response, and locked chains in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from annelid.errors import ConfigError
from annelid_studies.oscillators import PhaseStepper
from annelid_studies.oscillators.phase_chain import amplitude, frequency_Hz


def settle(stepper: PhaseStepper, nu: np.ndarray, size: float, seconds: float) -> np.ndarray:
    """A state under intrinsic frequencies and one amplitude, from random phases on."""
    phase = np.random.default_rng(0).uniform(-0.5, 0.5, (1, len(nu)))
    state = np.stack([phase, np.full(phase.shape, size), np.zeros(phase.shape)])
    for _ in range(round(seconds / stepper.timestep_s)):
        state = stepper.advance(state, nu, size)
    return state


def frequencies(stepper: PhaseStepper, state: np.ndarray, nu: np.ndarray, size: float, seconds: float) -> np.ndarray:
    """Mean frequency of every oscillator from a state on, Hz."""
    before = state[0]
    for _ in range(round(seconds / stepper.timestep_s)):
        state = stepper.advance(state, nu, size)
    return (state[0] - before)[0] / (2 * np.pi * seconds)


def test_frequency_and_amplitude_follow_the_drive_and_saturate_as_published() -> None:
    for drive, hertz, size in (
        (0.999, 0.0, 0.0),
        (1.0, 0.5, 0.261),
        (3.0, 0.9, 0.391),
        (5.0, 1.3, 0.521),
        (5.001, 0.0, 0.0),
    ):
        assert frequency_Hz(drive) == pytest.approx(hertz)
        assert amplitude(drive) == pytest.approx(size)


def test_two_oscillators_lock_up_to_their_coupling_and_no_further() -> None:
    """Locked, ``theta_1 - theta_2 = lag + arcsin(pi (nu_1 - nu_2) / (w R))``."""
    coupling, size = 4.0, 0.8
    edge = coupling * size / np.pi
    stepper = PhaseStepper(2, 0.3, 1e-2, coupling)
    for share in (0.99, 1.01):
        nu = np.array([1.0 + share * edge, 1.0])
        state = settle(stepper, nu, size, 40.0)
        apart = -np.diff(frequencies(stepper, state, nu, size, 40.0))[0]
        if share < 1:
            assert -np.diff(state[0, 0])[0] == pytest.approx(0.3 + np.arcsin(share), abs=1e-3)
            assert abs(apart) < 1e-6
        else:
            # The mean beat of an overdamped pendulum.
            assert apart == pytest.approx(edge * np.sqrt(share**2 - 1), rel=0.1)


@pytest.mark.parametrize("n", [3, 8])
def test_swimming_is_one_travelling_wave_at_the_intrinsic_frequency(n: int) -> None:
    stepper, nu, size = PhaseStepper(n, 2 * np.pi / n, 1e-2), np.full(n, frequency_Hz(4.0)), amplitude(4.0)
    # The slowest of its modes dies at 2 w R (1 - cos(pi / n)): 0.7/s for eight.
    state = settle(stepper, nu, size, 40.0)
    np.testing.assert_allclose(np.angle(np.exp(-1j * np.diff(state[0, 0]))), 2 * np.pi / n, atol=1e-6)
    np.testing.assert_allclose(frequencies(stepper, state, nu, size, 10.0), 1.1, atol=1e-6)


def test_amplitude_settles_by_its_critically_damped_closed_form() -> None:
    """r - R falls as (1 + a t / 2) exp(-a t / 2) after a step of the drive."""
    stepper, before, after = PhaseStepper(3, 2.0, 1e-3), amplitude(1.0), amplitude(5.0)
    state = np.zeros((3, 1, 3))
    state[1] = before
    for step in range(1, 401):
        state = stepper.advance(state, frequency_Hz(5.0), after)
        s = 10.0 * step * 1e-3
        np.testing.assert_allclose(state[1], after + (before - after) * (1 + s) * np.exp(-s), atol=2e-5)


def test_a_step_that_is_too_long_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"time step of 0\.06 s is too long"):
        PhaseStepper(3, 2.0, 0.06)

"""Phase oscillators: the published drive response, locked chains in closed form, and the change of gait."""

from __future__ import annotations

import numpy as np
import pytest

from annelid.errors import ConfigError
from annelid_studies.oscillators import DriveResponse, PhaseNetwork, PhaseState, PhaseStepper, phase_chain
from annelid_studies.oscillators.phase_chain import BODY


def settle(network: PhaseNetwork, drive: float, seconds: float = 20.0, dt: float = 1e-2, seed: int = 0) -> PhaseState:
    stepper = PhaseStepper(network, dt)
    phase = np.random.default_rng(seed).uniform(-0.5, 0.5, (1, len(network.responses)))
    state = stepper.initial_state(drive, phase)
    for _ in range(round(seconds / dt)):
        state = stepper.advance(state, drive)
    return state


def frequencies(network: PhaseNetwork, state: PhaseState, drive: float, seconds: float = 10.0) -> np.ndarray:
    """Mean frequency of every oscillator from a state on, Hz."""
    stepper = PhaseStepper(network, 1e-2)
    before = state.phase_rad
    for _ in range(round(seconds / 1e-2)):
        state = stepper.advance(state, drive)
    return (state.phase_rad - before)[0] / (2 * np.pi * seconds)


def wrapped(phase: np.ndarray) -> np.ndarray:
    return np.angle(np.exp(1j * phase))


def test_frequency_and_amplitude_follow_the_drive_and_saturate_as_published(subtests: pytest.Subtests) -> None:
    for response, drive, frequency, amplitude in (
        (BODY, 0.999, 0.0, 0.0),
        (BODY, 1.0, 0.5, 0.261),
        (BODY, 3.0, 0.9, 0.391),
        (BODY, 5.0, 1.3, 0.521),
        (BODY, 5.001, 0.0, 0.0),
    ):
        with subtests.test(f"{response!r:.60}"):
            assert float(response.frequency_Hz(drive)) == pytest.approx(frequency)
            assert float(response.amplitude(drive)) == pytest.approx(amplitude)


def chain_of(frequency_Hz: np.ndarray, amplitude: float, coupling: float, lag: float) -> PhaseNetwork:
    """A chain whose oscillators each have a frequency of their own at any drive."""
    n = len(frequency_Hz)
    plain = phase_chain(n, lag, coupling)
    responses = tuple(DriveResponse(-1e9, 1e9, 0.0, float(nu), 0.0, amplitude) for nu in frequency_Hz)
    return PhaseNetwork(responses, plain.coupling_per_s, plain.phase_bias_rad)


def steady_lags(frequency_Hz: np.ndarray, amplitude: float, coupling_per_s: float, lag_rad: float) -> np.ndarray:
    """Phases by which neighbours of a locked chain follow one another, rad; NaN where it cannot lock.

    With equal amplitudes R the couplings cancel in the sum over all, so the common frequency is the mean of the
    intrinsic ones; balance of the first k oscillators then gives ``theta_k - theta_{k+1} = lag + arcsin(2 pi sum_{i<=k}
    (nu_i - mean nu) / (w R))``.
    """
    excess = np.cumsum(frequency_Hz - frequency_Hz.mean())[:-1]
    with np.errstate(invalid="ignore"):
        return lag_rad + np.arcsin(2.0 * np.pi * excess / (coupling_per_s * amplitude))


def test_two_oscillators_lock_up_to_their_coupling_and_no_further() -> None:
    coupling, amplitude = 4.0, 0.8
    edge = coupling * amplitude / np.pi
    for share in (0.99, 1.01):
        nu = np.array([1.0 + share * edge, 1.0])
        network = chain_of(nu, amplitude, coupling, 0.3)
        state = settle(network, 0.0, 40.0)
        apart = -np.diff(frequencies(network, state, 0.0, 40.0))[0]
        lags = steady_lags(nu, amplitude, coupling, 0.3)
        if share < 1:
            assert lags[0] == pytest.approx(0.3 + np.arcsin(share))
            assert abs(apart) < 1e-6
        else:
            assert np.isnan(lags[0])
            # The mean beat of an overdamped pendulum.
            assert apart == pytest.approx(edge * np.sqrt(share**2 - 1), rel=0.1)


@pytest.mark.parametrize("n", [3, 6, 8])
def test_swimming_is_one_travelling_wave_at_the_intrinsic_frequency(n: int) -> None:
    network, drive = phase_chain(n), 4.0
    # The slowest of its modes dies at 2 w R (1 - cos(pi / n)): 0.7/s for eight.
    state = settle(network, drive, 40.0)
    np.testing.assert_allclose(wrapped(-np.diff(state.phase_rad[0])), 2 * np.pi / n, atol=1e-6)
    np.testing.assert_allclose(frequencies(network, state, drive), 1.1, atol=1e-6)
    np.testing.assert_allclose(state.amplitude, 0.456, atol=1e-9)


def test_amplitude_settles_by_its_critically_damped_closed_form() -> None:
    """r - R falls as (1 + a t / 2) exp(-a t / 2) after a step of the drive."""
    stepper = PhaseStepper(phase_chain(3), 1e-3)
    state = stepper.initial_state(1.0)
    before, after = 0.261, 0.521
    for step in range(1, 401):
        state = stepper.advance(state, 5.0)
        s = 10.0 * step * 1e-3
        expected = after + (before - after) * (1 + s) * np.exp(-s)
        np.testing.assert_allclose(state.amplitude, expected, atol=2e-5)


def test_what_is_no_network_is_refused() -> None:
    with pytest.raises(ConfigError, match="n_body must be at least 2, not 1"):
        phase_chain(1)
    with pytest.raises(ConfigError, match=r"coupling_per_s has shape \(3, 3\), but 2 oscillators need \(2, 2\)"):
        PhaseNetwork((BODY, BODY), np.zeros((3, 3)), np.zeros((2, 2)))
    with pytest.raises(ConfigError, match=r"time step of 0\.06 s is too long"):
        PhaseStepper(phase_chain(3), 0.06)

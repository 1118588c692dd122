"""The heteroclinic ring: rates at its saddles, order, and dwell times against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.errors import ConfigError
from annelid_studies.oscillators import HeteroclinicRing, handover_input


def ring_of(n: int, growth: float = 20.0, saddle_value: float = 2.0, dt: float = 1e-3) -> HeteroclinicRing:
    return HeteroclinicRing(n, growth, saddle_value, dt)


rings = st.builds(ring_of, st.integers(3, 8), st.floats(1.0, 50.0), st.floats(1.1, 5.0))


def bias_dwell_s(ring: HeteroclinicRing, bias_per_s: np.ndarray) -> np.ndarray:
    """Time that a small constant input mu takes to leave a node, to an activity delta of one half, s.

    ``T = ln(delta lambda_u lambda_s / (mu (lambda_u + lambda_s))) / lambda_u``.
    """
    leave, settle = ring.leaving_rate_per_s, ring.growth_rate_per_s
    return np.log(0.5 * leave * settle / (leave + settle) / bias_per_s) / leave


def noise_dwell_s(ring: HeteroclinicRing, noise: np.ndarray) -> np.ndarray:
    """Mean time that small noise epsilon alone takes to leave a node, s: Stone and Holmes 1990, eq. 2.28.

    ``<T> = (ln(delta / epsilon) + (gamma + ln(4 lambda_u lambda_s / (lambda_u + lambda_s))) / 2) / lambda_u`` with
    Euler's gamma, as ``<ln|Z|> = -(gamma + ln 2) / 2`` for a standard normal Z.
    """
    leave, settle = ring.leaving_rate_per_s, ring.growth_rate_per_s
    constant = 0.5 * (np.euler_gamma + np.log(4.0 * leave * settle / (leave + settle)))
    return (np.log(0.5 / noise) + constant) / leave


def jacobian(ring: HeteroclinicRing, node: int) -> np.ndarray:
    """Of ``x_i (alpha - (rho x)_i)`` at a node, by central differences."""
    rho = ring.competition_per_s

    def flow(x: np.ndarray) -> np.ndarray:
        return x * (ring.growth_rate_per_s - rho @ x)

    at, small = np.eye(ring.n_nodes)[node], 1e-6
    steps = small * np.eye(ring.n_nodes)
    return np.stack([(flow(at + step) - flow(at - step)) / (2 * small) for step in steps], axis=1)


@given(ring=rings)
def test_every_node_is_a_saddle_left_towards_its_successor_only(ring: HeteroclinicRing) -> None:
    for node in range(ring.n_nodes):
        at = np.eye(ring.n_nodes)[node]
        np.testing.assert_allclose(at * (ring.growth_rate_per_s - ring.competition_per_s @ at), 0, atol=1e-12)
        complex_values, complex_vectors = np.linalg.eig(jacobian(ring, node))
        values, vectors = np.real(complex_values), np.real(complex_vectors)
        order = np.argsort(values)
        np.testing.assert_allclose(values[order[:-1]], -ring.growth_rate_per_s, rtol=1e-5)
        assert values[order[-1]] == pytest.approx(ring.growth_rate_per_s / ring.saddle_value, rel=1e-5)
        leaving = vectors[:, order[-1]]
        others = np.delete(leaving, [node, (node + 1) % ring.n_nodes])
        assert abs(leaving[(node + 1) % ring.n_nodes]) > 1e-3
        np.testing.assert_allclose(others, 0, atol=1e-5)


def visits(
    ring: HeteroclinicRing, seconds: float, noise: float, bias: float | np.ndarray, copies: int = 1, dt: float = 1e-3
) -> np.ndarray:
    """The node of largest activity over time, ``(n_steps, copies)``."""
    rng = np.random.default_rng(1)
    state = ring.initial_state(copies)
    largest = []
    for _ in range(round(seconds / dt)):
        kick = noise * rng.standard_normal(state.shape) if noise else 0.0
        state = ring.advance(state, bias, kick)
        assert (state >= 0).all()
        largest.append(state.argmax(axis=1))
    return np.array(largest)


def dwells(largest: np.ndarray, dt: float = 1e-3) -> np.ndarray:
    """Times from one change of node to the next, s, without the first two of each copy."""
    pooled = []
    for of_copy in largest.T:
        changes = np.flatnonzero(np.diff(of_copy))
        pooled.extend(np.diff(changes)[1:] * dt)
    return np.array(pooled)


@pytest.mark.parametrize(("n", "noise", "bias"), [(3, 1e-4, 0.0), (6, 0.0, 1e-4), (6, 1e-3, 1e-3)])
def test_nodes_are_visited_in_order(n: int, noise: float, bias: float) -> None:
    largest = visits(ring_of(n), 12.0, noise, bias, copies=5)
    for of_copy in largest.T:
        order = of_copy[np.flatnonzero(np.diff(of_copy, prepend=-1))]
        assert len(order) > n
        np.testing.assert_array_equal(order, np.arange(len(order)) % n)


@pytest.mark.parametrize("saddle_value", [1.5, 2.0, 4.0])
def test_dwell_grows_with_the_logarithm_of_a_small_bias_over_the_leaving_rate(saddle_value: float) -> None:
    ring = ring_of(3, 20.0, saddle_value)
    biases = np.array([1e-4, 1e-6, 1e-8])
    # Copies side by side, each with its own bias.
    largest = visits(ring, 40.0, 0.0, biases[:, np.newaxis], copies=3)
    mean = np.array([dwells(largest[:, [k]]).mean() for k in range(3)])
    np.testing.assert_allclose(np.diff(mean), np.diff(bias_dwell_s(ring, biases)), rtol=0.01)


def test_mean_and_spread_of_the_dwell_under_noise_are_stone_and_holmes_s() -> None:
    ring = ring_of(3)
    noises = np.array([1e-3, 1e-5, 1e-7])
    measured = [dwells(visits(ring, 20.0, noise, 0.0, copies=300)) for noise in noises]
    mean = np.array([one.mean() for one in measured])
    error = np.array([one.std() / np.sqrt(len(one)) for one in measured])
    # Four standard errors of a difference of two means.
    slack = 4 * np.hypot(error[1:], error[:-1])
    assert (np.abs(np.diff(mean) - np.diff(noise_dwell_s(ring, noises))) < slack).all()
    assert slack.max() < 0.05 * np.diff(mean).min()
    for one in measured[1:]:
        assert one.std() == pytest.approx(np.pi / np.sqrt(8) / ring.leaving_rate_per_s, rel=0.1)


def test_feedback_ends_the_dwell() -> None:
    ring = ring_of(4)
    lasts = []
    for cue_from in (200, 500, 900):
        state, step = ring.initial_state(), 0
        while state.argmax() == 0 and step < 5000:
            state = ring.advance(state, handover_input(state, float(step >= cue_from), 0.1))
            step += 1
        lasts.append(step - cue_from)
    # Without noise or bias the ring waits for its cue, however long, and then always takes the same time.
    assert lasts[0] == lasts[1] == lasts[2]
    grown = np.log(0.5 * ring.leaving_rate_per_s / 0.1) / ring.leaving_rate_per_s
    assert lasts[0] * 1e-3 == pytest.approx(grown, rel=0.35)


def test_handover_excites_the_successor_of_the_active_node_alone() -> None:
    state = np.array([[0.0, 0.0, 1.0], [0.2, 0.5, 0.0]])
    np.testing.assert_allclose(handover_input(state, np.array([1.0, 0.0, 1.0]), 3.0), [[3.0, 0, 0], [0, 0.6, 0]])


@pytest.mark.parametrize(("n", "saddle_value"), [(3, 1.2), (5, 3.0)])
def test_with_every_cue_on_the_ring_rests_between_its_nodes_from_the_closed_form_s_gain_on(
    n: int, saddle_value: float
) -> None:
    # A step adds dt |Im lambda|^2 / 2 to a growth rate: at 1 ms as much as the margins here.
    ring = ring_of(n, 20.0, saddle_value, 2e-4)
    for share, rests in ((0.9, False), (1.1, True)):
        gain = share * ring.largest_gain_per_s()
        middle = (20.0 + gain) / ring.competition_per_s[0].sum()
        state = middle * (1 + 1e-3 * np.cos(2 * np.pi * np.arange(n) / n))[np.newaxis]
        before = np.ptp(state)
        for _ in range(15_000):
            state = ring.advance(state, handover_input(state, 1.0, gain))
        assert (np.ptp(state) < before) == rests


def test_a_step_that_is_too_long_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"time step of 0\.05 s does not fit growth_rate_per_s = 20"):
        ring_of(3, dt=0.05)

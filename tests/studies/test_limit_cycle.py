"""Limit cycles against systems whose multipliers and phase responses are known, and of the planar worm."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.config import RunConfig, load_config
from annelid.errors import ConfigError
from annelid.protocols import Array
from annelid.simulation import build_controller, build_plant
from annelid_studies.limit_cycle.cycle import LimitCycle, NoLimitCycle, WormFlow, find_limit_cycle, limit_cycle
from annelid_studies.limit_cycle.flow import Section, Switches, travel

NONE = np.zeros(0, dtype=bool)


class Hopf:
    """Normal form of the supercritical Hopf bifurcation: r' = r (mu - r^2), theta' = omega."""

    labels: tuple[str, ...] = ("x", "y")
    scale = np.ones(2)

    def __init__(self, mu: float, omega: float) -> None:
        self.mu, self.omega = mu, omega

    def velocity(self, states: Array, on: Switches) -> Array:
        x, y = states.T
        radial = self.mu - x * x - y * y
        return np.stack([radial * x - self.omega * y, radial * y + self.omega * x], axis=1)

    def margins(self, states: Array, on: Switches) -> Array:
        return np.zeros((len(states), 0))


class Thermostat:
    """x' = 3 - x while heating, -x while not; heating ends at 2 and begins at 1. y follows the switch at rate k."""

    labels: tuple[str, ...] = ("x", "y")
    scale = np.ones(2)
    k = 0.4

    def velocity(self, states: Array, on: Switches) -> Array:
        x, y = states.T
        return np.stack([3.0 * on - x, on - self.k * y], axis=1)

    def margins(self, states: Array, on: Switches) -> Array:
        return np.where(on, 2.0 - states[:, :1], states[:, :1] - 1.0)


@settings(max_examples=5)
@given(mu=st.floats(0.3, 0.9), omega=st.floats(2.0, 4.0))
def test_hopf_normal_form_has_its_known_multipliers_and_phase_response(mu: float, omega: float) -> None:
    cycle = find_limit_cycle(Hopf(mu, omega), np.array([0.1, -1.3]), NONE, Section(0, 0.0), n_phases=20)
    assert cycle.period_s == pytest.approx(2 * np.pi / omega, rel=1e-8)
    known = np.exp(-2 * mu * cycle.period_s)
    assert cycle.multipliers == pytest.approx(np.array([1.0, known]), abs=1e-6)
    assert cycle.trivial == 0
    angle = 1.5 * np.pi + omega * cycle.time_s
    response = np.stack([-np.sin(angle), np.cos(angle)], axis=1) / (omega * np.sqrt(mu))
    np.testing.assert_allclose(cycle.phase_response, response, atol=1e-6 * np.abs(response).max())


def test_a_section_that_is_not_met_is_refused_in_time() -> None:
    with pytest.raises(NoLimitCycle, match=r"x does not rise through 3 within 2 s"):
        find_limit_cycle(Hopf(0.4, 5.0), np.array([0.1, -1.0]), NONE, Section(0, 3.0), longest_s=2.0)


@given(x=st.floats(1.0, 1.9), y=st.floats(0.0, 2.0))
@settings(max_examples=10)
def test_derivatives_jump_where_a_switch_moves(x: float, y: float) -> None:
    """Heating ends after ln(3 - x), and what is left of the second falls and cools from there."""
    flow, ends_s = Thermostat(), np.log(3.0 - x)
    found = travel(flow, np.array([x, y]), np.array([True]), ends_s + 0.4, linearised=True)
    assert not found.on[0]
    assert found.state[0] == pytest.approx(2.0 * np.exp(-0.4), rel=1e-6)
    later = -1.0 / (3.0 - x)
    stays = np.exp(-flow.k * (ends_s + 0.4))
    expected = [[found.state[0] * later, 0.0], [np.exp(-flow.k * 0.4) * later, stays]]
    np.testing.assert_allclose(found.transition, expected, atol=1e-6)


# The planar worm.


def worm(n_segments: int = 3, fields: dict[str, float] | None = None) -> RunConfig:
    return load_config("riddle2022-planar", {"body.n_segments": n_segments, **(fields or {})})


@cache
def cycle_of(n_segments: int) -> LimitCycle:
    return limit_cycle(worm(n_segments), n_phases=40)


@pytest.mark.parametrize(
    ("n_segments", "n_states", "published_ms"),
    [(3, 21, 2625.0), pytest.param(6, 42, 5250.0, marks=pytest.mark.slow)],
)
def test_the_worms_period_is_the_published_one(n_segments: int, n_states: int, published_ms: float) -> None:
    cycle = cycle_of(n_segments)
    assert len(cycle.labels) == n_states
    # The published one is that of Euler steps of 1 ms, which are a thousandth slower.
    assert 1e3 * cycle.period_s == pytest.approx(published_ms, rel=0.0012)
    assert abs(cycle.multipliers[0] - 1.0) < 3e-3
    assert np.abs(cycle.multipliers[1:]).max() < 1e-6


def test_a_kick_advances_the_worm_s_rhythm_by_its_phase_response() -> None:
    cycle, config = cycle_of(3), worm()
    flow = WormFlow(build_plant(config), build_controller(config, build_plant(config)))  # type: ignore[arg-type]
    section = Section(cycle.labels.index("contraction_1"), 10.0)
    _, on = flow.present()
    phase, place, later_s = 16, cycle.labels.index("gate[2]"), []
    start = travel(flow, cycle.state[0], on, cycle.time_s[phase])
    kick = 1e-4 * np.eye(len(cycle.labels))[place]
    for kicked in (start.state + kick, start.state - kick):
        first = travel(flow, kicked, start.on, 9.0, section=section)
        later_s.append(first.duration_s + travel(flow, first.state, first.on, 9.0, section=section).duration_s)
    shift = (later_s[1] - later_s[0]) / 2e-4
    assert shift == pytest.approx(cycle.phase_response[phase, place], rel=0.01)
    assert abs(shift) > 0.1


def test_worms_without_a_limit_cycle_of_their_own_are_refused(subtests: pytest.Subtests) -> None:
    for says, call in (
        (r"sensor\.noise_m = 0\.001", lambda: limit_cycle(worm(fields={"sensor.noise_m": 0.001}))),
        (r"longer than sensor\.startup_hold_s", lambda: limit_cycle(worm(), settle_s=0.0)),
        (r"no state 'contraction_7'.*contraction_", lambda: limit_cycle(worm(), neuron="contraction_7")),
        (r"has 420 continuous states; .* at most 400: choose fewer segments", lambda: limit_cycle(worm(60))),
        (r"no limit cycle .* choose the body riddle2022", lambda: limit_cycle(load_config("riddle2023-rods"))),
        (r"no limit cycle .* without a trial", lambda: limit_cycle(worm(fields={"trial.loss": 0.1}))),
    ):
        with subtests.test(says), pytest.raises(ConfigError, match=says):
            call()

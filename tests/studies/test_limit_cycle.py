"""Limit cycles against oscillators whose multipliers and phase responses are known, and of the planar worm."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.config import RunConfig, load_config
from annelid.errors import ConfigError
from annelid.protocols import Array, Sensation, State
from annelid.simulation import build_controller, build_plant
from annelid_studies.limit_cycle.closed_loop import ClosedLoop, Continuous, travel
from annelid_studies.limit_cycle.cycle import (
    LimitCycle,
    NoLimitCycle,
    Section,
    find_limit_cycle,
    limit_cycle,
    section_at,
    settle,
)
from annelid_studies.planar import Riddle2022Plant


class Field:
    """A vector field as a flow of forward Euler steps, with switches or without."""

    def __init__(self, n_states: int, timestep_s: float = 1e-3) -> None:
        self.timestep_s = timestep_s
        self.labels = tuple(f"x[{i}]" for i in range(n_states))

    def step(self, state, switches):
        switches = self.switch(state, switches)
        return state + self.timestep_s * self.velocity(state, switches), switches

    def part(self, state, switches, ahead, share):
        return state + share[:, None] * (ahead - state)

    def switch(self, state, switches):
        return switches

    def velocity(self, state, switches):
        raise NotImplementedError


class Hopf(Field):
    """Normal form of the supercritical Hopf bifurcation: r' = r (mu - r^2), theta' = omega."""

    def __init__(self, mu: float, omega: float) -> None:
        super().__init__(2)
        self.mu, self.omega = mu, omega

    def velocity(self, state, switches):
        x, y = state.T
        radial = self.mu - x * x - y * y
        return np.stack([radial * x - self.omega * y, radial * y + self.omega * x], axis=1)


class Thermostat(Field):
    """x' = 3 - x while heating, -x while not; heating ends at 2 and begins at 1. y follows the switch at rate k."""

    k = 0.4

    def __init__(self, timestep_s: float = 1e-3) -> None:
        super().__init__(2, timestep_s)

    def switch(self, state, switches):
        return ((state[:, :1] <= 1.0) | switches) & (state[:, :1] < 2.0)

    def velocity(self, state, switches):
        x, y = state.T
        return np.stack([3.0 * switches[:, 0] - x, switches[:, 0] - self.k * y], axis=1)


NONE = np.zeros((1, 0), dtype=bool)


def hopf_cycle(mu: float, omega: float, step: float = 0.01, **options) -> tuple[Continuous, LimitCycle]:
    flow = Continuous(Hopf(mu, omega), step)
    start = np.array([[0.1, -1.3]])
    return flow, find_limit_cycle(flow, start, NONE, Section(0, 0.0), n_phases=20, **options)


@settings(max_examples=5)
@given(mu=st.floats(0.3, 0.9), omega=st.floats(2.0, 4.0))
def test_hopf_normal_form_has_its_known_multipliers_and_phase_response(mu, omega):
    _, cycle = hopf_cycle(mu, omega)
    assert cycle.period_s == pytest.approx(2 * np.pi / omega, rel=1e-5)
    known = np.exp(-2 * mu * cycle.period_s)
    assert cycle.multipliers == pytest.approx(np.array([1.0, known]), abs=1e-4)
    assert cycle.trivial == 0
    assert cycle.closing_error <= 1e-9
    angle = 1.5 * np.pi + omega * cycle.time_s
    response = np.stack([-np.sin(angle), np.cos(angle)], axis=1) / (omega * np.sqrt(mu))
    # The velocity that normalises it is taken forwards, over one step.
    np.testing.assert_allclose(cycle.phase_response, response, atol=0.01 * np.abs(response).max())


def test_a_section_that_is_not_met_is_refused_in_time():
    flow = Continuous(Hopf(0.4, 5.0), 0.01)
    with pytest.raises(NoLimitCycle, match=r"x\[0\] does not rise through 3 within 2 s"):
        find_limit_cycle(flow, np.array([[0.1, -1.0]]), NONE, Section(0, 3.0), longest_s=2.0)


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
def test_the_worms_period_is_the_published_one(n_segments, n_states, published_ms):
    cycle = cycle_of(n_segments)
    assert len(cycle.labels) == n_states
    # The published one is that of Euler steps of 1 ms, which are a thousandth slower.
    assert 1e3 * cycle.period_s == pytest.approx(published_ms, rel=0.0012)
    assert abs(cycle.multipliers[0] - 1.0) < 3e-3
    assert np.abs(cycle.multipliers[1:]).max() < 1e-6


def test_the_segments_follow_each_other_by_a_third_of_the_cycle():
    first = cycle_of(3)
    second = limit_cycle(worm(), neuron="contraction_2", n_phases=40)
    assert second.period_s == pytest.approx(first.period_s, abs=1e-6)
    segment = [first.labels.index(f"contraction_{i}") for i in (1, 2)]
    assert second.state[0, segment[1]] == first.state[0, segment[0]] == 10.0


def test_copies_step_as_the_worm_does() -> None:
    config = worm(4, {"sensor.hysteresis_m": 1e-4})
    plant = build_plant(config)
    assert isinstance(plant, Riddle2022Plant)
    controller = build_controller(config, plant)
    settle(plant, controller, 0.001, 1.0)
    loop = ClosedLoop(plant, controller, 0.001)
    sensation = plant.sense()
    state, switches = loop.present()
    copies, before = state.repeat(3, axis=0), switches.repeat(3, axis=0)
    for _ in range(200):
        copies, before = loop.step(copies, before)
        sensation = plant.step(controller.step(sensation))
        np.testing.assert_allclose(copies, loop.present()[0].repeat(3, axis=0), rtol=1e-12, atol=1e-12)


def test_a_step_ends_where_a_switch_moves() -> None:
    flow, start = Thermostat(0.01), np.array([[1.0, 0.5]])
    on = np.ones((1, 1), dtype=bool)
    # Euler's x = 3 - 2 (1 - h)^n reaches 2 after 68.97 steps of 0.01; from there it falls.
    end = travel(flow, start, on, np.array([0.7]))
    falls_s = 0.7 - 0.01 * np.log(0.5) / np.log(0.99)
    assert end.state[0, 0] == pytest.approx(2.0 * np.exp(-falls_s), abs=1e-3)
    assert not end.switches[0, 0]


class Timed:
    """A controller that looks at the clock."""

    def reset(self, seed: int) -> None:
        self._steps = 0

    def step(self, sensation: Sensation) -> Array:
        self._steps += 1
        return np.full(3, 0.5 + 0.5 * np.sin(2.0 * sensation.time_s))

    def get_state(self) -> State:
        return {"steps": np.array(self._steps)}

    def set_state(self, state: State) -> None:
        self._steps = int(state["steps"])

    def step_copies(self, states: State, sensation: Sensation) -> tuple[State, Array]:
        activation = np.full(3, 0.5 + 0.5 * np.sin(2.0 * sensation.time_s + self._steps))
        return states, activation[np.newaxis].repeat(len(sensation.stretch_m), axis=0)

    def pieces_copies(self, states: State) -> np.ndarray:
        return np.zeros((1, 0), dtype=bool)


class Forgetful:
    def reset(self, seed: int) -> None: ...

    def step(self, sensation: Sensation) -> Array:
        return np.zeros(3)


def test_loops_without_a_limit_cycle_of_their_own_are_refused(subtests: pytest.Subtests) -> None:
    with pytest.raises(ConfigError, match="Timed depends on time itself"):
        settle(build_plant(worm()), Timed(), 0.001, 0.1)
    for says, call in (
        (r"Forgetful has no limit cycle .* riddle2022", lambda: settle(build_plant(worm()), Forgetful(), 0.001, 0.1)),
        (r"sensor\.noise_m = 0\.001", lambda: limit_cycle(worm(fields={"sensor.noise_m": 0.001}))),
        (r"longer than sensor\.startup_hold_s", lambda: limit_cycle(worm(), settle_s=0.0)),
        (r"no state 'contraction_7'.*contraction_", lambda: limit_cycle(worm(), neuron="contraction_7")),
        (r"have 420 continuous states; .* at most 400: choose fewer segments", lambda: limit_cycle(worm(60))),
        (r"no limit cycle .* choose the body riddle2022", lambda: limit_cycle(load_config("riddle2023-rods"))),
    ):
        with subtests.test(says), pytest.raises(ConfigError, match=says):
            call()


def test_a_sections_state_is_found_by_name():
    flow = Thermostat()
    assert section_at(flow, "x[1]", 0.5) == Section(1, 0.5)

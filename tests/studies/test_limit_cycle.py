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
from annelid_studies.limit_cycle.cycle import (
    LimitCycle,
    NoLimitCycle,
    Section,
    find_limit_cycle,
    kicked_phase_response,
    limit_cycle,
    section_at,
    settled,
)
from annelid_studies.limit_cycle.flow import ClosedLoop, Continuous


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
@given(mu=st.floats(0.05, 0.6), omega=st.floats(2.0, 6.0))
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


def test_a_weakly_attracting_orbit_is_closed_by_newtons_method():
    _, cycle = hopf_cycle(0.01, 5.0, step=0.002)
    # Plain iteration, which keeps 97.5 % of the error a cycle, would need some 700.
    assert cycle.n_returns < 40
    assert cycle.state[0] == pytest.approx(np.array([0.0, -0.1]), abs=1e-5)


def test_kicks_measure_what_the_adjoint_says():
    flow, cycle = hopf_cycle(0.4, 5.0)
    phases = np.array([2, 9, 15])
    kicks = 1e-4 * np.eye(2)
    measured = kicked_phase_response(flow, cycle, kicks, phases, n_cycles=6) / 1e-4
    np.testing.assert_allclose(measured, cycle.phase_response[phases], atol=0.01 * np.abs(cycle.phase_response).max())


def test_a_section_that_is_not_met_is_refused_in_time():
    flow = Continuous(Hopf(0.4, 5.0), 0.01)
    with pytest.raises(NoLimitCycle, match=r"x\[0\] does not rise through 3 within 2 s"):
        find_limit_cycle(flow, np.array([[0.1, -1.0]]), NONE, Section(0, 3.0), longest_s=2.0)


# The planar worm.


def worm(n_segments: int = 3, fields: dict[str, float] | None = None) -> RunConfig:
    return load_config("riddle2022-planar", {"body.n_segments": n_segments, **(fields or {})})


@cache
def cycle_of(n_segments: int, time) -> LimitCycle:
    return limit_cycle(worm(n_segments), time=time, n_phases=40)


@pytest.mark.parametrize(
    ("n_segments", "n_states", "published_ms"),
    [(3, 21, 2625.0), pytest.param(6, 42, 5250.0, marks=pytest.mark.slow)],
)
def test_the_worms_period_is_the_published_one(n_segments, n_states, published_ms):
    cycle = cycle_of(n_segments, "located")
    assert len(cycle.labels) == n_states
    assert 1e3 * cycle.period_s == pytest.approx(published_ms, abs=3.0)


def test_the_segments_follow_each_other_by_a_third_of_the_cycle():
    first = cycle_of(3, "located")
    second = limit_cycle(worm(), time="located", neuron="contraction_2", n_phases=40)
    assert second.period_s == pytest.approx(first.period_s, abs=1e-4)
    assert np.abs(second.multipliers[1:]).max() < 0.01
    segment = [first.labels.index(f"contraction_{i}") for i in (1, 2)]
    assert second.state[0, segment[1]] == first.state[0, segment[0]] == 10.0


class OneByOne:
    """A plant without its batched face."""

    def __init__(self, plant) -> None:
        self._plant = plant
        self.n_segments, self.n_muscles = plant.n_segments, plant.n_muscles

    def reset(self, seed: int) -> Sensation:
        return self._plant.reset(seed)

    def step(self, activation: Array) -> Sensation:
        return self._plant.step(activation)

    def sense(self) -> Sensation:
        return self._plant.sense()

    def get_state(self) -> State:
        return self._plant.get_state()

    def set_state(self, state: State) -> None:
        self._plant.set_state(state)


@pytest.mark.parametrize("physics_timestep_s", [0.001, 0.005])
def test_copies_one_by_one_step_as_the_batch_does(physics_timestep_s):
    config = worm(4, {"clock.physics_timestep_s": physics_timestep_s, "sensor.hysteresis_m": 1e-4})
    stride = round(physics_timestep_s / 0.001)
    plant = build_plant(config)
    controller = build_controller(config, plant)
    batch, state, switches = settled(plant, controller, 0.001, 1.0, stride=stride)
    single = ClosedLoop(OneByOne(plant), controller, 0.001, stride)
    assert (batch.batched, single.batched) == (True, False)
    copies = state * (1 + 0.05 * np.random.default_rng(0).standard_normal((7, state.size)))
    before = switches.repeat(7, axis=0)
    for _ in range(4):
        (together, on), (apart, also_on) = batch.step(copies, before), single.step(copies, before)
        np.testing.assert_allclose(together, apart, rtol=1e-12, atol=1e-12)
        assert np.array_equal(on, also_on)
        copies, before = together, on


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


class Forgetful:
    def reset(self, seed: int) -> None: ...

    def step(self, sensation: Sensation) -> Array:
        return np.zeros(3)


def test_loops_without_a_limit_cycle_of_their_own_are_refused():
    with pytest.raises(ConfigError, match="Timed depends on time itself"):
        settled(build_plant(worm()), Timed(), 0.001, 0.1)
    with pytest.raises(ConfigError, match=r"Forgetful has no limit cycle .* get_state and set_state"):
        settled(build_plant(worm()), Forgetful(), 0.001, 0.1)
    with pytest.raises(ConfigError, match=r"sensor\.noise_m = 0\.001"):
        limit_cycle(worm(fields={"sensor.noise_m": 0.001}))
    with pytest.raises(ConfigError, match=r"longer than sensor\.startup_hold_s"):
        limit_cycle(worm(), settle_s=0.0)
    with pytest.raises(ConfigError, match=r"no state 'contraction_7'.*contraction_"):
        limit_cycle(worm(), neuron="contraction_7")


def test_a_body_of_thousands_of_states_is_refused_before_it_runs():
    with pytest.raises(ConfigError, match=r"have \d{4,} continuous states; .* at most 400: choose a planar body"):
        limit_cycle(load_config("riddle2023-rods"))


def test_a_sections_state_is_found_by_name():
    flow = Thermostat()
    assert section_at(flow, "x[1]", 0.5) == Section(1, 0.5)

"""Servos wind cables that can only pull, no faster and no harder than they can; sensors sit where they are told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from annelid.body.actuation import stretch_sensors
from annelid.body.actuators.muscle import Rings
from annelid.body.actuators.servo import ServoRings
from annelid.body.mesh import Mesh, Springs
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.simulation.worm import WormPlant

SMALL = {
    "body.mesh.n_segments": 3,
    "body.mesh.elements_per_side": 1,
    "arena.gravity_m_per_s2": 0.0,
    "clock.control_timestep_s": 0.005,
    "clock.physics_timestep_s": 0.005,
    "record.signals_interval_s": 0.005,
}
STIFF = {"body.strands.young_modulus_Pa": 2e12, "body.strands.shear_modulus_Pa": 1.3e12}
LIMIT_N, SPEED_M_PER_S, STIFFNESS_N_PER_M = 8.0, 0.05, 600.0
SERVO = {
    "body.rings.force_limit_N": LIMIT_N,
    "body.rings.speed_limit_m_per_s": SPEED_M_PER_S,
    "body.rings.stiffness_N_per_m": STIFFNESS_N_PER_M,
}


def worm(**changes: Any) -> WormPlant:
    plant = WormPlant(load_config("wang", SMALL | SERVO | changes))
    plant.reset(0)
    return plant


def wound(
    activation: float, slack_m: float, length_m: float, time_s: float = 0.01, rings: ServoRings | None = None
) -> float:
    """Slack length of a cable after a command."""
    rings = rings or ServoRings(stiffness_N_per_m=STIFFNESS_N_PER_M, speed_limit_m_per_s=SPEED_M_PER_S)
    command, slack, length = (np.array([value]) for value in (activation, slack_m, length_m))
    model: Any = SimpleNamespace(
        actuator_actrange=np.array([[0.31, 0.48]]), actuator_forcerange=np.array([[-LIMIT_N, 0.0]])
    )
    return float(rings.states_after(model, command[np.newaxis], slack, length, time_s)[0])


def speed(*given: Any) -> float:
    """Mean rate of a slack length over 0.1 ms."""
    activation, slack_m, length_m, *rings = given
    return (wound(activation, slack_m, length_m, 1e-4, *rings) - slack_m) / 1e-4


activations, lengths = st.floats(0.0, 1.0), st.floats(0.31, 0.48)


@given(activation=activations, slack_m=lengths, length_m=st.floats(0.2, 0.6), time_s=st.floats(1e-4, 0.1))
def test_a_cable_is_never_faster_than_its_limit_and_stays_between_command_and_stall(
    activation: float, slack_m: float, length_m: float, time_s: float
) -> None:
    after = wound(activation, slack_m, length_m, time_s)
    commanded = 0.48 - 0.17 * activation
    stalled = length_m - LIMIT_N / STIFFNESS_N_PER_M
    assert abs(after - slack_m) <= SPEED_M_PER_S * time_s + 1e-12
    if after < slack_m:
        assert after >= max(commanded, min(stalled, 0.48)) - 1e-12
    elif after > slack_m:
        assert after <= max(commanded, stalled) + 1e-12
    else:
        assert slack_m == pytest.approx(max(commanded, min(stalled, 0.48)))


@given(slack_m=st.floats(0.35, 0.45), load=st.floats(0.0, 0.9))
def test_a_servo_winds_below_its_force_limit_holds_at_it_and_lets_go_at_once(slack_m: float, load: float) -> None:
    taut_m, stretch_m = slack_m, LIMIT_N / STIFFNESS_N_PER_M
    assert speed(1.0, slack_m, taut_m + load * stretch_m) == pytest.approx(-SPEED_M_PER_S, abs=1e-9)
    assert speed(1.0, slack_m, taut_m + stretch_m) == pytest.approx(0.0, abs=1e-9)
    assert speed(1.0, slack_m, taut_m + 1.2 * stretch_m) == pytest.approx(SPEED_M_PER_S, abs=1e-9)
    assert speed(0.0, slack_m, taut_m + load * stretch_m) == pytest.approx(SPEED_M_PER_S, abs=1e-9)


@given(backlash_m=st.floats(0.0, 0.05), commands=st.lists(activations, min_size=1, max_size=20))
def test_backlash_is_play_between_command_and_cable(backlash_m: float, commands: list[float]) -> None:
    """A servo that keeps up follows its command as a pin in a slot of that width; the cable is never taut here."""
    rings = ServoRings(backlash_m=backlash_m, speed_limit_m_per_s=1e3)
    state = slot = 0.48
    for activation in commands:
        state = wound(activation, state, 0.3, 0.01, rings)
        commanded = 0.48 - 0.17 * activation
        slot = min(max(slot, commanded - backlash_m / 2), commanded + backlash_m / 2)
        assert state == pytest.approx(slot, abs=1e-12)


@pytest.mark.parametrize("layout", ["whole", "halves"])
def test_without_load_a_cable_moves_at_the_speed_limit(layout: str) -> None:
    """A cable that is longer than its way round the body is slack; until it is taut its force is zero."""
    plant = worm(**{"body.rings.layout": layout, "body.rings.length_range_m": [0.62, 1.3]})
    longest = 1.3 if layout == "whole" else 0.65
    for _ in range(100):
        felt = plant.step(np.ones(plant.n_muscles))
        assert np.array_equal(felt.muscle_force_N, np.zeros(plant.n_muscles))
    assert plant.act == pytest.approx(longest - 0.5 * SPEED_M_PER_S, rel=1e-9)


def test_a_slack_cable_changes_nothing() -> None:
    """The engine's implicit treatment of stiffness and damping must not hold a body whose cables are slack."""
    slack = {"body.rings.length_range_m": [0.62, 1.3]}
    weak = {**slack, "body.rings.stiffness_N_per_m": 1e-6, "body.rings.damping_Ns_per_m": 0.0}
    paths = []
    for changes in (slack, weak):
        plant = worm(**changes, **{"arena.gravity_m_per_s2": 9.81})
        paths.append([plant.step(np.zeros(plant.n_muscles)).ring_length_m for _ in range(20)])
    assert np.ptp(paths[0], axis=0).max() > 1e-4
    assert np.allclose(paths[0], paths[1], rtol=0.0, atol=1e-9)


def test_against_a_stiff_ring_a_servo_stalls_at_its_force_limit() -> None:
    """At a fixed length, tension rises by stiffness times speed a second up to the limit, and falls alike."""
    changes = STIFF | {"body.rings.length_range_m": [0.62, 0.959], "body.springs.stiffness_N_per_m": 0.0}
    timestep_s, rate = 0.005, STIFFNESS_N_PER_M * SPEED_M_PER_S
    plant = worm(**changes)
    errors = []
    felt = plant.observe()
    for step in range(1, round(0.6 / timestep_s) + 1):
        felt = plant.step(np.ones(plant.n_muscles))
        assert np.ptp(felt.ring_length_m) < 1e-3
        expected = min(LIMIT_N, rate * step * timestep_s)
        errors.append(np.abs(felt.muscle_force_N - expected).max())
    assert max(errors[10:]) < 0.06 * LIMIT_N
    assert felt.muscle_force_N == pytest.approx(LIMIT_N, rel=0.01)
    # Stalled, it has not wound on: told to let go, it does so at once.
    for step in range(1, round(0.2 / timestep_s) + 1):
        felt = plant.step(np.zeros(plant.n_muscles))
        assert felt.muscle_force_N == pytest.approx(LIMIT_N - rate * step * timestep_s, abs=0.06 * LIMIT_N)


def test_servos_may_differ_from_segment_to_segment() -> None:
    plant = worm(**{"body.rings.force_limit_N": [3.0, 5.0, 7.0]})
    assert plant.model.actuator_forcerange[:, 0].tolist() == [-3.0, -3.0, -5.0, -5.0, -7.0, -7.0]


def test_side_sensors_are_the_leftmost_and_the_rightmost_springs(subtests: pytest.Subtests) -> None:
    for mesh in (Mesh(), Mesh(n_segments=5, planes_between_rings=3), Mesh(n_helices=8)):
        with subtests.test(f"{mesh!r:.60}"):
            geometry = mesh.geometry()
            every, sides = (stretch_sensors(geometry, Springs(sensors=which)) for which in ("all", "sides"))
            assert every is geometry.sensor_springs
            assert sides.shape == (mesh.n_segments, 2)
            y = geometry.crossings_m[geometry.springs, 1].mean(axis=1)
            for segment in range(mesh.n_segments):
                assert set(sides[segment]) <= set(every[segment])
                # Segment 1 leads towards -x: left is -y.
                assert (
                    y[sides[segment, 0]]
                    == y[every[segment]].min()
                    < 0.0
                    < y[every[segment]].max()
                    == y[sides[segment, 1]]
                )


def test_a_worm_feels_the_springs_that_have_sensors() -> None:
    both = [worm(**{"body.springs.sensors": which}) for which in ("all", "sides")]
    felt = [plant.step(np.linspace(0.0, 1.0, plant.n_muscles)) for plant in both]
    assert [one.stretch_m.shape for one in felt] == [(3, 6), (3, 2)] == [one.rest_stretch_m.shape for one in felt]
    for pair, all_six in zip(felt[1].stretch_m, felt[0].stretch_m, strict=True):
        assert set(pair) <= set(all_six)


def test_what_a_servo_cannot_be_is_refused_by_the_field_s_name(subtests: pytest.Subtests) -> None:
    for changes, words in (
        ({"body.rings.peak_force_N": 20.0}, "body.rings.peak_force_N"),
        ({"body.rings.length_range_m": [0.96, 0.62]}, "lower bound below its upper bound"),
    ):
        with subtests.test(f"{changes!r:.60}"), pytest.raises(ConfigError, match=words):
            load_config("wang", changes)


def test_muscles_refuse_the_fields_of_servos_and_may_become_servos() -> None:
    with pytest.raises(ConfigError, match="speed_limit_m_per_s"):
        load_config("riddle2023-rods", {"body.rings.speed_limit_m_per_s": 0.1})
    changed = load_config("riddle2023", {"body.rings.kind": "servo"}).model_dump()["body"]["rings"]
    assert changed == ServoRings().model_dump()


LAGGING = Rings(activation_dynamics=True)
SHARES = st.floats(0.0, 1.0)


def lagged(activation: float, state: float, time_s: float) -> float:
    model: Any = None
    return float(LAGGING.states_after(model, np.array([[activation]]), np.array([state]), np.zeros(1), time_s)[0])


@example(activation=1.0, state=0.0, time_s=0.001)
@example(activation=1.0, state=0.0, time_s=0.02)
@given(activation=SHARES, state=SHARES, time_s=st.floats(1e-4, 0.2))
def test_a_lag_is_the_solution_of_the_engine_s_equation(activation: float, state: float, time_s: float) -> None:
    """Of its rate as the engine gives it."""
    now = lagged(activation, state, time_s)
    exact = solve_ivp(
        lambda _, level: [mujoco.mju_muscleDynamics(activation, level[0], [0.01, 0.04, 0.0])],
        (0.0, time_s),
        [state],
        rtol=1e-8,
        atol=1e-10,
    )
    assert now == pytest.approx(exact.y[0, -1], abs=1e-7)
    assert min(activation, state) - 1e-12 <= now <= max(activation, state) + 1e-12


@pytest.mark.parametrize("timestep_s", [0.01, 0.04])
def test_a_lagging_muscle_acts_as_at_the_end_of_a_step_of_any_length(timestep_s: float) -> None:
    """At 40 ms the engine's own lag, whose times are 10 and 40 ms, would swing beyond its ends."""
    changes = {"clock.physics_timestep_s": timestep_s, "record.signals_interval_s": timestep_s}
    plant = WormPlant(load_config("riddle2023-rods", {"body.rings.activation_dynamics": True, **changes}))
    expected = 0.0
    for command in (1.0, 0.3):
        for _ in range(round(0.04 / timestep_s)):
            plant.move(np.array([command, 0.0, 0.0]), 1)
        expected = lagged(command, expected, 0.04)
        np.testing.assert_allclose(plant.act, [expected, 0.0, 0.0], atol=1e-9)
        np.testing.assert_array_equal(plant.ctrl, plant.act)

"""Worms in pipes: the way is the centre line, and passing it is success."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worms import CHEAP

from annelid.arena.centre_line import AHEAD, LEFT, UP
from annelid.arena.kinds.floor import Floor
from annelid.arena.kinds.pipe import Pipe
from annelid.environments import WormEnv
from annelid.environments.observation import Route

BEND = Pipe(bore_m=0.18, course="bend", radius_m=0.8, turn_deg=90.0, straight_m=0.2)


def rings(middle: np.ndarray) -> np.ndarray:
    """Centres of three rings a millimetre apart about a middle, m."""
    return middle + np.outer([0.001, 0.0, -0.001], AHEAD)


@given(*[st.floats(-3.0, 3.0)] * 3)
def test_on_open_ground_the_route_is_straight_ahead(x: float, y: float, z: float) -> None:
    place = Route(Floor()).place(rings(np.array([x, y, z])))
    assert place.along_m == pytest.approx(-x)
    assert np.array_equal(place.axes, [AHEAD, LEFT, UP])


@given(st.floats(0.02, 1.55))
def test_round_a_bend_the_route_is_the_arc_and_its_axes_turn(angle: float) -> None:
    centre = np.array([-0.2, -0.8, 0.18])
    middle = centre + 0.8 * np.array([-np.sin(angle), np.cos(angle), 0.0])
    place = Route(BEND).place(np.stack([middle] * 3))
    assert place.along_m == pytest.approx(0.2 + 0.8 * angle)
    assert np.allclose(place.axes @ place.axes.T, np.eye(3))
    assert np.allclose(place.axes[0], [-np.cos(angle), -np.sin(angle), 0.0])
    assert np.allclose(place.axes[2], UP)


def test_the_goal_lies_behind_all_that_bends_or_narrows() -> None:
    for arena, changes, goal in (("pipe.taper", {}, 0.7), ("pipe.bend", {"arena.radius": 0.8}, 0.2 + 0.4 * np.pi)):
        env = WormEnv(CHEAP["preset"], CHEAP["changes"] | changes, arena=arena)
        assert env.task.goal_m == pytest.approx(goal)
    straight = WormEnv(**CHEAP, arena="pipe")
    assert straight.task.goal_m == pytest.approx(straight.worm.geometry.length_m)


def test_passing_is_success_and_ends_the_episode() -> None:
    env = WormEnv(**CHEAP, arena="pipe.taper", episode_s=6.0, start_activation=0.0)
    env.reset(seed=0)
    env.task = replace(env.task, goal_m=env._start_m + 0.01)
    infos, ended, passed = [], False, False
    while not (ended or passed):
        action = (np.arange(3) == (len(infos) // 3) % 3).astype(float)
        *_, passed, ended, info = env.step(action)
        infos.append(info)
    assert passed
    assert infos[-1]["is_success"]
    assert infos[-1]["travel"] * env.worm.geometry.length_m >= 0.01
    assert [info["reward_success"] for info in infos] == [*[0.0] * (len(infos) - 1), 10.0]

"""Worms in pipes: the way is the centre line, and passing it is success."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worms import CHEAP

from annelid.arena.course import AHEAD, LEFT, UP
from annelid.arena.kinds.floor import Floor
from annelid.arena.kinds.pipe import Pipe
from annelid.environments import WormEnv
from annelid.environments.episode import Episode, Route
from annelid.environments.task import task_of

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


def test_where_the_pipe_begins_both_routes_agree() -> None:
    middle = rings(np.array([0.3, 0.0, 0.18]))
    pipe, floor = Route(BEND).place(middle), Route(Floor()).place(middle)
    assert pipe.along_m == pytest.approx(floor.along_m)
    assert np.allclose(pipe.axes, floor.axes)


@pytest.mark.parametrize(
    ("arena", "changes", "goal"),
    [
        ("pipe.taper", {}, 0.7),
        ("pipe.bend", {"arena.radius": 0.8}, 0.2 + 0.4 * np.pi),
        ("pipe", {}, None),
    ],
)
def test_the_goal_lies_behind_all_that_bends_or_narrows(arena: str, changes: dict[str, float], goal: float) -> None:
    env = WormEnv(CHEAP["preset"], CHEAP["changes"] | changes, arena=arena)
    assert env.task.goal_m == pytest.approx(goal or env.worm.geometry.length_m)


def test_passing_is_success_and_ends_the_episode() -> None:
    options = {"fidelity": "coarse", "interval_s": 0.12, "episode_s": 6.0, "weights": None, "start_activation": 0.0}
    task = task_of(CHEAP["preset"], CHEAP["changes"], arena="pipe.taper", **options)
    worm = WormEnv(CHEAP["preset"], CHEAP["changes"], arena="pipe.taper").worm
    start = Route(task.config.arena).place(worm.posture.crossing.take(worm.geometry.rings, axis=0).mean(axis=1))  # type: ignore[arg-type]
    episode, random = Episode(replace(task, goal_m=start.along_m + 0.01), worm), np.random.default_rng(0)
    episode.reset(random)
    told, k = [], 0
    while not told or not (told[-1].terminated or told[-1].truncated):
        action = (np.arange(3) == (k // 3) % 3).astype(float)
        told.append(episode.step(action, random))
        k += 1
    assert told[-1].terminated
    assert told[-1].info["is_success"]
    assert told[-1].info["reward_success"] == 10.0
    assert told[-1].info["travel"] * worm.geometry.length_m >= 0.01
    assert all(step.info["reward_success"] == 0.0 for step in told[:-1])

"""A worm that leads another way at the start is the same worm: turned, and told in its own terms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from annelid import load_config
from annelid.body.assemble import mjcf_text
from annelid.environments import WormEnv
from annelid.errors import ConfigError
from annelid.morphology import heading_turn
from annelid.protocols import SIDES, Array
from annelid.simulation.worm import WormPlant

FORMULATIONS: dict[str, dict[str, Any]] = {
    "rods": {},
    "chain": {
        "body.formulation.kind": "chain",
        "body.mesh.n_helices": 8,
    },
    "setae": {"arena.backward_friction": 2.0},
}
STEPS = 16
POST_M = (0.1, 0.17, 0.0)
"""A post on the right of a worm that leads towards -x."""
CHEAP_BODY: dict[str, Any] = {
    "body.mesh.n_segments": 3,
    "body.mesh.n_helices": 6,
    "body.rings.peak_force_N": 16.0,
    "clock.physics_timestep_s": 0.04,
}


def worm(heading_deg: float, **changes: Any) -> tuple[WormPlant, Array]:
    """A worm with half-rings that has pulled unevenly beside a post, and the mean of what its sides have felt, N."""
    x, y, _ = heading_turn(heading_deg) @ POST_M
    fixed = {
        "arena.posts": [[x, y, 0.03]],
        "body.rings.layout": "halves",
        "body.mesh.elements_per_side": 1,
        "clock.control_timestep_s": 0.005,
        "clock.physics_timestep_s": 0.005,
        "record.signals_interval_s": 0.005,
        "arena.contact_time_constant_s": 0.06,
    }
    plant = WormPlant(load_config("riddle2023-rods", fixed | {"body.heading_deg": heading_deg} | changes))
    plant.reset(0)
    felt = [plant.step(np.array([1.0, 0.6, 0.0, 0.0, 0.3, 0.3])).touch_N for _ in range(STEPS)]
    return plant, np.mean(felt, axis=0)


def test_the_turn_of_a_heading_is_to_the_worm_s_left() -> None:
    ahead = np.array([-1.0, 0.0, 0.0])
    assert np.array_equal(heading_turn(90.0) @ ahead, [0.0, -1.0, 0.0])
    assert np.array_equal(heading_turn(180.0) @ ahead, [1.0, 0.0, 0.0])
    assert np.array_equal(heading_turn(-90.0) @ ahead, [0.0, 1.0, 0.0])
    assert np.array_equal(heading_turn(360.0), np.eye(3))
    assert heading_turn(30.0) @ ahead == pytest.approx([-np.sqrt(0.75), -0.5, 0.0])


@pytest.mark.parametrize(
    ("kind", "heading", "near"), [("rods", -180.0, 1e-9), ("chain", 90.0, 5e-4), ("setae", 90.0, 5e-4)]
)
def test_a_turned_worm_moves_and_feels_as_one_that_is_not(kind: str, heading: float, near: float) -> None:
    """By half and quarter turns, for which pyramids of friction are the same.

    Rods do not quite: how hard the engine holds the length of an edge depends on where that points. Nor does a chain,
    whose solver visits its turned pyramids in another order and ends before it has converged.
    """
    changes = FORMULATIONS[kind]
    (straight, touched), (leading, touched_so) = worm(0.0, **changes), worm(heading, **changes)
    first, other, turn = straight.observe(), leading.observe(), heading_turn(heading)
    assert np.ptp(first.ring_length_m) > 0.05, "it must have moved"
    assert touched[:, SIDES.index("right")].any(), "it must have felt the post"
    assert touched_so == pytest.approx(touched, abs=20.0 * near)
    assert other.ring_length_m == pytest.approx(first.ring_length_m, abs=near)
    assert other.stretch_m == pytest.approx(first.stretch_m, abs=near)
    assert other.heading @ turn == pytest.approx(first.heading, abs=near)
    assert leading.posture.crossing @ turn == pytest.approx(straight.posture.crossing, abs=near)
    assert leading.touch.slip_distance == pytest.approx(straight.touch.slip_distance, abs=near)
    assert leading.touch.slip_loss == pytest.approx(straight.touch.slip_loss, abs=20.0 * near)
    assert leading.elastic_energy_J() == pytest.approx(straight.elastic_energy_J(), rel=20.0 * near)


@pytest.mark.parametrize(
    ("arena", "where"),
    [
        ("pipe", "arena.kind = 'pipe'"),
        ("steps", "arena.kind = 'steps'"),
        ("rough", "arena.kind = 'rough'"),
        ("rails", "arena.rail_gap_m = "),
    ],
)
def test_what_lies_along_x_refuses_a_heading(arena: str, where: str) -> None:
    words = rf"body\.heading_deg = 30: must be 0 with {where}.*\(arena\.kind = 'floor'\)$"
    with pytest.raises(ConfigError, match=words):
        load_config("riddle2025", {"body.heading_deg": 30.0}, arena=arena)
    assert load_config("riddle2025", {"body.heading_deg": 30.0}, arena="slope").arena


def test_keyframes_cannot_hold_a_turned_worm() -> None:
    with pytest.raises(ConfigError, match=r"body\.heading_deg = 30 cannot be written as MJCF"):
        mjcf_text(load_config("riddle2023-rods", {"body.heading_deg": 30.0}))


def test_an_environment_counts_its_way_where_the_worm_leads() -> None:
    told = []
    for heading in (0.0, 180.0):
        env = WormEnv("riddle2025-muscles", CHEAP_BODY | {"body.heading_deg": heading}, episode_s=2.4)
        env.reset(seed=1)
        steps = [env.step(np.eye(3, dtype=np.float32)[k // 3 % 3]) for k in range(9)]
        told.append([(reward, info["travel"], *observation) for observation, reward, _, _, info in steps])
    assert np.abs(np.array(told[0])[:, 1]).max() > 1e-3
    assert np.array(told[1]) == pytest.approx(np.array(told[0]), abs=1e-6)

"""Many worms in Gymnasium's own vector environments: each is bit for bit the worm that moves alone."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv
from worms import CHEAP, same

import annelid.environments
from annelid.environments import WormEnv

OWN: list[dict[str, Any]] = [
    CHEAP["changes"] | own
    for own in ({}, {"guard.edge_strain": 1.3e-4, "arena.friction": 0.2}, {"sensor.noise_m": 0.002})
]
"""The second worm's guard stops it now and then."""


def test_a_worm_in_a_process_of_its_own_is_bit_for_bit_the_one_that_moves_alone() -> None:
    made = [partial(WormEnv, CHEAP["preset"], own, episode_s=0.72) for own in OWN]
    envs, alone = AsyncVectorEnv(made), [one() for one in made]
    random, ended, breakdowns = np.random.default_rng(0), [False] * 3, 0
    observations, _ = envs.reset(seed=5)
    assert same(list(observations), [env.reset(seed=5 + row)[0] for row, env in enumerate(alone)])
    for _ in range(9):
        actions = random.random((3, 3)).astype(np.float32)
        observations, rewards, over, late, infos = envs.step(actions)
        for row, env in enumerate(alone):
            if ended[row]:
                # Gymnasium begins an episode anew in the step after its last one.
                assert same(observations[row], env.reset()[0])
                continue
            *expected, info = env.step(actions[row])
            assert same([observations[row], float(rewards[row]), bool(over[row]), bool(late[row])], expected)
            assert same({name: values[row] for name, values in infos.items() if name in info}, info)
            breakdowns += over[row]
        ended = (over | late).tolist()
    envs.close()
    assert breakdowns
    assert not same(observations[0], observations[2])


def test_gymnasium_makes_many_by_name() -> None:
    envs = gymnasium.make_vec("annelid/Worm-v0", num_envs=2, vectorization_mode="sync", **CHEAP)
    observations, _ = envs.reset(seed=0)
    assert observations.shape == envs.observation_space.shape
    layout, *_ = envs.get_attr("layout")  # pyright: ignore[reportAttributeAccessIssue]
    assert layout.named(observations)["touch"].shape == (2, 3, 4)
    assert envs.step(envs.action_space.sample())[0] in envs.observation_space
    envs.close()


def test_names_that_have_gone_say_what_replaced_them() -> None:
    with pytest.raises(ImportError, match=r"environments\.WormVectorEnv has been removed: .*make_vec"):
        annelid.environments.WormVectorEnv  # noqa: B018 -- the name is what is asked for
    with pytest.raises(ImportError, match=r"annelid\.simulate_batch has been removed: .*annelid\.sweep"):
        from annelid import simulate_batch  # noqa: F401

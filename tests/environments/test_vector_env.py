"""Many worms as one vector environment: each is bit for bit the single one, in every mode of beginning anew."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from worms import CHEAP, same

from annelid.environments import WormEnv, WormVectorEnv
from annelid.errors import ConfigError

N = 3
FRAIL = 1
FEW = 1.3e-4
CHANGES = [
    CHEAP["changes"] | own
    for own in ({}, {"guard.edge_strain": FEW, "arena.friction": 0.2}, {"sensor.noise_m": 0.002, "arena.friction": 1.0})
]
"""The second worm's guard stops it now and then."""
OPTIONS: dict[str, Any] = {"preset": CHEAP["preset"], "episode_s": 0.72}
MODES = list(AutoresetMode)


def batched(mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, **options: Any) -> WormVectorEnv:
    return WormVectorEnv(N, changes=CHANGES, autoreset_mode=mode, **OPTIONS, **options)


def one_by_one(mode: AutoresetMode) -> SyncVectorEnv:
    return SyncVectorEnv([lambda own=own: WormEnv(changes=own, **OPTIONS) for own in CHANGES], autoreset_mode=mode)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.value)
def test_every_worm_is_the_one_that_moves_alone(mode: AutoresetMode) -> None:
    ours, expected = batched(mode, threads=2), one_by_one(mode)
    assert ours.observation_space == expected.observation_space
    assert ours.action_space == expected.action_space
    assert ours.metadata["autoreset_mode"] is mode
    assert same(ours.reset(seed=5), expected.reset(seed=5))
    ended = np.zeros(2)
    actions = np.random.default_rng(0)
    for _ in range(16):
        action = actions.random((N, 3)).astype(np.float32)
        told, wanted = ours.step(action), expected.step(action)
        assert same(told, wanted)
        _, _, terminated, truncated, _ = told
        ended += terminated.sum(), truncated.sum()
        if mode is AutoresetMode.DISABLED and (terminated | truncated).any():
            mask = terminated | truncated
            again, wanted_again = (one.reset(options={"reset_mask": mask.copy()}) for one in (ours, expected))
            assert same(again, wanted_again)
    assert (ended > 0).all(), "worms broke down, and others ran out of time"
    ours.close()


def test_the_number_of_threads_changes_nothing() -> None:
    told = []
    for threads in (1, 2, 3):
        env = batched(threads=threads)
        env.reset(seed=[4, None, 6])
        env.reset(seed=[4, 8, 6])
        told.append([env.step(np.full((N, 3), 0.7)) for _ in range(3)])
        env.close()
    assert same(told[0], told[1])
    assert same(told[0], told[2])


def test_in_pipes_of_different_shapes_too_each_is_the_one_that_moves_alone() -> None:
    changes = [CHEAP["changes"] | {"arena.radius": radius, "arena.straight": 0.0} for radius in (0.4, 0.8)]
    ours = WormVectorEnv(2, OPTIONS["preset"], changes, arena="pipe.bend", episode_s=0.72)
    alone = [WormEnv(OPTIONS["preset"], own, arena="pipe.bend", episode_s=0.72) for own in changes]
    told = [ours.reset(seed=1)[0], *(ours.step(np.full((2, 3), 0.8))[0] for _ in range(4))]
    for worm, env in enumerate(alone):
        expected = [env.reset(seed=1 + worm)[0], *(env.step(np.full(3, 0.8))[0] for _ in range(4))]
        assert same([one[worm] for one in told], expected)
    assert not np.array_equal(told[-1][0], told[-1][1])


def test_one_that_breaks_down_leaves_the_others_alone() -> None:
    alone, beside = WormEnv(changes=CHANGES[0], **OPTIONS), batched(threads=1)
    alone.reset(seed=0)
    beside.reset(seed=0)
    for episode in beside._episodes[1:]:
        episode.worm.data.qvel[:] = np.nan  # type: ignore[attr-defined]
    beside._episodes[0].reset(np.random.default_rng())
    beside.reset(seed=0, options={"reset_mask": np.array([True, False, False])})
    expected = alone.step(np.full(3, 0.5))
    observations, rewards, terminated, _, infos = beside.step(np.full((N, 3), 0.5))
    assert terminated.tolist() == [False, True, True]
    assert np.array_equal(observations[0], expected[0])
    assert rewards[0] == expected[1]
    assert infos["stopped"][0] == ""
    assert all(infos["stopped"][1:])
    assert np.isfinite(observations).all()
    observations, rewards, terminated, _, _ = beside.step(np.full((N, 3), 0.5))
    assert not terminated.any()
    assert rewards[0] != 0.0
    assert rewards[1:].tolist() == [0.0, 0.0]
    assert np.isfinite(observations).all()


def test_gymnasium_makes_it_the_way_it_makes_others() -> None:
    envs = gymnasium.make_vec("annelid.environments:annelid/Worm-v0", num_envs=2, **CHEAP)
    assert isinstance(envs.unwrapped, WormVectorEnv)
    recorded = gymnasium.wrappers.vector.RecordEpisodeStatistics(envs)
    observations, _ = recorded.reset(seed=0)
    assert observations in envs.observation_space
    assert observations.shape == (2, envs.unwrapped.layout.size)
    recorded.step(envs.action_space.sample())
    assert len(envs.unwrapped.sensations) == 2
    recorded.close()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"num_envs": 0}, "num_envs must be at least 1, not 0"),
        ({"num_envs": 2, "changes": [{}]}, "changes has 1 mappings for num_envs = 2"),
        ({"num_envs": 2, "changes": [{}, {"body.mesh.n_helices": 6}]}, "body.mesh.n_helices is 6 for worm 1"),
        ({"autoreset_mode": "Next"}, "did you mean 'NextStep'"),
        ({"threads": 0}, "threads = 0: must be at least 1"),
        ({"render_mode": "human"}, "unknown render_mode 'human'"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_cannot_be_is_refused_in_one_sentence(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        WormVectorEnv(**options)


def test_seeds_masks_and_actions_that_do_not_fit_are_refused() -> None:
    env = batched()
    with pytest.raises(ConfigError, match="seed has 2 numbers for num_envs = 3"):
        env.reset(seed=[1, 2])
    with pytest.raises(ConfigError, match="reset_mask"):
        env.reset(options={"reset_mask": np.zeros(N, dtype=bool)})
    with pytest.raises(ConfigError, match="no option 'friction'"):
        env.reset(options={"friction": 1.0})
    env.reset(seed=0)
    with pytest.raises(ConfigError, match=r"shape \(3,\): must be \(3, 3\)"):
        env.step(np.zeros(3))

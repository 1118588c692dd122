"""One worm as an environment: what is observed, what is rewarded, how it ends, and that seeds decide it all."""

from __future__ import annotations

import importlib
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st
from worms import CHEAP, same

from annelid.body.worm import WormBody
from annelid.environments import ENVIRONMENTS, WormEnv
from annelid.environments.task import WEIGHTS
from annelid.errors import AnnelidError, ConfigError, MissingDependency
from opengl import needs_gl

TERMS = ("reward_progress", "reward_effort", "reward_slip", "reward_success", "reward_failure")


def worm_env(changes: dict[str, Any] | None = None, **options: Any) -> WormEnv:
    return WormEnv(CHEAP["preset"], CHEAP["changes"] | (changes or {}), **options)


@pytest.fixture(scope="module")
def env() -> WormEnv:
    return worm_env(episode_s=2.4)


def wave(k: int, n: int) -> np.ndarray:
    """A wave of contraction, a segment every three steps."""
    return (np.arange(n) == (k // 3) % n).astype(np.float32)


def rollout(env: WormEnv, n_steps: int, seed: int, actions: np.random.Generator) -> list[Any]:
    """All that an environment returns, through as many episodes as it takes."""
    returned: list[Any] = [env.reset(seed=seed)]
    for _ in range(n_steps):
        returned.append(env.step(actions.random(env.action_space.shape).astype(np.float32)))
        if returned[-1][2] or returned[-1][3]:
            returned.append(env.reset())
    return returned


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", sorted(ENVIRONMENTS))
def test_gymnasium_finds_nothing_to_complain_about(name: str) -> None:
    env = gymnasium.make(f"annelid.environments:annelid/{name}", **CHEAP, episode_s=0.24).unwrapped
    assert isinstance(env, WormEnv)
    check_env(env, skip_render_check=True)
    assert env.task.goal_m == (None if name == "Worm-v0" else pytest.approx(0.7))


@pytest.mark.parametrize("n_steps", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_many_steps_are_the_same_to_the_last_bit(n_steps: int) -> None:
    noisy = {"sensor.noise_m": 0.002}
    first, again = (rollout(worm_env(noisy), n_steps, 7, np.random.default_rng(1)) for _ in range(2))
    # An episode has a hundred.
    assert len(first) == n_steps + 1 + n_steps // 100
    assert same(first, again)
    assert not same(first[0][0], worm_env(noisy).reset(seed=8)[0])


def test_a_worm_at_rest_feels_nothing_and_lies_on_its_belly(env: WormEnv) -> None:
    quiet = worm_env(start_activation=0.0)
    observed = quiet.layout.named(quiet.reset(seed=0)[0])
    assert np.allclose(observed.pop("heading"), [1.0, 0.0, 0.0])
    assert np.allclose(observed.pop("upright"), [1.0, 0.0])
    assert all(np.allclose(value, 0.0) for value in observed.values())
    assert quiet.render() is None


def test_an_observation_is_what_the_worm_does(env: WormEnv) -> None:
    env.reset(seed=0)
    before = rest = env.sensation
    observed = {}
    for k in range(6):
        observation, *_, info = env.step(wave(k, 3))
        observed, felt = env.layout.named(observation), env.sensation
        assert np.allclose(observed["activation"], wave(k, 3))
        assert np.allclose(observed["stretch_strain"], felt.stretch_m / felt.rest_stretch_m - 1.0, atol=1e-6)
        assert np.allclose(
            observed["touch"], np.minimum(felt.touch_N / (env.worm.total_mass_kg * 9.80665), 2.0), atol=1e-6
        )
        assert np.allclose(observed["ring_strain"], felt.ring_length_m / rest.ring_length_m - 1.0, atol=1e-6)
        changed = (felt.ring_length_m - before.ring_length_m) / rest.ring_length_m
        assert np.allclose(observed["ring_rate"] * env.task.interval_s, changed, atol=1e-6)
        assert info["time_s"] == pytest.approx(felt.time_s)
        before = felt
    assert observed["ring_strain"].min() < -0.05


def test_progress_adds_up_to_the_way(env: WormEnv) -> None:
    _, info = env.reset(seed=0)
    rewards, terms, ended, k = [], [], False, 0
    while not ended:
        _, reward, terminated, ended, info = env.step(wave(k, 3))
        assert not terminated
        rewards.append(reward)
        terms.append([info[name] for name in TERMS])
        k += 1
    assert k == env.task.steps_per_episode == 20
    assert np.allclose(np.sum(terms, axis=1), rewards)
    progress, effort, slip, success, failure = np.sum(terms, axis=0)
    assert progress * env.task.interval_s == pytest.approx(info["travel"], rel=1e-9)
    assert effort == pytest.approx(-0.05 * k / 3)
    assert slip < 0.0
    assert success == failure == 0.0
    assert info["slip_loss_J"] > 0.0
    assert info["muscle_work_J"] != 0.0


@given(
    st.lists(st.floats(0, 1, width=32), min_size=3, max_size=3),
    st.lists(st.floats(0, 1, width=32), min_size=3, max_size=3),
)
def test_activations_go_evenly_from_one_action_to_the_next(env: WormEnv, first: list[float], then: list[float]) -> None:
    env.reset(seed=0)
    env.step(np.array(first))
    ramp = env._ramp(then)
    assert ramp.shape == (3, 3)
    assert np.array_equal(ramp[-1], then)
    assert np.allclose(np.diff(np.vstack([first, ramp]), axis=0), np.subtract(then, first) / 3)


@given(st.integers(0, 2**32 - 1))
def test_an_observation_taken_apart_and_laid_out_is_itself(env: WormEnv, seed: int) -> None:
    space = env.observation_space
    space.seed(seed)
    observation = space.sample()
    again = env.layout.packed(env.layout.named(observation))
    assert again in space
    assert np.allclose(again, observation, atol=1e-6)
    far = {entry.name: np.full(entry.shape, 99.0) for entry in env.layout.entries}
    assert np.all(env.layout.packed(far) == 1.0)


def test_terms_of_the_reward_are_in_proportion_to_their_weights() -> None:
    weights, usual = {"progress": 2, "effort": 3, "slip": 5, "failure": 7}, WEIGHTS
    found = set()
    for changes in ({}, {"guard.edge_strain": 1e-4}):
        default, weighted = worm_env(changes), worm_env(changes, weights=weights)
        for env in (default, weighted):
            env.reset(seed=3)
        before, after = (env.step(np.ones(3))[4] for env in (default, weighted))
        for name, weight in weights.items():
            term = before[f"reward_{name}"]
            assert after[f"reward_{name}"] == pytest.approx(term * weight / usual[name], rel=1e-12, abs=0.0)
            found |= {name} if term else set()
    assert found == set(weights), "each term counted once at least"


def test_a_worm_whose_numbers_run_away_ends_the_episode_and_can_begin_anew() -> None:
    frail = worm_env({"guard.edge_strain": 1e-4})
    frail.reset(seed=3)
    observation, reward, terminated, truncated, info = frail.step(np.ones(3))
    assert (terminated, truncated, info["is_success"]) == (True, False, False)
    assert "guard.edge_strain" in info["stopped"]
    assert reward == info["reward_failure"] == -10.0
    assert observation in frail.observation_space
    with pytest.raises(ConfigError, match=r"call reset\(\)"):
        frail.step(np.ones(3))
    frail.reset(seed=3)
    assert frail.step(np.ones(3))[4]["stopped"] == info["stopped"]


def test_an_engine_that_breaks_down_ends_the_episode() -> None:
    broken = worm_env()
    broken.reset(seed=0)
    broken.worm.data.qvel[:] = np.nan  # type: ignore[attr-defined]
    _, reward, terminated, _, info = broken.step(np.ones(3))
    assert terminated
    assert info["stopped"]
    assert np.isfinite(reward)
    broken.reset()
    assert not broken.step(np.ones(3))[2]


def test_the_worm_is_the_presets_at_its_own_resolution_if_wanted() -> None:
    few = {"body.mesh.n_helices": 6}
    for fidelity, step_s, elements in ((None, 0.02, 2), ("fast", 0.01, 2), ("coarse", 0.02, 1)):
        made = WormEnv(CHEAP["preset"], few, fidelity=fidelity, episode_s=0.12)
        assert made.task.config.clock.physics_timestep_s == step_s
        assert isinstance(made.task.config.body, WormBody)
        assert made.task.config.body.mesh.elements_per_side == elements
        assert made.task.moves_per_step == round(0.12 / step_s)


def test_the_body_for_learning_senses_as_the_fine_one_and_bears_random_actions() -> None:
    """With the fine body's muscles, such long steps break down in the 71st step."""
    coarse, fine = (
        WormEnv(preset, {"arena.friction": 0.6}, fidelity=None, interval_s=0.08)
        for preset in ("riddle2023-rods-coarse", "riddle2023-rods")
    )
    assert coarse.layout.entries == fine.layout.entries
    assert coarse.worm.total_mass_kg == pytest.approx(fine.worm.total_mass_kg, rel=0.02)
    coarse.reset(seed=0)
    coarse.action_space.seed(0)
    assert not any(coarse.step(coarse.action_space.sample())[2] for _ in range(75))


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"changes": {"controller.kind": "sine"}}, r"changes\['controller.kind'\] has no effect"),
    ({"changes": {"sensor.tolerance": 0.1}}, "has no effect"),
    ({"interval_s": 0.05}, "interval_s = 0.05: must be an integer multiple of clock.physics_timestep_s = 0.04"),
    ({"episode_s": 0.5}, "episode_s = 0.5: must be an integer multiple of interval_s = 0.12, for example 0.48"),
    ({"interval_s": 0.0}, "interval_s must be positive"),
    ({"weights": {"efort": 1.0}}, "did you mean 'effort'"),
    ({"weights": {"effort": -1.0}}, r"weights\['effort'\] must be at least 0, not -1.0"),
    ({"start_activation": 1.5}, "start_activation = 1.5: must be in 0 .. 1"),
    ({"fidelity": "corse"}, "did you mean 'coarse'"),
    ({"render_mode": "rgb"}, "did you mean 'rgb_array'"),
    ({"camera": "sidewards"}, "unknown camera"),
    ({"width": 0}, "width must be at least 1, not 0"),
]


def test_what_cannot_be_is_refused_in_one_sentence() -> None:
    for options, sentence in REFUSED:
        with pytest.raises(AnnelidError, match=sentence):
            worm_env(**options)
    with pytest.raises(ConfigError, match="this needs the 3D worm"):
        WormEnv("riddle2022-planar", fidelity=None)


def test_an_action_that_cannot_be_is_refused(env: WormEnv) -> None:
    env.reset(seed=0)
    for action, sentence in (
        ([0.0, 0.0], "must be \\(3,\\)"),
        ([0.0, 1.2, 0.0], r"action\[1\] = 1.2: must be in 0 .. 1"),
        ([0.0, 0.0, np.nan], r"action\[2\] = nan"),
    ):
        with pytest.raises(ConfigError, match=sentence):
            env.step(action)


def test_a_reset_has_no_options(env: WormEnv) -> None:
    with pytest.raises(ConfigError, match="no option 'friction'"):
        env.reset(options={"friction": 0.3})


def test_without_gymnasium_the_line_that_installs_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium.envs.registration", None)
    monkeypatch.delitem(sys.modules, "annelid.environments")
    with pytest.raises(MissingDependency, match="pip install 'annelid\\[gym\\]'"):
        importlib.import_module("annelid.environments")


@needs_gl
def test_a_picture_shows_the_worm_as_it_is_now() -> None:
    env = WormEnv(**CHEAP, render_mode="rgb_array", width=96, height=64)
    pictures = []
    env.reset(seed=0)
    for _ in range(2):
        pictures.append(np.array(env.render(), dtype=int))
        env.step(np.array([0.0, 1.0, 0.0]))
    env.close()
    assert pictures[0].shape == (64, 96, 3)
    assert pictures[0].std() > 5.0
    assert np.abs(pictures[0] - pictures[1]).max() > 20

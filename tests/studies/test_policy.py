"""The controller that is a network, and its training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from annelid.config import RunConfig, load_config
from annelid.errors import ConfigError
from annelid.protocols import Array
from annelid.simulation import WormPlant
from annelid_studies.policy import LARGEST, Policy, PolicyController, inputs

N = 3
RNG = np.random.default_rng(0)
WEIGHTS: dict[str, Any] = {
    "hidden": RNG.normal(size=(4, 3 * N)).round(3).tolist(),
    "hidden_bias": RNG.normal(size=4).round(3).tolist(),
    "output": RNG.normal(size=(N, 4)).round(3).tolist(),
    "output_bias": RNG.normal(size=N).round(3).tolist(),
}


def with_policy(preset: str = "riddle2023-rods", **fields: Any) -> RunConfig:
    return load_config(
        preset, {"controller": {"kind": "policy", "interval_s": 0.12, "touch_N": 0.8, **WEIGHTS, **fields}}
    )


def test_a_network_of_one_unit_is_what_a_hand_computes() -> None:
    policy = Policy(hidden=((0.5, 0.0, 0.0, -1.0, 0.0, 0.0, 0.25, 0.0, 0.0),), hidden_bias=(0.1,),
                    output=((2.0,), (0.0,), (-2.0,)), output_bias=(0.0, 0.3, 0.0))  # fmt: skip
    read = np.array([1.0, 0.0, 0.0, 0.4, 0.0, 0.0, -1.0, 0.0, 0.0])
    # tanh(0.5 - 0.4 - 0.25 + 0.1) = tanh(-0.05), and (1 + tanh x) / 2 = 1 / (1 + exp(-2 x)).
    unit = np.tanh(-0.05)
    by_hand = [1.0 / (1.0 + np.exp(-4.0 * unit)), 1.0 / (1.0 + np.exp(-0.6)), 1.0 / (1.0 + np.exp(4.0 * unit))]
    assert policy.activation(read) == pytest.approx(by_hand)


def test_the_controller_does_what_the_environment_does_with_the_same_weights() -> None:
    """Both step the same plant, so activations and lengths agree to the last bit."""
    environments = pytest.importorskip("annelid.environments")
    env = environments.WormEnv("riddle2023-rods", interval_s=0.12, start_activation=0.0)
    step_s = env.task.config.clock.physics_timestep_s
    plant = WormPlant(env.task.config)
    policy = Policy.model_validate({"touch_N": 0.8, **WEIGHTS})
    controller = PolicyController(policy, round(0.12 / step_s), N, plant.n_muscles)
    env.reset(seed=0)
    sensed, last = plant.reset(0), np.zeros(N)
    for _ in range(3):
        last = policy.activation(inputs(env.sensation, last, policy.stretch_m, policy.touch_N))
        env.step(last)
        activation: Array = np.empty(0)
        for _ in range(round(0.12 / step_s)):
            activation = controller.step(sensed)
            sensed = plant.step(activation)
        assert activation.tolist() == last.tolist()
        assert sensed.stretch_m.tolist() == env.sensation.stretch_m.tolist()
    assert np.ptp(last) > 0.01
    assert np.abs(inputs(sensed, last, 1e-6, 1e-6)).max() == LARGEST


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"hidden": [[0.0] * 8] * 4}, r"controller\.hidden\.0 has 8 numbers: must be 9"),
        ({"hidden": WEIGHTS["hidden"][:3]}, r"controller\.hidden has 3 rows: must be 4"),
        ({"output": [[0.0] * 4] * 6}, r"controller\.output has 6 rows: must be 3"),
        ({"output_bias": [0.0] * 6}, r"controller\.output_bias has 6 numbers: must be 3"),
        ({"hidden_bias": []}, r"controller\.hidden_bias is empty"),
        ({"hidden_bias": [0.0, 0.0, 0.0, float("nan")]}, r"hidden_bias\.3"),
        ({"interval_s": 0.0123}, r"interval_s = 0\.0123: must be a multiple .* for example 0\.012"),
        ({"preset": "boxerbaum2012"}, "senses touch"),
    ],
)
def test_weights_that_do_not_fit_the_body_are_refused(fields: dict[str, Any], says: str) -> None:
    with pytest.raises(ConfigError, match=says):
        with_policy(**fields)


def test_an_interrupted_training_ends_with_the_same_policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3")
    from annelid_studies.challenge import learning
    from annelid_studies.challenge.tasks import read_entrants

    short = {"PIECE": 8, "EPISODE_STEPS": 3, "WAVES": 3, "IMITATION": 20, "CRITIC_FIRST": 2}
    for name, value in short.items():
        monkeypatch.setattr(learning, name, value)
    stopped = learning.Learner("six", tmp_path / "stopped" / "training" / "six").learn(8)
    assert next(stopped).steps == 0
    written = {}
    for folder in ("stopped", "whole"):
        path, curve, figure = learning.train(["six"], 8, tmp_path / folder)
        assert figure.exists()
        written[folder] = (path.read_text(), curve.read_text())
    assert written["stopped"] == written["whole"]
    assert written["whole"][1].startswith("body,steps,training_m_per_s,level_m_per_s")
    [policy] = read_entrants(path).values()
    config = load_config("riddle2025", policy.fields("six", "level"))
    assert config.controller.kind == "policy"

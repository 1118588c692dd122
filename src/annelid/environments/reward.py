"""What a step of an environment is worth: progress less effort less slip, and how an episode ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from annelid.environments.task import Weights
from annelid.morphology import Array


@dataclass(frozen=True, slots=True)
class Deed:
    """What a worm has done in one step of the environment.

    Attributes:
        advance_m: How far its middle has come along its way, m.
        slid_m: Mean way that its segments have slid on the ground, m.
        action: The activations that it was given, ``(n_muscles,)``.
        passed: Whether it has come through its pipe in this step.
        broke_down: Whether its simulation broke down; then nothing else counts.
    """

    advance_m: float
    slid_m: float
    action: Array
    passed: bool
    broke_down: bool


def reward_terms(deed: Deed, weights: Weights, length_m: float, interval_s: float) -> dict[str, float]:
    """Returns the terms of the reward by name; the reward is their sum.

    Args:
        deed: What the worm has done.
        weights: Of the terms.
        length_m: Length of its body, m.
        interval_s: Time of the step, s.
    """
    lengths_per_s = 0.0 if deed.broke_down else 1.0 / (length_m * interval_s)
    effort = 0.0 if deed.broke_down else float(np.mean(deed.action * deed.action))
    return {
        "reward_progress": weights.progress * deed.advance_m * lengths_per_s,
        "reward_effort": 0.0 - weights.effort * effort,
        "reward_slip": 0.0 - weights.slip * deed.slid_m * lengths_per_s,
        "reward_success": weights.success * float(deed.passed),
        "reward_failure": 0.0 - weights.failure * float(deed.broke_down),
    }

"""A controller that is a small network without memory, trained by reinforcement learning (`learning`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from annelid.clock import SLACK_S
from annelid.config import ControllerKind, Positive
from annelid.control import SegmentController, lengthening_m
from annelid.protocols import SIDES, Array, Plant, Sensation

if TYPE_CHECKING:
    from annelid.config import RunConfig

BELLY = SIDES.index("belly")
LARGEST = 3.0
"""Inputs are clipped to this size."""
STRETCH_M, TOUCH_N = 0.03, 1.0
Weight = Annotated[float, Field(ge=-1000, le=1000)]
Weights = tuple[tuple[Weight, ...], ...]


def inputs(sensation: Sensation, last: Array, stretch_m: float, touch_N: float) -> Array:
    """Returns what a policy reads, shape ``(3 n_segments,)``.

    Args:
        sensation: What the body senses.
        last: Last activation of every segment that the policy asked for, ``(n_segments,)``.
        stretch_m: Lengthening that counts as 1.
        touch_N: Force on a belly that counts as 1.

    Returns:
        Lengthening of every segment beyond its length at rest, force on its belly, and its last activation from -1 to
        1, each for all segments, none larger than `LARGEST`.
    """
    longer = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m) / stretch_m
    return np.clip(np.concatenate([longer, sensation.touch_N[:, BELLY] / touch_N, 2.0 * last - 1.0]), -LARGEST, LARGEST)


class Policy(ControllerKind):
    """Closed loop: a network of one hidden layer from stretch, touch and its last output to activation.

    Every ``interval_s`` it computes ``h = tanh(hidden x + hidden_bias)`` and the activations
    ``(1 + tanh(output h + output_bias)) / 2``, to which activation goes evenly until the next time. Its inputs x are
    those of `inputs`. `annelid study challenge --train` finds the weights.
    """

    kind: Literal["policy"] = "policy"
    interval_s: Positive = Field(default=0.12, description="time between decisions, a multiple of the control timestep")
    stretch_m: Positive = Field(default=STRETCH_M, description="lengthening of a segment that is an input of 1")
    touch_N: Positive = Field(default=TOUCH_N, description="force on a segment's belly that is an input of 1")
    hidden: Weights = Field(description="weights of the hidden units: a row each, a column per input")
    hidden_bias: tuple[Weight, ...] = Field(description="bias of every hidden unit")
    output: Weights = Field(description="weights of the outputs: a row for each segment, a column per hidden unit")
    output_bias: tuple[Weight, ...] = Field(description="bias of every output")

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has a skin, that the weights fit it, and the interval the control timestep."""
        n, n_hidden = config.body.n_segments, len(self.hidden_bias)
        if not config.body.has_skin:
            raise ValueError(
                "controller.kind = 'policy' senses touch, which this body does not: use body.kind = 'worm'"
            )
        if not n_hidden:
            raise ValueError("controller.hidden_bias is empty: give a number for each hidden unit")
        for name, rows, n_rows, n_columns in (
            ("hidden", self.hidden, n_hidden, 3 * n),
            ("output", self.output, n, n_hidden),
        ):
            if len(rows) != n_rows:
                raise ValueError(f"controller.{name} has {len(rows)} rows: must be {n_rows}")
            for i, row in enumerate(rows):
                if len(row) != n_columns:
                    raise ValueError(f"controller.{name}.{i} has {len(row)} numbers: must be {n_columns}")
        if len(self.output_bias) != n:
            raise ValueError(
                f"controller.output_bias has {len(self.output_bias)} numbers: must be {n}, one per segment"
            )

        step_s = config.clock.control_timestep_s
        steps = max(round(self.interval_s / step_s), 1)
        if abs(steps * step_s - self.interval_s) > SLACK_S:
            raise ValueError(
                f"controller.interval_s = {self.interval_s:g}: must be a multiple of clock.control_timestep_s = "
                f"{step_s:g}, for example {steps * step_s:g}"
            )

    def activation(self, read: Array) -> Array:
        """Returns the activation of every segment that the network asks for, ``(n_segments,)``."""
        hidden = np.tanh(np.array(self.hidden) @ read + self.hidden_bias)
        return 0.5 * (1.0 + np.tanh(np.array(self.output) @ hidden + self.output_bias))

    def build(self, config: RunConfig, plant: Plant) -> PolicyController:
        """Builds the controller, as `ControllerKind.build`."""
        steps = round(self.interval_s / config.clock.control_timestep_s)
        return PolicyController(self, steps, plant.n_segments, plant.n_muscles)


class PolicyController(SegmentController):
    """Decides at intervals, and goes evenly from one decision to the next."""

    name = "policy"

    def __init__(self, policy: Policy, steps: int, n_segments: int, n_muscles: int) -> None:
        """Takes the network, the control steps between its decisions, and the size of the worm."""
        super().__init__(n_segments, n_muscles)
        self._policy, self._steps = policy, steps
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the relaxed worm; nothing here is random."""
        relaxed = np.zeros(self.n_segments)
        self._now = {"since": np.array(0), "last": relaxed, "next": relaxed.copy()}

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `SegmentController.step`; lengths and touch are sensed."""
        policy, since = self._policy, int(self._now["since"]) % self._steps
        if since == 0:
            last = self._now["next"]
            read = inputs(sensation, last, policy.stretch_m, policy.touch_N)
            self._now = {"since": np.array(0), "last": last, "next": policy.activation(read)}
        share = (since + 1) / self._steps
        self._now["since"] = np.array(since + 1)
        activation = (1.0 - share) * self._now["last"] + share * self._now["next"]
        return activation.repeat(self.muscles_per_segment)

"""Open-loop controllers: a sine, segments that take turns by the clock, and contractions at given times.

They are pure functions of time, and sense nothing.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from annelid.clock import SLACK_S
from annelid.config.run import RunConfig
from annelid.config.sections import Level, NonNegative, Positive
from annelid.config.settings import Contraction
from annelid.control.base import OpenLoopController, OpenLoopKind, Slope
from annelid.errors import ConfigError
from annelid.protocols import Array, Plant


class SineWave(OpenLoopKind):
    """Open loop: a sinusoidal wave from front to rear, segment 1 contracted at the start."""

    title = "sine wave"
    tuned = ("controller.period_s=0.8:10:log", "controller.waves=1:3")
    kind: Literal["sine"] = "sine"
    period_s: Positive = Field(default=2.625, description="time of one cycle; the paper's three segments take 2.625")
    waves: Slope = Field(default=1.0, description="waves on the body at once; negative ones run forwards, 0 is no wave")
    level: Level = Field(default=1.0, description="largest activation")

    def activation(self, time_s: ArrayLike, n_segments: int) -> Array:
        """Returns ``level (1 + cos(2 pi (t / period - waves i / N))) / 2`` of segment i = 0 .. N-1."""
        turns = np.asarray(time_s, dtype=float)[..., np.newaxis] / self.period_s
        lag = self.waves * np.arange(n_segments) / n_segments
        return 0.5 * self.level * (1.0 + np.cos(2.0 * np.pi * (turns - lag)))


class TimedWave(OpenLoopKind):
    """Open loop: each segment contracts by a ramp, stays so, and relaxes by a ramp, one after another.

    The authors' patterns: "3x1" is 1 s up, 1 s hold, 1 s down, the next segment 1 s later (the defaults); "2x2" is the
    same with the next segment 2 s later and two waves at once (``interval_s = 2``, ``waves = 2``). Six segments repeat
    either every 6 s.
    """

    title = "timed wave"
    cites = (("riddle2025models", "the timed wave"),)
    tuned = (
        "controller.rise_s=0.05:2:log",
        "controller.hold_s=0.05:2:log",
        "controller.fall_s=0.05:2:log",
        "controller.interval_s=0.1:2:log",
    )
    kind: Literal["timed"] = "timed"
    rise_s: NonNegative = Field(default=1.0, description="time to contract; 0 for a step")
    hold_s: NonNegative = Field(default=1.0, description="time contracted")
    fall_s: NonNegative = Field(default=1.0, description="time to relax; 0 for a step")
    interval_s: Positive = Field(default=1.0, description="the next segment begins this much later")
    waves: int = Field(
        default=1, ge=1, le=100, description="waves on the body at once; the cycle is n_segments interval_s over this"
    )
    level: Level = Field(default=1.0, description="activation while contracted")

    @model_validator(mode="after")
    def _it_contracts(self) -> Self:
        if self.rise_s + self.hold_s + self.fall_s == 0:
            raise ValueError("controller.rise_s, hold_s and fall_s are all 0: the segments would never contract")
        return self

    def cycle_s(self, n_segments: int) -> float:
        """Returns the time after which the pattern repeats, s."""
        return n_segments * self.interval_s / self.waves

    def build(self, config: RunConfig, plant: Plant) -> OpenLoopController:
        """Builds the controller, as `ControllerKind.build`.

        Raises:
            ConfigError: A segment would have to begin again before it has relaxed.
        """
        cycle_s, turn_s = self.cycle_s(plant.n_segments), self.rise_s + self.hold_s + self.fall_s
        if turn_s > cycle_s + SLACK_S:
            raise ConfigError(
                f"controller.rise_s + hold_s + fall_s = {turn_s:g}: must be at most {cycle_s:g} s, the cycle of "
                f"{plant.n_segments} segments with interval_s = {self.interval_s:g} and waves = {self.waves}"
            )
        return super().build(config, plant)

    def activation(self, time_s: ArrayLike, n_segments: int) -> Array:
        """Returns the activation of every segment at times, as `OpenLoopKind.activation`.

        Segment i begins first at ``i interval_s`` modulo the cycle, and once per cycle from then on; it is at rest
        before.
        """
        cycle = self.cycle_s(n_segments)
        start = np.array([segment * self.interval_s % cycle for segment in range(n_segments)])
        start[cycle - start < SLACK_S] = 0.0
        since_first = np.asarray(time_s, dtype=float)[..., np.newaxis] - start + SLACK_S
        since = np.where(since_first >= 0, since_first % cycle, np.inf) - SLACK_S
        release = self.rise_s + self.hold_s
        up = since / self.rise_s if self.rise_s else (since >= -SLACK_S).astype(float)
        down = 1.0 - (since - release) / self.fall_s if self.fall_s else (since < release - SLACK_S).astype(float)
        return self.level * np.clip(np.minimum(up, down), 0.0, 1.0)


class Program(OpenLoopKind):
    """Open loop: contractions at times that are given beforehand, whatever the sensors read.

    Where contractions of one segment overlap, the larger activation wins.
    """

    title = "program of contractions"
    kind: Literal["program"] = "program"
    contractions: tuple[Contraction, ...] = Field(description="segment, start_s, stop_s and activation of each")
    ramp_s: NonNegative = Field(default=0.0, description="time that a rise or fall between 0 and the full level takes")

    @property
    def scheduled(self) -> tuple[Contraction, ...]:
        """As `contractions`."""
        return self.contractions

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has the segments that contract."""
        n_segments = config.body.n_segments
        for i, contraction in enumerate(self.contractions):
            if contraction.segment > n_segments:
                raise ValueError(
                    f"controller.contractions.{i}.segment = {contraction.segment}: must be in 1 .. {n_segments}, the "
                    "segments of the body"
                )

    def activation(self, time_s: ArrayLike, n_segments: int) -> Array:
        """Returns the activation of every segment at times, as `OpenLoopKind.activation`.

        A contraction's activation rises from its start on and falls from its stop on, both at its level per ``ramp_s``;
        one that is shorter than the ramp falls from what it has reached. Without a ramp it is at its level from start
        to stop, start included, stop not. Where contractions overlap, the larger wins.
        """
        times, ramp = np.asarray(time_s, dtype=float), self.ramp_s
        activation = np.zeros((*times.shape, n_segments))
        for contraction in self.contractions:
            of_segment = activation[..., contraction.segment - 1]
            since_start, since_stop = times - contraction.start_s, times - contraction.stop_s
            if ramp > 0:
                reached = min(1.0, (contraction.stop_s - contraction.start_s) / ramp)
                share = np.clip(np.minimum(since_start, reached * ramp - since_stop) / ramp, 0.0, 1.0)
            else:
                share = (since_start >= -SLACK_S) & (since_stop < -SLACK_S)
            np.maximum(of_segment, contraction.activation * share, out=of_segment)
        return activation

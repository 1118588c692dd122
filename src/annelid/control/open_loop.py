"""Open-loop controllers: a sine, segments that take turns by the clock, and contractions at given times.

They are pure functions of time, and sense nothing.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from annelid.clock import SLACK_S
from annelid.config.run import ControllerKind, RunConfig
from annelid.config.sections import Level, NonNegative, Positive
from annelid.config.settings import Contraction
from annelid.control.base import OpenLoopController, Slope
from annelid.errors import ConfigError
from annelid.protocols import Array, Plant


class SineWave(ControllerKind):
    """Open loop: a sinusoidal wave from front to rear, segment 1 contracted at the start."""

    tuned = ("controller.period_s=0.8:10:log", "controller.waves=1:3")
    kind: Literal["sine"] = "sine"
    period_s: Positive = Field(default=2.625, description="time of one cycle; the paper's three segments take 2.625")
    waves: Slope = Field(default=1.0, description="waves on the body at once; negative ones run forwards, 0 is no wave")
    level: Level = Field(default=1.0, description="largest activation")

    def build(self, config: RunConfig, plant: Plant) -> SineController:
        """Builds the controller, as `ControllerKind.build`."""
        return SineController(self, plant.n_segments, plant.n_muscles)


class SineController(OpenLoopController[SineWave]):
    """A sinusoidal wave, open loop: the classical controller that oscillators with feedback are compared with.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment.
    """

    name = "sine wave"

    def activation(self, time_s: ArrayLike) -> Array:
        """Returns the activation at times.

        Args:
            time_s: Simulated times, s, any shape.

        Returns:
            ``level (1 + cos(2 pi (t / period - waves i / N))) / 2`` of segment i = 0 .. N-1, in [0, level], shape
            ``(*time_s.shape, n_segments)``.
        """
        wave, n = self.pattern, self.n_segments
        turns = np.asarray(time_s, dtype=float)[..., np.newaxis] / wave.period_s
        lag = wave.waves * np.arange(n) / n
        return 0.5 * wave.level * (1.0 + np.cos(2.0 * np.pi * (turns - lag)))


class TimedWave(ControllerKind):
    """Open loop: each segment contracts by a ramp, stays so, and relaxes by a ramp, one after another.

    The authors' patterns: "3x1" is 1 s up, 1 s hold, 1 s down, the next segment 1 s later (the defaults); "2x2" is the
    same with the next segment 2 s later and two waves at once (``interval_s = 2``, ``waves = 2``). Six segments repeat
    either every 6 s.
    """

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

    def build(self, config: RunConfig, plant: Plant) -> TimedController:
        """Builds the controller, as `ControllerKind.build`."""
        return TimedController(self, plant.n_segments, plant.n_muscles)


class TimedController(OpenLoopController[TimedWave]):
    """Segments that take turns by the clock, open loop.

    Attributes:
        cycle_s: Time after which the pattern repeats, s.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment, or a segment that would have to begin again
            before it has relaxed.
    """

    name = "timed wave"

    def __init__(self, pattern: TimedWave, n_segments: int, n_muscles: int) -> None:
        """Builds the controller from the same as `OpenLoopController`."""
        super().__init__(pattern, n_segments, n_muscles)
        self.cycle_s = n_segments * pattern.interval_s / pattern.waves
        turn = pattern.rise_s + pattern.hold_s + pattern.fall_s
        if turn > self.cycle_s + SLACK_S:
            raise ConfigError(
                f"controller.rise_s + hold_s + fall_s = {turn:g}: must be at most {self.cycle_s:g} s, the cycle of "
                f"{n_segments} segments with interval_s = {pattern.interval_s:g} and waves = {pattern.waves}"
            )

    def activation(self, time_s: ArrayLike) -> Array:
        """Returns the activation at times.

        Segment i begins first at ``i interval_s`` modulo the cycle, and once per cycle from then on; it is at rest
        before.

        Args:
            time_s: Simulated times, s, any shape.

        Returns:
            Activation of each segment in [0, level], ``(*time_s.shape, n_segments)``.
        """
        wave, cycle = self.pattern, self.cycle_s
        start = np.array([segment * wave.interval_s % cycle for segment in range(self.n_segments)])
        start[cycle - start < SLACK_S] = 0.0
        since_first = np.asarray(time_s, dtype=float)[..., np.newaxis] - start + SLACK_S
        since = np.where(since_first >= 0, since_first % cycle, np.inf) - SLACK_S
        release = wave.rise_s + wave.hold_s
        up = since / wave.rise_s if wave.rise_s else (since >= -SLACK_S).astype(float)
        down = 1.0 - (since - release) / wave.fall_s if wave.fall_s else (since < release - SLACK_S).astype(float)
        return wave.level * np.clip(np.minimum(up, down), 0.0, 1.0)


class Program(ControllerKind):
    """Open loop: contractions at times that are given beforehand, whatever the sensors read.

    Where contractions of one segment overlap, the larger activation wins.
    """

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

    def build(self, config: RunConfig, plant: Plant) -> ProgramController:
        """Builds the controller, as `ControllerKind.build`."""
        return ProgramController(self, plant.n_segments, plant.n_muscles)


class ProgramController(OpenLoopController[Program]):
    """Contracts segments at times that are given beforehand.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment, or a contraction of a segment that the
            worm does not have.
    """

    name = "program of contractions"

    def __init__(self, pattern: Program, n_segments: int, n_muscles: int) -> None:
        """Builds the controller from the same as `OpenLoopController`."""
        last = max((contraction.segment for contraction in pattern.contractions), default=0)
        if last > n_segments:
            raise ConfigError(f"a contraction is of segment {last}, but the worm has segments 1 .. {n_segments}")
        super().__init__(pattern, n_segments, n_muscles)

    def activation(self, time_s: ArrayLike) -> Array:
        """Returns the activation at times.

        A contraction's activation rises from its start on and falls from its stop on, both at its level per ``ramp_s``;
        one that is shorter than the ramp falls from what it has reached. Without a ramp it is at its level from start
        to stop, start included, stop not. Where contractions overlap, the larger wins.

        Args:
            time_s: Simulated times, s, any shape.

        Returns:
            Activation of each segment in [0, 1], shape ``(*time_s.shape, n_segments)``.
        """
        times, ramp = np.asarray(time_s, dtype=float), self.pattern.ramp_s
        activation = np.zeros((*times.shape, self.n_segments))
        for contraction in self.pattern.contractions:
            of_segment = activation[..., contraction.segment - 1]
            since_start, since_stop = times - contraction.start_s, times - contraction.stop_s
            if ramp > 0:
                reached = min(1.0, (contraction.stop_s - contraction.start_s) / ramp)
                share = np.clip(np.minimum(since_start, reached * ramp - since_stop) / ramp, 0.0, 1.0)
            else:
                share = (since_start >= -SLACK_S) & (since_stop < -SLACK_S)
            np.maximum(of_segment, contraction.activation * share, out=of_segment)
        return activation

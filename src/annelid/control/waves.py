"""Open-loop waves: a sine, and segments that take turns by the clock. Pure functions of time, which feel nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.config import SineWave, TimedWave
from annelid.control.muscles import muscles_a_segment
from annelid.errors import ConfigError
from annelid.protocols import Array, Recordable, Sensation, State

# Half a microsecond, half the shortest time step: sums of time steps miss the moments of a pattern by rounding.
_SLACK_S = 5e-7


def sine_activation(wave: SineWave, n_segments: int, time_s: ArrayLike) -> Array:
    """Returns the activation of a sinusoidal wave.

    Args:
        wave: Its section of the configuration.
        n_segments: Segments N of the worm.
        time_s: Simulated times, s, any shape.

    Returns:
        ``level (1 + cos(2 pi (t / period - waves i / N))) / 2`` of segment i = 0 .. N-1, in [0, level], shape
        ``(*time_s.shape, n_segments)``.
    """
    turns = np.asarray(time_s, dtype=float)[..., np.newaxis] / wave.period_s
    lag = wave.waves * np.arange(n_segments) / n_segments
    return 0.5 * wave.level * (1.0 + np.cos(2.0 * np.pi * (turns - lag)))


def timed_cycle_s(wave: TimedWave, n_segments: int) -> float:
    """Returns the time after which a timed pattern repeats, s."""
    return n_segments * wave.interval_s / wave.waves


def timed_activation(wave: TimedWave, n_segments: int, time_s: ArrayLike) -> Array:
    """Returns the activation of a timed pattern: up, hold, down, and the next segment ``interval_s`` later.

    Segment i begins first at ``i interval_s`` modulo the cycle, `timed_cycle_s`, and once a cycle from then on; it is
    at rest before.

    Args:
        wave: Its section of the configuration.
        n_segments: Segments of the worm.
        time_s: Simulated times, s, any shape.

    Returns:
        Activation of each segment in [0, level], ``(*time_s.shape, n_segments)``.
    """
    cycle = timed_cycle_s(wave, n_segments)
    start = np.array([segment * wave.interval_s % cycle for segment in range(n_segments)])
    start[cycle - start < _SLACK_S] = 0.0
    since_first = np.asarray(time_s, dtype=float)[..., np.newaxis] - start + _SLACK_S
    since = np.where(since_first >= 0, since_first % cycle, np.inf) - _SLACK_S
    release = wave.rise_s + wave.hold_s
    up = since / wave.rise_s if wave.rise_s else (since >= -_SLACK_S).astype(float)
    down = 1.0 - (since - release) / wave.fall_s if wave.fall_s else (since < release - _SLACK_S).astype(float)
    return wave.level * np.clip(np.minimum(up, down), 0.0, 1.0)


class _Wave:
    """What open-loop waves share: no state, nothing to record, nothing random."""

    name: str

    def __init__(self, activation: Callable[[float], Array], n_segments: int, n_muscles: int) -> None:
        self._activation = activation
        self._muscles_a_segment = muscles_a_segment(n_segments, n_muscles)

    def reset(self, seed: int) -> None:
        """Does nothing: there is no state, and nothing is random."""

    def step(self, sensation: Sensation) -> Array:
        """Returns the activation of the step that begins now.

        Args:
            sensation: Its time is used, and nothing else.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``; both halves of a ring alike.
        """
        return self._activation(sensation.time_s).repeat(self._muscles_a_segment)

    def recordable(self) -> Recordable:
        """Names the controller; it has no signals, as its activation is recorded anyway."""
        return Recordable(attrs={"controller": self.name})

    def read(self, frame: bool) -> Mapping[str, NDArray[np.generic] | float]:
        """Reads nothing, as `recordable` names nothing."""
        return {}

    def get_state(self) -> State:
        """Returns nothing: the next step depends on time alone."""
        return {}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned: nothing."""


class SineController(_Wave):
    """A sinusoidal wave, open loop: the classical controller that oscillators with feedback are compared with.

    Raises:
        ConfigError: Muscles that are neither one nor two a segment.
    """

    name = "sine wave"

    def __init__(self, wave: SineWave, n_segments: int, n_muscles: int) -> None:
        """Builds the controller.

        Args:
            wave: Its section of the configuration.
            n_segments: Segments of the worm.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
        """
        super().__init__(lambda time_s: sine_activation(wave, n_segments, time_s), n_segments, n_muscles)


class TimedController(_Wave):
    """Segments that take turns by the clock, open loop.

    Raises:
        ConfigError: Muscles that are neither one nor two a segment, or a segment that would have to begin again
            before it has let go.
    """

    name = "timed wave"

    def __init__(self, wave: TimedWave, n_segments: int, n_muscles: int) -> None:
        """Builds the controller.

        Args:
            wave: Its section of the configuration.
            n_segments: Segments of the worm.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
        """
        super().__init__(lambda time_s: timed_activation(wave, n_segments, time_s), n_segments, n_muscles)
        turn, cycle = wave.rise_s + wave.hold_s + wave.fall_s, timed_cycle_s(wave, n_segments)
        if turn > cycle + _SLACK_S:
            raise ConfigError(
                f"controller.rise_s + hold_s + fall_s = {turn:g}: must be at most {cycle:g} s, the cycle of "
                f"{n_segments} segments with interval_s = {wave.interval_s:g} and waves = {wave.waves}"
            )

"""The stretch sensor: which segments are back at rest length."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from annelid.clock import SLACK_S
from annelid.config.settings import StretchSensor as StretchSettings
from annelid.errors import require_at_least
from annelid.protocols import Array


def lengthening_m(stretch_m: Array, rest_stretch_m: Array) -> Array:
    """Returns by how much each segment's mean length exceeds that at rest, m, the same bits for one and many copies.

    Args:
        stretch_m: Lengths of every segment's springs, m, shape ``(.., n_segments, n_sensors)``.
        rest_stretch_m: Their lengths at rest, m, same shape.
    """
    # In one memory layout, whatever that of the lengths: the order of a sum depends on it.
    return np.subtract(stretch_m, rest_stretch_m, order="C").sum(axis=-1) / stretch_m.shape[-1]


class StretchSensor:
    """A threshold on each segment's mean length, on while it is at most the tolerance beyond rest.

    With hysteresis a sensor that is on stays on until the segment is that much longer still. Segment 1's
    sensor is kept off at the start: its network starts contracted, and its body does not. Riddle et al. 2023.

    Attributes:
        settings: Its section of the configuration.
        on: Which segments' sensors are on, shape ``(n_segments,)``; all off before the first reading.

    Raises:
        ConfigError: Fewer than one segment.
    """

    def __init__(self, settings: StretchSettings, n_segments: int) -> None:
        """Makes a sensor.

        Args:
            settings: Its section of the configuration.
            n_segments: Segments.
        """
        require_at_least(1, n_segments=n_segments)
        self.settings = settings
        self.on: NDArray[np.bool_] = np.zeros(n_segments, dtype=bool)

    def reset(self) -> None:
        """Switches every sensor off, as before the first reading."""
        self.on[:] = False

    def read(self, stretch_m: Array, rest_stretch_m: Array, time_s: float) -> NDArray[np.bool_]:
        """Reads the lengths of all segments, m, ``(n_segments, n_sensors)``, at a time, and remembers which are on."""
        longer = lengthening_m(stretch_m, rest_stretch_m)[np.newaxis]
        self.on = self.readings(self.on, longer, [time_s])[0]
        return self.on.copy()

    def readings(self, before: NDArray[np.bool_], longer_m: Array, times_s: Sequence[float]) -> NDArray[np.bool_]:
        """Returns which sensors are on at some instants, of any number of copies at once.

        Args:
            before: Which sensors were on at the reading before, ``(.., n_segments)``.
            longer_m: By how much each segment's mean length exceeds that at rest, m, ``(n_times, .., n_segments)``.
            times_s: Simulated times of the readings, s.

        Returns:
            True for every segment that is at most the tolerance (with hysteresis, if it was on) longer than at rest,
            ``(n_times, .., n_segments)``.
        """
        tolerance, hysteresis = self.settings.tolerance_m, self.settings.hysteresis_m
        on: NDArray[np.bool_] = longer_m <= tolerance
        held = sum(map(self.held_at, times_s))
        on[:held, ..., 0] = False
        if hysteresis:
            for number, longer in enumerate(longer_m):
                on[number] = longer <= tolerance + hysteresis * before
                if number < held:
                    on[number, ..., 0] = False
                before = on[number]
        return on

    def held_at(self, time_s: float) -> bool:
        """Whether segment 1's sensor is kept off at a time, s; while this and the lengths stay, so does the reading."""
        return time_s < self.settings.startup_hold_s - SLACK_S

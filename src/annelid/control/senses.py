"""What a body senses, and how each of it becomes the current of a network's input."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from annelid.errors import ConfigError, shown, suggest
from annelid.protocols import SIDES, Array, Sensation


class Sensed(NamedTuple):
    """A quantity that a network may sense, and a microcontroller is given."""

    meaning: str
    shape: Callable[[int], tuple[int, ...]]  # of its numbers, for a number of segments
    read: Callable[[Sensation], Array]


def lengthening_m(stretch_m: Array, rest_stretch_m: Array) -> Array:
    """Returns by how much each segment's mean length exceeds that at rest, m.

    Args:
        stretch_m: Lengths of every segment's springs, m, shape ``(.., n_segments, n_sensors)``.
        rest_stretch_m: Their lengths at rest, m, same shape.
    """
    # In one memory layout, whatever that of the lengths: the order of a sum depends on it.
    return np.subtract(stretch_m, rest_stretch_m, order="C").sum(axis=-1) / stretch_m.shape[-1]


def heading_angle(heading: Array) -> float:
    """Returns the direction of a heading on the floor, rad: 0 towards -x, positive to the worm's left, towards -y."""
    return math.atan2(-float(heading[1]), -float(heading[0]))


SENSED: dict[str, Sensed] = {
    "lengthening_m": Sensed(
        "mean length of each segment's stretch sensors beyond that at rest, m",
        lambda n_segments: (n_segments,),
        lambda s: lengthening_m(s.stretch_m, s.rest_stretch_m),
    ),
    "touch_N": Sensed(
        "force of the ground on belly, left, back and right of each segment, N",
        lambda n_segments: (n_segments, len(SIDES)),
        lambda s: s.touch_N,
    ),
    "heading_rad": Sensed(
        "direction from the last ring to the first, 0 towards -x, positive to the left",
        lambda n_segments: (1,),
        lambda s: np.array([heading_angle(s.heading)]),
    ),
    "front_m": Sensed("x and y of the first ring, m", lambda n_segments: (2,), lambda s: s.front_m[:2]),
}
"""What the C code of controllers is given, by the names of its fields."""


def _require_sensed(quantity: str) -> None:
    if quantity not in SENSED:
        raise ConfigError(f"unknown quantity {shown(quantity)}: {suggest(quantity, SENSED)}")


@dataclass(frozen=True, slots=True)
class Sense:
    """A current that rises linearly with what the body senses: ``gain (value - threshold) / span``, within bounds.

    Attributes:
        quantity: ``"lengthening_m"``, ``"touch_N"``, ``"heading_rad"`` or ``"front_m"``.
        place: Which of its numbers: the segment, counted from 0, and for touch also the side, as in
            `annelid.protocols.SIDES`. Several numbers are added: touch without a side is the load of a segment.
        gain: nA for a change of the value by the span.
        threshold: Value at which the current is 0.
        span: In the unit of the quantity.
        least_nA: Smallest current.
        most_nA: Largest current.
        from_s: Time until which there is no current.

    Raises:
        ConfigError: An unknown quantity, bounds in the wrong order, or no span.
    """

    quantity: str
    place: int | tuple[int, ...]
    gain: float
    threshold: float = 0.0
    span: float = 1.0
    least_nA: float = 0.0
    most_nA: float = float("inf")
    from_s: float = 0.0

    def __post_init__(self) -> None:
        _require_sensed(self.quantity)
        if not self.least_nA <= self.most_nA:
            raise ConfigError(f"least_nA = {self.least_nA:g} must be at most most_nA = {self.most_nA:g}")
        if not self.span:
            raise ConfigError("span must not be 0")

    @classmethod
    def between(
        cls, quantity: str, place: int | tuple[int, ...], low: float, high: float, full_nA: float, from_s: float = 0.0
    ) -> Sense:
        """Returns a sense whose current rises from 0 at the value ``low`` to ``full_nA`` at ``high`` and beyond."""
        return cls(quantity, place, full_nA, low, high - low, 0.0, full_nA, from_s)


@dataclass(frozen=True, slots=True)
class Switch:
    """A current that is on while something that the body senses is at most a threshold.

    Attributes:
        quantity: As of a `Sense`.
        place: As of a `Sense`.
        threshold: Value up to which it switches on.
        current_nA: Current while it is on.
        hysteresis: How far beyond the threshold it stays on.
        from_s: Time until which it is off.

    Raises:
        ConfigError: An unknown quantity.
    """

    quantity: str
    place: int | tuple[int, ...]
    threshold: float
    current_nA: float
    hysteresis: float = 0.0
    from_s: float = 0.0

    def __post_init__(self) -> None:
        _require_sensed(self.quantity)


@dataclass(frozen=True, slots=True)
class Pulse:
    """A current that is on from the start until a time.

    Attributes:
        current_nA: Current.
        until_s: Time from which there is none.
    """

    current_nA: float
    until_s: float


Source: TypeAlias = Sense | Switch | Pulse | float | Callable[[Sensation], float]
"""What sets the current of an input; a number is a constant current, nA. A function of Python is not written as C."""

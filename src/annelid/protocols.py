"""The two protocols, Plant and Controller, and the data that passes between them.

Any body (2D or 3D) is a `Plant`, anything that turns sensation into activation is a `Controller`.
Both may also be *recordable* (they name signals for the run file) and *stateful* (they can be saved
and restored bit for bit), and take several control steps at a *stride* while the body rests; the simulation asks for
those capabilities and does without where they are absent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "SIDES",
    "Array",
    "Controller",
    "Doubtful",
    "MultiRatePlant",
    "Plant",
    "Recordable",
    "Records",
    "SavedAndRecorded",
    "Sensation",
    "Signal",
    "State",
    "Stateful",
    "Stoppable",
    "StridingController",
    "Values",
    "Watched",
]

Array = NDArray[np.float64]
State = dict[str, NDArray[np.generic]]
"""Named arrays whose shapes and dtypes never change during a run."""
Values = Mapping[str, NDArray[np.generic] | float]
"""Present values of signals, by name."""
SIDES = ("belly", "left", "back", "right")
"""Sides of a segment, quarters of its skin; as the worm leads towards -x on its belly, its left is -y."""


@dataclass(frozen=True, slots=True)
class Sensation:
    """What the body senses at one instant; its receiver may keep the arrays but must not write to them.

    Attributes:
        time_s: Simulated time, s.
        stretch_m: Lengths of the stretch sensors, m, shape ``(n_segments, n_sensors)``.
        rest_stretch_m: Their lengths at rest, m, same shape.
        ring_length_m: Length of every ring muscle, m, shape ``(n_muscles,)``.
        muscle_force_N: Contractile force of every ring muscle, N, positive when it pulls, ``(n_muscles,)``.
        contact_force_N: Force of the ground on each segment, N, ``(n_segments, 3)``; zeros without ground.
        center_of_mass_m: Centre of mass, m, shape ``(3,)``; planar worms use the first component.
        touch_N: Normal force of the ground on each side of every segment, N, ``(n_segments, 4)`` in the order of
            `SIDES`; ``(0, 4)`` for a body that has no skin.
        front_m: Centre of the foremost ring, m, ``(3,)``; NaN for a body that has none.
        heading: Unit vector from the centre of the last ring to that of the foremost, ``(3,)``; NaN likewise.
        stretch_rate_m_per_s: How fast the stretch sensors lengthen, shape of ``stretch_m``, by which later sensations
            carry that on until the body moves next; ``(0, 0)`` where it stays.
    """

    time_s: float
    stretch_m: Array
    rest_stretch_m: Array
    ring_length_m: Array
    muscle_force_N: Array
    contact_force_N: Array
    center_of_mass_m: Array
    touch_N: Array = field(default_factory=lambda: np.zeros((0, len(SIDES))))
    front_m: Array = field(default_factory=lambda: np.full(3, np.nan))
    heading: Array = field(default_factory=lambda: np.full(3, np.nan))
    stretch_rate_m_per_s: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def later(self, time_s: float) -> Sensation:
        """Returns what is sensed at a later time, s, if the body does not move in between."""
        if not self.stretch_rate_m_per_s.size:
            return replace(self, time_s=time_s)
        stretch = self.stretch_m + (time_s - self.time_s) * self.stretch_rate_m_per_s
        return replace(self, time_s=time_s, stretch_m=stretch)


class Plant(Protocol):
    """A worm's body: muscle activation in, sensation out, one control step at a time."""

    @property
    def n_segments(self) -> int:
        """Number of actuated segments."""
        ...

    @property
    def n_muscles(self) -> int:
        """Number of ring muscles: one per segment, or two with half-rings (left, right, segment by segment)."""
        ...

    def reset(self, seed: int) -> Sensation:
        """Returns to the initial posture at time zero, and the first sensation."""
        ...

    def step(self, activation: Array) -> Sensation:
        """Advances by one control step.

        Args:
            activation: Muscle activation, each in [0, 1], shape ``(n_muscles,)``.

        Returns:
            What the body senses at the end of the step.
        """
        ...


class Controller(Protocol):
    """Anything that turns sensation into muscle activation."""

    def reset(self, seed: int) -> None:
        """Returns to the initial state; ``seed`` fixes every random draw that follows."""
        ...

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step.

        Args:
            sensation: What the body senses at its beginning.

        Returns:
            Muscle activation in [0, 1], shape ``(n_muscles,)``.
        """
        ...


@runtime_checkable
class MultiRatePlant(Protocol):
    """The capability of a plant that may be slower than the control clock of saying when it moves next."""

    def steps_to_move(self) -> int:
        """Returns the control steps to the end of the next one in which the body moves, at least 1.

        Until then the sensation stays what it is, but for its time and the stretch that is carried on.
        """
        ...

    def stride(self, activation: Array) -> Sensation:
        """Advances by control steps, at most `steps_to_move`, as so many calls of ``step``.

        ``activation`` is that of every step, ``(n_steps, n_muscles)``; only in the last one the body may move.
        """
        ...


@runtime_checkable
class StridingController(Protocol):
    """The capability of a controller of taking several control steps under one sensation."""

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by ``n_steps`` control steps, as so many calls of ``step``.

        ``sensation`` is that of the first step. Those of the others are what it says of later times
        (`Sensation.later`), which are multiples of the control timestep.

        Returns:
            The activation of every step, ``(n_steps, n_muscles)``.
        """
        ...


@dataclass(frozen=True, slots=True)
class Signal:
    """One variable of the run file."""

    name: str
    dims: tuple[str, ...]  # names of the dimensions after time (or frame), for example ("segment", "sensor")
    shape: tuple[int, ...]  # sizes of those dimensions
    units: str  # in the form CF uses ("m", "N", "mV", "1")
    long_name: str  # what it is, in words
    every_frame: bool = False  # recorded at frame rate (large, for pictures) instead of at the rate of the signals


@dataclass(frozen=True, slots=True)
class Recordable:
    """What a plant or a controller offers to the recorder."""

    signals: tuple[Signal, ...] = ()  # the variables
    coords: Mapping[str, Sequence[str] | Sequence[int]] = field(default_factory=dict)  # labels of dimensions by name
    attrs: Mapping[str, float | int | str] = field(default_factory=dict)  # constants, as the total mass, for the file


@runtime_checkable
class Records(Protocol):
    """The capability of naming and reading signals for the run file."""

    def recordable(self) -> Recordable:
        """Names every signal that `read` returns."""
        ...

    def read(self, frame: bool) -> Values:
        """Reads the present values: of the frame signals if ``frame``, else of all others."""
        ...


@runtime_checkable
class Stateful(Protocol):
    """The capability of being saved and continued bit for bit."""

    def get_state(self) -> State:
        """Returns copies of all that the next step depends on."""
        ...

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        ...


@runtime_checkable
class Doubtful(Protocol):
    """The capability of saying what is doubtful about a run without being fatal."""

    def doubts(self) -> tuple[str, ...]:
        """Returns a sentence for everything doubtful since time zero."""
        ...


@runtime_checkable
class Stoppable(Protocol):
    """The capability of hardware of being brought to a safe state, which comes before all else when a run ends."""

    def stop(self) -> None:
        """Stops, once; never raises."""
        ...


@runtime_checkable
class Watched(Protocol):
    """The capability of noticing that the numbers have run away."""

    def alarm(self) -> str | None:
        """Returns one sentence naming the quantity, its value and its limit, or None while all is well."""
        ...


class SavedAndRecorded:
    """Base of plants and controllers whose state is a dictionary of arrays and whose signals are listed in a table.

    Attributes:
        recorded: Name, dimensions, unit and meaning of what it may record; signals without a value are left out.
    """

    recorded: ClassVar[tuple[tuple[str, tuple[str, ...], str, str], ...]] = ()
    _now: dict[str, NDArray[Any]]

    def recordable(self) -> Recordable:
        """Names the signals that `read` returns."""
        values = self._values()
        listed = (row for row in self.recorded if row[0] in values)
        signals = (Signal(name, dims, np.shape(values[name]), units, meaning) for name, dims, units, meaning in listed)
        return Recordable(tuple(signals), self._coords(), self._attrs())

    def read(self, frame: bool) -> Values:
        """Reads the signals that `recordable` names; there are none at frame rate."""
        return {} if frame else self._values()

    def get_state(self) -> State:
        """Returns copies of all that the next step depends on."""
        return {name: array.copy() for name, array in self._now.items()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        for name, array in self._now.items():
            array[...] = state[name]

    def _values(self) -> Values:
        """Present values of all that is recorded."""
        return {}

    def _coords(self) -> dict[str, list[int] | list[str]]:
        """Labels of the signals' dimensions."""
        return {}

    def _attrs(self) -> dict[str, float | int | str]:
        """Constants worth an attribute of the run file."""
        return {}

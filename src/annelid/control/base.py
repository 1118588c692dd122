"""What controllers share: what they record, and how their segments' activation goes to the muscles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Generic, TypeVar

import numpy as np

from annelid.config.sections import Section
from annelid.errors import ConfigError
from annelid.protocols import Array, Recordable, Sensation, Signal, State, Values

Pattern = TypeVar("Pattern", bound=Section)


def muscles_per_segment(n_segments: int, n_muscles: int) -> int:
    """Returns 1 for whole rings and 2 for half-rings.

    Raises:
        ConfigError: Muscles that are neither one nor two a segment.
    """
    if n_muscles not in (n_segments, 2 * n_segments):
        raise ConfigError(
            f"n_muscles = {n_muscles} does not fit {n_segments} segments: "
            f"give {n_segments} (rings) or {2 * n_segments} (half-rings)"
        )
    return n_muscles // n_segments


class SegmentController(ABC):
    """A controller that makes one activation a segment; both halves of a ring take it alike.

    Attributes:
        name: What the run file calls it.
        recorded: Name, dimensions, unit and meaning of what it may record.

    Raises:
        ConfigError: Muscles that are neither one nor two a segment.
    """

    name: ClassVar[str]
    recorded: ClassVar[tuple[tuple[str, tuple[str, ...], str, str], ...]] = ()

    def __init__(self, n_segments: int, n_muscles: int) -> None:
        """Takes the size of the worm.

        Args:
            n_segments: Segments.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
        """
        self._n_segments = n_segments
        self._muscles_per_segment = muscles_per_segment(n_segments, n_muscles)

    @abstractmethod
    def reset(self, seed: int) -> None:
        """Returns to the initial state; ``seed`` fixes every random draw that follows."""

    @abstractmethod
    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step.

        Args:
            sensation: What the body feels at the beginning of the step.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``.
        """

    def recordable(self) -> Recordable:
        """Names the signals that `read` returns."""
        values = self._values()
        signals = (
            Signal(name, dims, np.shape(values[name]), units, meaning)
            for name, dims, units, meaning in self.recorded
            if name in values
        )
        return Recordable(tuple(signals), self._coords(), {"controller": self.name, **self._attrs()})

    def read(self, frame: bool) -> Values:
        """Reads the signals that `recordable` names; there are none at frame rate."""
        return {} if frame else self._values()

    def _values(self) -> Values:
        """Present values of all that is recorded."""
        return {}

    def _coords(self) -> dict[str, list[int] | list[str]]:
        """Labels of the signals' dimensions."""
        return {}

    def _attrs(self) -> dict[str, float]:
        """Constants worth an attribute of the run file."""
        return {}

    @abstractmethod
    def get_state(self) -> State:
        """Returns copies of all that the next step depends on."""

    @abstractmethod
    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""


class OpenLoopController(SegmentController, Generic[Pattern]):
    """Contracts segments by the clock: during the step from t to t + dt as its pattern says for t."""

    def __init__(self, pattern: Pattern, n_segments: int, n_muscles: int) -> None:
        """Takes the pattern, its section of the configuration, and the size of the worm as `SegmentController`."""
        self._pattern = pattern
        super().__init__(n_segments, n_muscles)

    @abstractmethod
    def activation(self, time_s: float) -> Array:
        """Returns the activation of every segment at a time, in [0, 1], ``(n_segments,)``."""

    def reset(self, seed: int) -> None:
        """Does nothing: there is no state, and nothing is random."""

    def step(self, sensation: Sensation) -> Array:
        """Returns the activation of the step that begins now; nothing but the time is felt."""
        return self.activation(sensation.time_s).repeat(self._muscles_per_segment)

    def get_state(self) -> State:
        """Returns nothing: the next step depends on time alone."""
        return {}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned: nothing."""

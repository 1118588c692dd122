"""What controllers share: what they record, and how their segments' activation goes to the muscles."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Generic, TypeVar

from annelid.config.sections import Section
from annelid.errors import ConfigError
from annelid.protocols import Array, Recordable, SavedAndRecorded, Sensation

Pattern = TypeVar("Pattern", bound=Section)


class SegmentController(SavedAndRecorded, ABC):
    """A controller that makes one activation per segment; both halves of a ring take it alike.

    Its state is ``_now``, a dictionary of arrays, and what it records is listed in ``recorded``, with values from
    ``_values``, labels from ``_coords`` and constants from ``_attrs``.

    Attributes:
        name: What the run file calls it.
        recorded: Name, dimensions, unit and meaning of what it may record.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment.
    """

    name: ClassVar[str]

    def __init__(self, n_segments: int, n_muscles: int) -> None:
        """Takes the size of the worm.

        Args:
            n_segments: Segments.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
        """
        if n_muscles not in (n_segments, 2 * n_segments):
            raise ConfigError(
                f"n_muscles = {n_muscles} does not fit {n_segments} segments: "
                f"give {n_segments} (rings) or {2 * n_segments} (half-rings)"
            )
        self._n_segments = n_segments
        self._muscles_per_segment = n_muscles // n_segments
        self._now = {}

    @abstractmethod
    def reset(self, seed: int) -> None:
        """Returns to the initial state; ``seed`` fixes every random draw that follows."""

    @abstractmethod
    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step.

        Args:
            sensation: What the body senses at the beginning of the step.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``.
        """

    def recordable(self) -> Recordable:
        """Names the signals that `read` returns."""
        own = super().recordable()
        return Recordable(own.signals, own.coords, {"controller": self.name, **own.attrs})


class OpenLoopController(SegmentController, Generic[Pattern]):
    """Contracts segments by the clock: during the step from t to t + dt as its pattern says for t; has no state."""

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
        """Returns the activation of the step that begins now; nothing but the time is sensed."""
        return self.activation(sensation.time_s).repeat(self._muscles_per_segment)

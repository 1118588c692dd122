"""What open-loop controllers share: they are pure functions of time, and feel nothing."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Generic, TypeVar

from annelid.config.sections import Section
from annelid.control.muscles import muscles_a_segment
from annelid.protocols import Array, Recordable, Sensation, State, Values

Pattern = TypeVar("Pattern", bound=Section)


class OpenLoopController(ABC, Generic[Pattern]):
    """Contracts segments by the clock: during the step from t to t + dt as its pattern says for t.

    Attributes:
        name: What the run file calls it.

    Raises:
        ConfigError: Muscles that are neither one nor two a segment.
    """

    name: ClassVar[str]

    def __init__(self, pattern: Pattern, n_segments: int, n_muscles: int) -> None:
        """Builds the controller.

        Args:
            pattern: Its section of the configuration.
            n_segments: Segments of the worm.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
        """
        self._pattern = pattern
        self._n_segments = n_segments
        self._muscles_a_segment = muscles_a_segment(n_segments, n_muscles)

    @abstractmethod
    def activation(self, time_s: float) -> Array:
        """Returns the activation of every segment at a time, in [0, 1], ``(n_segments,)``."""

    def reset(self, seed: int) -> None:
        """Does nothing: there is no state, and nothing is random."""

    def step(self, sensation: Sensation) -> Array:
        """Returns the activation of the step that begins now.

        Args:
            sensation: Its time is used, and nothing else.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``; both halves of a ring alike.
        """
        return self.activation(sensation.time_s).repeat(self._muscles_a_segment)

    def recordable(self) -> Recordable:
        """Names the controller; it has no signals, as its activation is recorded anyway."""
        return Recordable(attrs={"controller": self.name})

    def read(self, frame: bool) -> Values:
        """Reads nothing, as `recordable` names nothing."""
        return {}

    def get_state(self) -> State:
        """Returns nothing: the next step depends on time alone."""
        return {}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned: nothing."""

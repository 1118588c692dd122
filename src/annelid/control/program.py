"""Open loop: contractions at times laid down beforehand."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.config import Program
from annelid.control.muscles import muscles_a_segment
from annelid.errors import ConfigError
from annelid.protocols import Array, Recordable, Sensation, State

# Half a microsecond, half the shortest time step: sums of time steps miss the ends of a contraction by rounding.
_SLACK_S = 5e-7


class ProgramController:
    """Contracts segments at times laid down beforehand; a pure function of time, which feels nothing.

    During the step from t to t + dt every muscle has the activation that `program_activation` gives at t.

    Raises:
        ConfigError: Muscles that are neither one nor two a segment, or a contraction of a segment that the
            worm does not have.
    """

    def __init__(self, program: Program, n_segments: int, n_muscles: int) -> None:
        """Builds the controller.

        Args:
            program: Its section of the configuration.
            n_segments: Segments of the worm.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
        """
        last = max((contraction.segment for contraction in program.contractions), default=0)
        if last > n_segments:
            raise ConfigError(f"a contraction is of segment {last}, but the worm has segments 1 .. {n_segments}")
        self._program = program
        self._n_segments = n_segments
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
        return program_activation(self._program, self._n_segments, sensation.time_s).repeat(self._muscles_a_segment)

    def recordable(self) -> Recordable:
        """Names the controller; it has no signals, as its activation is recorded anyway."""
        return Recordable(attrs={"controller": "program of contractions"})

    def read(self, frame: bool) -> Mapping[str, NDArray[np.generic] | float]:
        """Reads nothing, as `recordable` names nothing."""
        return {}

    def get_state(self) -> State:
        """Returns nothing: the next step depends on time alone."""
        return {}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned: nothing."""


def program_activation(program: Program, n_segments: int, time_s: ArrayLike) -> Array:
    """Returns the activation that a program lays down.

    A contraction's activation rises from its start on and falls from its stop on, both at its level per
    ``ramp_s``; one that is shorter than the ramp falls from what it has reached. Without a ramp it is at its
    level from start to stop, start included, stop not. Where contractions overlap, the larger wins.

    Args:
        program: The contractions.
        n_segments: Segments of the worm.
        time_s: Simulated times, s, any shape.

    Returns:
        Activation of each segment in [0, 1], shape ``(*time_s.shape, n_segments)``.
    """
    times = np.asarray(time_s, dtype=float)
    activation = np.zeros((*times.shape, n_segments))
    for contraction in program.contractions:
        of_segment = activation[..., contraction.segment - 1]
        since_start, since_stop = times - contraction.start_s, times - contraction.stop_s
        if program.ramp_s > 0:
            reached = min(1.0, (contraction.stop_s - contraction.start_s) / program.ramp_s)
            share = np.clip(np.minimum(since_start, reached * program.ramp_s - since_stop) / program.ramp_s, 0.0, 1.0)
        else:
            share = (since_start >= -_SLACK_S) & (since_stop < -_SLACK_S)
        np.maximum(of_segment, contraction.activation * share, out=of_segment)
    return activation

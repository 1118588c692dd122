"""Turning, as a modifier of any controller: the activation of the two sides is scaled on its way to the muscles."""

from __future__ import annotations

from dataclasses import replace

from annelid.config.kinds import TurningKind
from annelid.control.base import SegmentController
from annelid.errors import ConfigError
from annelid.protocols import (
    Array,
    Controller,
    Recordable,
    Records,
    Sensation,
    Signal,
    State,
    Stateful,
    StridingController,
    Values,
    Watched,
)

HALVES = ("left", "right")
_PATTERN, _STEERING = "pattern_", "turning_"


class TurningController(SegmentController):
    """A controller whose pattern another one makes, and whose sides a steering scales.

    The pattern neither knows nor feels that it is scaled, but through the body: its rhythm is its own.

    Raises:
        ConfigError: Whole rings, or a pattern whose state cannot be saved.
    """

    def __init__(
        self,
        pattern: Controller,
        section: TurningKind,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Wraps a pattern.

        Args:
            pattern: The controller that makes it, for ``n_muscles``.
            section: How the worm turns.
            n_segments: Segments.
            n_muscles: Twice that: left, right, segment by segment.
            control_timestep_s: Control step, s.
        """
        super().__init__(n_segments, n_muscles)
        if self._muscles_per_segment != len(HALVES):
            raise ConfigError(f"turning needs half-rings: {2 * n_segments} muscles, not {n_muscles}")
        if not isinstance(pattern, Stateful):
            raise ConfigError(f"turning needs a pattern whose state can be saved, not {type(pattern).__name__}")
        self._pattern = pattern
        self._stateful: Stateful = pattern
        self._kind = section.kind
        self._steering = section.build(n_segments, control_timestep_s)
        self._timestep_s = control_timestep_s

    def reset(self, seed: int) -> None:
        """Returns to the initial state; ``seed`` is the pattern's."""
        self._pattern.reset(seed)
        self._steering.reset()

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `stride`."""
        return self.stride(sensation, 1)

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps that feel the same but for their times; the same bits as so many of `step`.

        Args:
            sensation: What the body feels at the beginning of the first step.
            n_steps: Control steps, at least 1.

        Returns:
            Activation of every muscle in [0, 1] after the last step, ``(n_muscles,)``.
        """
        scales = self._steering.advance(sensation, n_steps)
        if isinstance(self._pattern, StridingController):
            activation = self._pattern.stride(sensation, n_steps)
        else:
            first = round(sensation.time_s / self._timestep_s)
            activation = self._pattern.step(sensation)
            for later in range(1, n_steps):
                activation = self._pattern.step(replace(sensation, time_s=(first + later) * self._timestep_s))
        return (activation.reshape(scales.shape) * scales).reshape(-1)

    def recordable(self) -> Recordable:
        """Names the scales of the sides, and what the pattern names."""
        own = self._pattern.recordable() if isinstance(self._pattern, Records) else Recordable()
        shape = self._steering.scales().shape
        scale = Signal(
            "half_scale", ("segment", "half"), shape, "1", "share of its activation that half a ring is left"
        )
        return Recordable(
            signals=(*own.signals, scale),
            coords={**own.coords, "segment": list(range(1, shape[0] + 1)), "half": list(HALVES)},
            attrs={**own.attrs, "turning": self._kind},
        )

    def read(self, frame: bool) -> Values:
        """Reads the signals that `recordable` names."""
        own = self._pattern.read(frame) if isinstance(self._pattern, Records) else {}
        return own if frame else {**own, "half_scale": self._steering.scales()}

    def get_state(self) -> State:
        """Returns the states of pattern and steering."""
        pattern = {f"{_PATTERN}{name}": value for name, value in self._stateful.get_state().items()}
        return pattern | {f"{_STEERING}{name}": value for name, value in self._steering.get_state().items()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        for prefix, part in ((_PATTERN, self._stateful), (_STEERING, self._steering)):
            part.set_state(
                {name.removeprefix(prefix): value for name, value in state.items() if name.startswith(prefix)}
            )

    def alarm(self) -> str | None:
        """Returns the pattern's alarm."""
        return self._pattern.alarm() if isinstance(self._pattern, Watched) else None

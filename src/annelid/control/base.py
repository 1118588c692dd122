"""What controllers share: what they record, how they drive the muscles; and a user's own function as a controller."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from annelid.config.run import ControllerKind, RunConfig
from annelid.errors import ConfigError
from annelid.protocols import (
    Array,
    Controller,
    Plant,
    Recordable,
    Records,
    SavedAndRecorded,
    Sensation,
    State,
    Stateful,
    Values,
    Watched,
)

Slope = Annotated[float, Field(ge=-100, le=100)]
TimeConstant = Annotated[float, Field(ge=1e-3, le=1e4)]


class SegmentController(SavedAndRecorded, ABC):
    """A controller that makes one activation per segment; both halves of a ring take it alike.

    Its state is ``_now``, a dictionary of arrays, and what it records is listed in ``recorded``, with values from
    ``_values``, labels from ``_coords`` and constants from ``_attrs``.

    Attributes:
        name: What the run file calls it.
        recorded: Name, dimensions, unit and meaning of what it may record.
        n_segments: Segments.
        muscles_per_segment: 1, or 2 for half-rings.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment.
    """

    name: str

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
        self.n_segments = n_segments
        self.muscles_per_segment = n_muscles // n_segments
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


class OpenLoopKind(ControllerKind):
    """Base of the sections of open-loop controllers: they say what each segment does when, and nothing else.

    Attributes:
        title: What the run file calls the controller.
    """

    title: ClassVar[str]

    @abstractmethod
    def activation(self, time_s: ArrayLike, n_segments: int) -> Array:
        """Returns the activation of every segment at times.

        Args:
            time_s: Simulated times, s, any shape.
            n_segments: Segments.

        Returns:
            Activation in [0, 1], ``(*time_s.shape, n_segments)``.
        """

    def build(self, config: RunConfig, plant: Plant) -> OpenLoopController:
        """Builds the controller, as `ControllerKind.build`."""
        return OpenLoopController(self, plant.n_segments, plant.n_muscles)


class OpenLoopController(SegmentController):
    """Contracts segments by the clock: during the step from t to t + dt as its section says for t; has no state."""

    def __init__(self, pattern: OpenLoopKind, n_segments: int, n_muscles: int) -> None:
        """Takes a section and the size of the worm.

        Args:
            pattern: Its section of the configuration.
            n_segments: Segments.
            n_muscles: As `SegmentController`.
        """
        self.pattern, self.name = pattern, pattern.title
        super().__init__(n_segments, n_muscles)

    def reset(self, seed: int) -> None:
        """Does nothing: there is no state, and nothing is random."""

    def step(self, sensation: Sensation) -> Array:
        """Returns the activation of the step that begins now; nothing but the time is sensed."""
        return self.pattern.activation(sensation.time_s, self.n_segments).repeat(self.muscles_per_segment)


class WrappedController(ABC):
    """A controller with something between it and the body, which has a state and signals of its own.

    Attributes:
        name: The controller's own.
        inner: The controller.
        between: What is between.
    """

    def __init__(self, inner: Controller, between: SavedAndRecorded) -> None:
        """Wraps a controller."""
        self.name = getattr(inner, "name", type(inner).__name__)
        self.inner, self.between = inner, between

    @abstractmethod
    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `annelid.protocols.Controller.step`."""

    def recordable(self) -> Recordable:
        """Names the controller's signals, then those of what is between."""
        inner = self.inner.recordable() if isinstance(self.inner, Records) else Recordable()
        own = self.between.recordable()
        attrs = {**inner.attrs, **own.attrs}
        return Recordable((*inner.signals, *own.signals), {**inner.coords, **own.coords}, attrs)

    def read(self, frame: bool) -> Values:
        """Reads the signals that `recordable` names."""
        inner = self.inner.read(frame) if isinstance(self.inner, Records) else {}
        return {**inner, **self.between.read(frame)}

    def alarm(self) -> str | None:
        """Returns the controller's alarm."""
        return self.inner.alarm() if isinstance(self.inner, Watched) else None


class SavedWrapper(WrappedController):
    """A wrapped controller whose state can be saved, since the controller's can.

    Attributes:
        prefixes: What the names of the controller's state and of the state between begin with.
    """

    prefixes: ClassVar[tuple[str, str]]

    def _saved(self) -> dict[str, Stateful]:
        assert isinstance(self.inner, Stateful)
        return dict(zip(self.prefixes, (self.inner, self.between), strict=True))

    def get_state(self) -> State:
        """Returns copies of all that the next step depends on."""
        return {start + name: each for start, part in self._saved().items() for name, each in part.get_state().items()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        for start, part in self._saved().items():
            part.set_state({name.removeprefix(start): each for name, each in state.items() if name.startswith(start)})


class CallableController:
    """Wraps a plain function from sensation to activation.

    Attributes:
        name: Name of the function, for the run file.

    Example::

        controller = CallableController(lambda s: 0.5 + 0.5 * np.sin(s.time_s - np.arange(3)), n_muscles=3)
    """

    def __init__(self, function: Callable[[Sensation], ArrayLike], n_muscles: int) -> None:
        """Wraps a function.

        Args:
            function: Takes the present `Sensation`; returns activation in [0, 1], shape ``(n_muscles,)``, or
                one number for all muscles. Called once per control step.
            n_muscles: Number of muscles of the worm.
        """
        self.name = getattr(function, "__name__", type(function).__name__)
        self._function = function
        self._n_muscles = n_muscles

    def reset(self, seed: int) -> None:
        """Does nothing: what keeps a state is a class of its own."""

    def step(self, sensation: Sensation) -> Array:
        """Calls the function; its values are checked where every controller's are.

        Raises:
            ConfigError: The activation is no number.
        """
        result = self._function(sensation)
        try:
            activation = np.array(result, dtype=np.float64)
        except (TypeError, ValueError):
            raise ConfigError(
                f"the controller function returned {type(result).__name__} at {sensation.time_s:g} s; it must return "
                f"{self._n_muscles} numbers in [0, 1]"
            ) from None
        return activation if activation.ndim else np.full(self._n_muscles, activation)

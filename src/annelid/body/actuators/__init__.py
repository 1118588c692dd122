"""Ring actuators: what all kinds have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, field_validator

from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.config.kinds import Kind
from annelid.config.sections import PerSegmentOf, Positive, Range
from annelid.morphology import Array
from annelid.registry import Registry

if TYPE_CHECKING:
    import mujoco

PerSegment = PerSegmentOf[Positive]
"""One number for all segments, or one for each."""


Slopes = Callable[[Array, Array, Array, Array], tuple[Array, Array]]
"""Slopes of the tensions of one worm, ``(n_muscles,)`` each: per length, N/m, and per rate of length, N s/m; never
negative, since the engine drops what would destabilise it. From lengths, m, their rates, m/s, what the actuators' gain
is multiplied by (the muscles' activation), and tensions, N, ``(n_muscles,)`` each."""


class ActuatorKind(Kind):
    """Base of the ring actuators' sections: how they lie, between which lengths they work, and what is asked of them.

    Attributes:
        force_field: The field that sets its greatest force, of type `PerSegment`.
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("body.rings.kind", "annelid.body.actuators")
    default: ClassVar[str] = "muscle"
    force_field: ClassVar[str]

    layout: Literal["whole", "halves"] = Field(
        default="whole",
        description="one actuator round the body, or a left (-y: segment 1 leads towards -x) and a right one",
    )
    length_range_m: Range | tuple[Range, ...] = Field(
        default=(0.566, 1.067),
        description="operating range of a whole ring, one pair for all or one pair per segment",
    )

    @field_validator("length_range_m")
    @classmethod
    def _ordered(cls, value: Any) -> Any:
        if not value:
            raise ValueError("needs one pair for all rings or one pair per segment")
        for low, high in value if isinstance(value[0], tuple) else (value,):
            if low >= high:
                raise ValueError("each length range needs its lower bound below its upper bound")
        return value

    def length_ranges(self, n_segments: int) -> list[tuple[float, float]]:
        """Returns one operating range for each segment's whole ring, m."""
        if isinstance(self.length_range_m[0], tuple):
            return [(float(low), float(high)) for low, high in self.length_range_m]  # type: ignore[misc]
        low, high = self.length_range_m
        return [(float(low), float(high))] * n_segments  # type: ignore[arg-type]

    def forces(self, n_segments: int) -> list[float]:
        """Returns the greatest force of every segment's actuators, N."""
        return self.of_each(self.force_field, n_segments)

    def strongest(self, n_segments: int) -> Iterator[tuple[float, float, float]]:
        """Returns every operating range of the rings, m, with the greatest force of an actuator that has it, N."""
        spans, forces = self.length_ranges(n_segments), self.forces(n_segments)
        for low, high in dict.fromkeys(spans):
            yield low, high, max(force for own, force in zip(spans, forces, strict=True) if own == (low, high))

    def of_segments(self, segments: Sequence[int], n_segments: int) -> Self:
        """Returns the section with the ranges and forces of some of the segments only, counted from 0."""
        ranges, strengths = self.length_ranges(n_segments), self.of_each(self.force_field, n_segments)
        chosen = {"length_range_m": ranges, self.force_field: strengths}
        return self.model_copy(update={name: tuple(values[s] for s in segments) for name, values in chosen.items()})

    def findings(self, body: MeshBody) -> Iterator[Finding]:
        """Checks its lengths and forces against the mesh, before anything runs; by default nothing is doubted."""
        yield from ()

    @abstractmethod
    def add(self, spec: mujoco.MjSpec, name: str, span_m: list[float], force_N: float) -> None:
        """Adds one actuator.

        Args:
            spec: The worm's spec, which has a tendon of that name.
            name: Of the tendon and of the actuator.
            span_m: Shortest and longest operating length, m.
            force_N: Its greatest force, N.
        """

    @abstractmethod
    def slopes(self, model: mujoco.MjModel) -> Slopes:
        """Returns how steeply the tensions of a compiled body rise, as the engine linearises them."""

    @property
    def muscle(self) -> ActuatorKind | None:
        """The section itself where it is of muscles."""
        return None

    @property
    def lags(self) -> bool:
        """Whether activation follows its command with the lag of a muscle."""
        return False

    def first_act(self, model: mujoco.MjModel) -> Array:
        """Returns the engine's actuator states at the start, ``(n_states,)``."""
        return np.zeros(model.na)

    def act_at_rest(self, spec: mujoco.MjSpec) -> Array:
        """Returns the actuator states of a written model's keyframe at rest; empty where there are none to set."""
        return np.zeros(0)

    def states_after(
        self, model: mujoco.MjModel, activation: Array, state: Array, length_m: Array, time_s: float
    ) -> Array:
        """Returns the engine's actuator states after commands, one after the other; as they are unless a kind says so.

        Args:
            model: The compiled body.
            activation: In [0, 1], ``(n_commands, n_muscles)``.
            state: The states before, ``(n_states,)``.
            length_m: Lengths of the ring actuators, m, ``(n_muscles,)``.
            time_s: For which each command lasts, s.
        """
        return state

    def drive(self, activation: Array, state: Array) -> Array:
        """Returns what the gain of each actuator is multiplied by during a step, ``(n_muscles,)``, as a copy."""
        return state.copy() if state.size else activation

    def control(self, activation: Array, state: Array) -> Array:
        """Returns the engine's control, ``(n_muscles,)``, that leaves the states alone during a step."""
        return activation

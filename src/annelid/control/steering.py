"""What scales the two sides of a worm that turns: descending neurons that are told where to go, or touch."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Annotated, ClassVar, Generic, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from annelid.clock import SLACK_S
from annelid.config.kinds import Goals, TurningKind
from annelid.config.sections import NonNegative, Positive
from annelid.errors import ConfigError
from annelid.protocols import SIDES, Array, Sensation, State

if TYPE_CHECKING:
    from annelid.config.run import RunConfig

Modulation = Annotated[float, Field(ge=-1, le=1)]
Waypoint = tuple[Annotated[float, Field(ge=-1e4, le=1e4)], Annotated[float, Field(ge=-1e4, le=1e4)]]


class Descending(TurningKind):
    """What turning by descending neurons has in common: a modulation that they follow.

    A modulation m in [-1, 1] scales a segment's left activation by ``1 - max(m, 0)`` and its right one by
    ``1 - max(-m, 0)``, so that it bends to the left where m is positive.
    """

    shares: tuple[Modulation, ...] | None = Field(
        default=None,
        description="share of the modulation that each segment takes, front to rear; negative ones bend it the other "
        "way; default 1 each",
    )
    descending_time_constant_s: Annotated[float, Field(ge=1e-3, le=1e4)] = Field(
        default=0.2, description="time constant with which the descending neurons follow the wanted modulation"
    )

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has two sides, and that each segment has its share."""
        super().check_with(config)
        n_segments = config.body.n_segments
        if self.shares is not None and len(self.shares) != n_segments:
            raise ValueError(f"turning.shares has {len(self.shares)} entries: must have {n_segments}, one a segment")


class ConstantTurning(Descending):
    """A constant modulation: the worm crawls in a circle."""

    kind: Literal["constant"] = "constant"
    modulation: Modulation = Field(default=0.0, description="wanted modulation: 1 silences the left side, -1 the right")

    def build(self, n_segments: int, control_timestep_s: float) -> ConstantSteering:
        """Builds the steering, as `TurningKind.build`."""
        return ConstantSteering(self, n_segments, control_timestep_s)


class Steered(Descending):
    """Proportional and derivative control of the heading, whose output is the wanted modulation."""

    gain_per_rad: NonNegative = Field(default=3.0, description="modulation per error of the heading")
    rate_gain_s: NonNegative = Field(default=1.0, description="modulation taken off per rate of the heading, s per rad")
    rate_time_constant_s: Positive = Field(
        default=2.0, description="time constant of the filter that tells the rate of the heading; about one cycle"
    )
    largest_modulation: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.9, description="size of the modulation that is never exceeded"
    )


class HeadingTurning(Steered):
    """Steering to a heading: the direction from the last ring to the foremost."""

    kind: Literal["heading"] = "heading"
    heading_deg: Annotated[float, Field(ge=-180, le=180)] = Field(
        default=0.0, description="relative to that at the start, positive to the left"
    )

    def build(self, n_segments: int, control_timestep_s: float) -> HeadingSteering:
        """Builds the steering, as `TurningKind.build`."""
        return HeadingSteering(self, n_segments, control_timestep_s)


class CourseTurning(Steered):
    """Steering to one waypoint after another; behind the last one the worm crawls on unsteered."""

    kind: Literal["course"] = "course"
    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=1)] = Field(
        description="x and y of each, m, in the coordinates of the run file: a worm with body.heading_deg = 0 starts "
        "along 0 <= x <= its length, leads towards -x, and its left is -y"
    )
    reach_m: Positive = Field(default=0.3, description="a waypoint counts once the foremost ring is this near to it")

    @property
    def goals(self) -> Goals:
        """The waypoints."""
        return Goals(self.waypoints, self.reach_m)

    def build(self, n_segments: int, control_timestep_s: float) -> CourseSteering:
        """Builds the steering, as `TurningKind.build`."""
        return CourseSteering(self, n_segments, control_timestep_s)


class TouchTurning(TurningKind):
    """Turning away from contact, as the authors published it.

    f is the force on the right of the foremost segment minus that on its left. ``|f| > arm_N`` starts a timer of
    ``hold_s``. While it runs and ``|f| >= least_N``, the side away from contact is scaled by
    ``max((full_N - |f|) / full_N, 0)``, of which the smallest so far holds. When it has run out both sides are whole
    again, and only then can it start anew. A scale changes by at most ``rate_per_s``.
    """

    cites: ClassVar[tuple[tuple[str, str], ...]] = (("riddle2025models", "turning away from contact"),)
    kind: Literal["touch"] = "touch"
    arm_N: NonNegative = Field(default=2.0, description="difference of the front's touch that starts the timer")
    hold_s: Positive = Field(default=6.0, description="time of the timer")
    least_N: NonNegative = Field(default=1.0, description="difference below which a running timer scales nothing")
    full_N: Positive = Field(default=15.0, description="difference at which a side is silenced")
    rate_per_s: Positive = Field(default=10.0, description="fastest change of a scale")

    def build(self, n_segments: int, control_timestep_s: float) -> TouchSteering:
        """Builds the steering, as `TurningKind.build`."""
        return TouchSteering(self, n_segments, control_timestep_s)


Settings = TypeVar("Settings", ConstantTurning, HeadingTurning, CourseTurning, TouchTurning)
Commanded = TypeVar("Commanded", ConstantTurning, HeadingTurning, CourseTurning)
Aimed = TypeVar("Aimed", HeadingTurning, CourseTurning)
LEFT, RIGHT = SIDES.index("left"), SIDES.index("right")


def heading_angle(heading: Array) -> float:
    """Returns the direction of a heading on the floor, rad: 0 towards -x, positive to the worm's left, towards -y.

    Args:
        heading: A vector, ``(3,)``, as `Sensation.heading`.
    """
    return math.atan2(-float(heading[1]), -float(heading[0]))


def wrapped(angle_rad: float) -> float:
    """Returns an angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def half_scales(modulation: ArrayLike) -> Array:
    """Returns what modulations m in [-1, 1] leave of the left and the right activation.

    Args:
        modulation: Any shape; positive ones bend a segment to the left.

    Returns:
        ``1 - max(m, 0)`` and ``1 - max(-m, 0)``, shape ``(.., 2)``.
    """
    m = np.asarray(modulation, dtype=float)
    return np.stack([1.0 - np.maximum(m, 0.0), 1.0 - np.maximum(-m, 0.0)], axis=-1)


class Steering(ABC, Generic[Settings]):
    """Tells at every control step what is left of the activation of the two halves of every ring."""

    def __init__(self, settings: Settings, n_segments: int, control_timestep_s: float) -> None:
        """Makes it from its section of the configuration, in its initial state."""
        self._settings = settings
        self._n_segments = n_segments
        self._timestep_s = control_timestep_s
        self.reset()

    @abstractmethod
    def reset(self) -> None:
        """Returns to the initial state: all halves whole."""

    def advance(self, sensation: Sensation, n_steps: int) -> Array:
        """Takes control steps that feel the same but for their times.

        Returns:
            Scales after the last of them, each in [0, 1], ``(n_segments, 2)``: left and right half of every ring.

        Raises:
            ConfigError: A body that cannot tell what the steering needs.
        """
        for _ in range(n_steps):
            self._step(sensation)
        return self.scales()

    @abstractmethod
    def _step(self, sensation: Sensation) -> None:
        """Takes one control step."""

    @abstractmethod
    def scales(self) -> Array:
        """Returns the scales after the latest step, ``(n_segments, 2)``."""

    @abstractmethod
    def get_state(self) -> State:
        """Returns copies of all that the next step depends on."""

    @abstractmethod
    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""


class DescendingSteering(Steering[Commanded]):
    """Two descending neurons, one a side, of which the wanted modulation drives one.

    Their activity m is that of leaky neurons with one time constant; a step is exact for a drive that is constant
    during it.
    """

    def __init__(self, settings: Commanded, n_segments: int, control_timestep_s: float) -> None:
        self._keeps = math.exp(-control_timestep_s / settings.descending_time_constant_s)
        shares = settings.shares
        self._shares = np.ones(n_segments) if shares is None else np.array(shares, dtype=float)
        super().__init__(settings, n_segments, control_timestep_s)

    @abstractmethod
    def _wanted(self, sensation: Sensation) -> float:
        """The modulation that is asked for during a control step, in [-1, 1]."""

    def reset(self) -> None:
        """Silences the descending neurons."""
        self._modulation = 0.0

    def _step(self, sensation: Sensation) -> None:
        wanted = self._wanted(sensation)
        self._modulation = wanted + (self._modulation - wanted) * self._keeps

    def scales(self) -> Array:
        """Returns what the present activity leaves of every half: of its own side's in proportion to its share."""
        return half_scales(self._modulation * self._shares)

    def get_state(self) -> State:
        """Returns the activity of the descending neurons."""
        return {"modulation": np.array(self._modulation)}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._modulation = float(state["modulation"])


class ConstantSteering(DescendingSteering[ConstantTurning]):
    """A constant modulation."""

    def _wanted(self, sensation: Sensation) -> float:
        return self._settings.modulation


class AimedSteering(DescendingSteering[Aimed]):
    """Proportional and derivative control of the heading.

    The wanted modulation is ``gain error - rate_gain rate``, clipped. The rate of the heading is what a filter of first
    order lags behind it, over the filter's time constant: it averages over the swings of a cycle.
    """

    @abstractmethod
    def _target(self, sensation: Sensation) -> float | None:
        """The wanted direction on the floor, rad, as `heading_angle` counts it; None for any."""

    def reset(self) -> None:
        """Forgets all headings."""
        super().reset()
        self._first = self._angle = self._smooth = math.nan

    def _wanted(self, sensation: Sensation) -> float:
        settings, angle = self._settings, heading_angle(sensation.heading)
        if math.isnan(angle):
            raise ConfigError("steering needs a body that tells its heading, and this one does not")
        if math.isnan(self._first):
            self._first = self._angle = self._smooth = angle
        # Unwrapped, so that the filter does not jump.
        self._angle += wrapped(angle - self._angle)
        rate = (self._angle - self._smooth) / settings.rate_time_constant_s
        follows = -math.expm1(-self._timestep_s / settings.rate_time_constant_s)
        self._smooth += follows * (self._angle - self._smooth)
        target = self._target(sensation)
        if target is None:
            return 0.0
        modulation = settings.gain_per_rad * wrapped(target - self._angle) - settings.rate_gain_s * rate
        return min(max(modulation, -settings.largest_modulation), settings.largest_modulation)

    def get_state(self) -> State:
        """Returns the activity and the headings at the start, at the latest step, and filtered."""
        return super().get_state() | {"headings": np.array([self._first, self._angle, self._smooth])}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        super().set_state(state)
        self._first, self._angle, self._smooth = np.asarray(state["headings"], dtype=float).tolist()


class HeadingSteering(AimedSteering[HeadingTurning]):
    """Steers to a heading relative to that of the first sensation."""

    def _target(self, sensation: Sensation) -> float:
        return self._first + math.radians(self._settings.heading_deg)


class CourseSteering(AimedSteering[CourseTurning]):
    """Steers the foremost ring to one waypoint after another."""

    def reset(self) -> None:
        """Returns to the first waypoint."""
        super().reset()
        self._n_reached = 0

    def _target(self, sensation: Sensation) -> float | None:
        settings, front = self._settings, sensation.front_m
        while self._n_reached < len(settings.waypoints):
            x, y = settings.waypoints[self._n_reached]
            away = np.array([x - front[0], y - front[1], 0.0])
            if math.hypot(*away) > settings.reach_m:
                return heading_angle(away)
            self._n_reached += 1
        return None

    def get_state(self) -> State:
        """Returns the state of the heading's control and how many waypoints have been reached."""
        return super().get_state() | {"n_reached": np.array(self._n_reached)}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        super().set_state(state)
        self._n_reached = int(state["n_reached"])
        if not 0 <= self._n_reached <= len(self._settings.waypoints):
            raise ValueError(f"{self._n_reached} waypoints reached of {len(self._settings.waypoints)}")


class TouchSteering(Steering[TouchTurning]):
    """Turns away from what the foremost segment touches, by the authors' rule: see `TouchTurning`."""

    def reset(self) -> None:
        """Stops the timer, with both sides whole."""
        self._left_s = 0.0
        self._latched, self._scales = [1.0, 1.0], [1.0, 1.0]

    def _step(self, sensation: Sensation) -> None:
        if not len(sensation.touch_N):
            raise ConfigError("turning.kind = 'touch' needs a body that feels touch on the sides of its segments")
        difference_N = float(sensation.touch_N[0, RIGHT] - sensation.touch_N[0, LEFT])
        rule, size = self._settings, abs(difference_N)
        if self._left_s <= SLACK_S:
            self._latched = [1.0, 1.0]
            self._left_s = rule.hold_s if size > rule.arm_N else 0.0
        if self._left_s > SLACK_S:
            if size >= rule.least_N:
                away = 0 if difference_N > 0 else 1
                self._latched[away] = min(self._latched[away], max((rule.full_N - size) / rule.full_N, 0.0))
            self._left_s -= self._timestep_s
        reach = rule.rate_per_s * self._timestep_s
        self._scales = [
            scale + min(max(latched - scale, -reach), reach)
            for scale, latched in zip(self._scales, self._latched, strict=True)
        ]

    def scales(self) -> Array:
        """Returns the scales after the latest step, those of a side alike."""
        return np.tile(self._scales, (self._n_segments, 1))

    def get_state(self) -> State:
        """Returns what is left of the timer, s, and the latched and the present scales."""
        parts = {"timer": self._left_s, "latched": self._latched, "scales": self._scales}
        return {name: np.array(value) for name, value in parts.items()}

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._left_s = float(state["timer"])
        self._latched, self._scales = (np.asarray(state[name], dtype=float).tolist() for name in ("latched", "scales"))

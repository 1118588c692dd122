"""Turning, as a modifier of any controller: the activation of the two sides is scaled before it drives the muscles.

What scales it are descending neurons that follow a wanted modulation, or touch.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from annelid.clock import SLACK_S
from annelid.config.answers import Goals
from annelid.config.run import RunConfig, TurningKind
from annelid.config.sections import Level, NonNegative, Positive
from annelid.control.base import SavedWrapper, TimeConstant
from annelid.control.senses import heading_angle
from annelid.errors import ConfigError
from annelid.protocols import (
    SIDES,
    Array,
    Controller,
    SavedAndRecorded,
    Sensation,
    Stateful,
    StridingController,
    Values,
)

Modulation = Annotated[float, Field(ge=-1, le=1)]
Waypoint = tuple[Annotated[float, Field(ge=-1e4, le=1e4)], Annotated[float, Field(ge=-1e4, le=1e4)]]
HALVES = ("left", "right")
TOUCH_STARTS_N, TOUCH_LEAST_N, TOUCH_FULL_N = 2.0, 1.0, 15.0
"""Of turning by touch: the differences that start the timer, that act while it runs, and that silence a side."""
TOUCH_HOLD_S, SCALE_RATE_PER_S = 6.0, 10.0
"""Time of the timer, and the fastest change of a scale."""
LEFT, RIGHT = SIDES.index("left"), SIDES.index("right")


def wrapped(angle_rad: float) -> float:
    """Returns an angle in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def half_scales(modulation: ArrayLike) -> Array:
    """Returns what modulations m in [-1, 1] leave of the left and the right activation, shape ``(.., 2)``."""
    m = np.asarray(modulation, dtype=float)
    return np.stack([1.0 - np.maximum(m, 0.0), 1.0 - np.maximum(-m, 0.0)], axis=-1)


class Descending(TurningKind):
    """What turning by descending neurons has in common: a modulation that they follow.

    A modulation m in [-1, 1] scales a segment's left activation by ``1 - max(m, 0)`` and its right one by
    ``1 - max(-m, 0)``, so that it bends to the left where m is positive. Of two leaky neurons, one per side, the wanted
    modulation drives one; m is their activity. A step is exact for a drive that is constant during it. A segment with a
    negative share of m bends in the opposite direction.
    """

    shares: tuple[Modulation, ...] | None = Field(
        default=None, description="of the modulation for each segment; default 1 each"
    )
    descending_time_constant_s: TimeConstant = Field(default=0.2, description="of the descending neurons")

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has two sides, and that each segment has its share."""
        super().check_with(config)
        n_segments = config.body.n_segments
        if self.shares is not None and len(self.shares) != n_segments:
            raise ValueError(f"turning.shares has {len(self.shares)} entries: must have {n_segments}, one per segment")

    @abstractmethod
    def _wanted(self, now: dict[str, Any], sensation: Sensation, timestep_s: float) -> float:
        """The modulation that is wanted during a control step, in [-1, 1]; may change the state."""

    def at_start(self) -> dict[str, Any]:
        """Returns the state, as `TurningKind.at_start`."""
        return {"modulation": np.array(0.0)}

    def advance(self, now: dict[str, Any], sensation: Sensation, timestep_s: float) -> None:
        """Takes a control step, as `TurningKind.advance`."""
        wanted = self._wanted(now, sensation, timestep_s)
        keeps = math.exp(-timestep_s / self.descending_time_constant_s)
        now["modulation"][...] = wanted + (float(now["modulation"]) - wanted) * keeps

    def scales(self, now: dict[str, Any], n_segments: int) -> Array:
        """Returns what is left, as `TurningKind.scales`."""
        return half_scales(float(now["modulation"]) * np.array(self.shares or [1.0] * n_segments))


class ConstantTurning(Descending):
    """A constant modulation: the worm crawls in a circle."""

    kind: Literal["constant"] = "constant"
    modulation: Modulation = Field(default=0.0, description="wanted modulation: 1 silences the left side, -1 the right")

    def _wanted(self, now: dict[str, Any], sensation: Sensation, timestep_s: float) -> float:
        return self.modulation


class Steered(Descending):
    """Proportional and derivative control of the heading, whose output is the wanted modulation.

    It is ``gain error - rate_gain rate``, clipped. The rate of the heading is what a filter of first order lags behind
    it, over the filter's time constant: it averages over the swings of a cycle.
    """

    senses: ClassVar[tuple[str, ...]] = ("heading_rad",)
    gain_per_rad: NonNegative = Field(default=3.0, description="modulation per error of the heading")
    rate_gain_s: NonNegative = Field(default=1.0, description="modulation taken off per rate of the heading, s per rad")
    rate_time_constant_s: Positive = Field(default=2.0, description="of the rate's filter; about one cycle")
    largest_modulation: Level = Field(default=0.9, description="size of the modulation that is never exceeded")

    @abstractmethod
    def _target(self, now: dict[str, Any], sensation: Sensation) -> float | None:
        """The wanted direction on the floor, rad, as `heading_angle` counts it; None for any."""

    def at_start(self) -> dict[str, Any]:
        """Returns the state, as `TurningKind.at_start`."""
        # The headings at the start, at the latest step, and filtered.
        return super().at_start() | {"headings": np.full(3, np.nan)}

    def _wanted(self, now: dict[str, Any], sensation: Sensation, timestep_s: float) -> float:
        heading = heading_angle(sensation.heading)
        if math.isnan(heading):
            raise ConfigError("steering needs a body that senses its heading, and this one does not")
        if math.isnan(now["headings"][0]):
            now["headings"][:] = heading
        first, angle, smooth = now["headings"].tolist()
        # Unwrapped, so that the filter does not jump.
        angle += wrapped(heading - angle)
        rate = (angle - smooth) / self.rate_time_constant_s
        smooth += -math.expm1(-timestep_s / self.rate_time_constant_s) * (angle - smooth)
        now["headings"][:] = first, angle, smooth
        target = self._target(now, sensation)
        if target is None:
            return 0.0
        modulation = self.gain_per_rad * wrapped(target - angle) - self.rate_gain_s * rate
        return min(max(modulation, -self.largest_modulation), self.largest_modulation)


class HeadingTurning(Steered):
    """Steering to a heading: the direction from the last ring to the foremost."""

    kind: Literal["heading"] = "heading"
    heading_deg: float = Field(
        default=0.0, ge=-180, le=180, description="relative to that at the start, positive to the left"
    )

    def _target(self, now: dict[str, Any], sensation: Sensation) -> float:
        return float(now["headings"][0]) + math.radians(self.heading_deg)


class CourseTurning(Steered):
    """Steering to one waypoint after another; behind the last one the worm crawls on unsteered."""

    senses: ClassVar[tuple[str, ...]] = ("heading_rad", "front_m")
    kind: Literal["course"] = "course"
    waypoints: tuple[Waypoint, ...] = Field(
        min_length=1,
        description="x and y of each, m, in the coordinates of the run file: the worm starts along "
        "0 <= x <= its length, leads towards -x, and its left is -y",
    )
    reach_m: Positive = Field(default=0.3, description="a waypoint counts once the foremost ring is this near to it")

    @property
    def goals(self) -> Goals:
        """The waypoints."""
        return Goals(self.waypoints, self.reach_m)

    def at_start(self) -> dict[str, Any]:
        """Returns the state, as `TurningKind.at_start`."""
        return super().at_start() | {"n_reached": np.array(0)}

    def _target(self, now: dict[str, Any], sensation: Sensation) -> float | None:
        for x, y in self.waypoints[max(int(now["n_reached"]), 0) :]:
            away = np.array([x - sensation.front_m[0], y - sensation.front_m[1], 0.0])
            if math.hypot(*away) > self.reach_m:
                return heading_angle(away)
            now["n_reached"] += 1
        return None


class TouchTurning(TurningKind):
    """Turning away from contact, as the authors published it.

    f is the force on the right of the foremost segment minus that on its left. ``|f| > 2 N`` starts a timer of 6 s.
    While it runs and ``|f| >= 1 N``, the side away from contact is scaled by ``max(1 - |f| / 15 N, 0)``, of which the
    smallest so far applies. When it has run out both sides are whole again, and only then can it start anew. A scale
    changes by at most 10 in a second.
    """

    cites = (("riddle2025models", "turning away from contact"),)
    senses: ClassVar[tuple[str, ...]] = ("touch_N",)
    kind: Literal["touch"] = "touch"

    def at_start(self) -> dict[str, Any]:
        """Returns the state, as `TurningKind.at_start`."""
        return {"timer": np.array(0.0), "latched": np.ones(2), "scales": np.ones(2)}

    def advance(self, now: dict[str, Any], sensation: Sensation, timestep_s: float) -> None:
        """Takes a control step, as `TurningKind.advance`."""
        if not len(sensation.touch_N):
            raise ConfigError("turning.kind = 'touch' needs a body that senses touch on the sides of its segments")
        difference_N = float(sensation.touch_N[0, RIGHT] - sensation.touch_N[0, LEFT])
        size, latched = abs(difference_N), now["latched"]
        if now["timer"] <= SLACK_S:
            latched[:] = 1.0
            now["timer"][...] = TOUCH_HOLD_S if size > TOUCH_STARTS_N else 0.0
        if now["timer"] > SLACK_S:
            if size >= TOUCH_LEAST_N:
                away = 0 if difference_N > 0 else 1
                latched[away] = min(latched[away], max((TOUCH_FULL_N - size) / TOUCH_FULL_N, 0.0))
            now["timer"] -= timestep_s
        reach = SCALE_RATE_PER_S * timestep_s
        now["scales"] += np.clip(latched - now["scales"], -reach, reach)

    def scales(self, now: dict[str, Any], n_segments: int) -> Array:
        """Returns what is left, as `TurningKind.scales`."""
        return np.tile(now["scales"], (n_segments, 1))


class Steering(SavedAndRecorded):
    """A turning with its state, which goes on from control step to control step."""

    recorded = (("half_scale", ("segment", "half"), "1", "share of its activation that half a ring is left"),)

    def __init__(self, rule: TurningKind, n_segments: int, control_timestep_s: float) -> None:
        """Begins with all halves whole."""
        self._rule, self._n_segments, self._timestep_s = rule, n_segments, control_timestep_s
        self.reset()

    def reset(self) -> None:
        """Returns to the initial state: all halves whole."""
        self._now = self._rule.at_start()

    def advance(self, sensation: Sensation, n_steps: int = 1) -> Array:
        """Takes control steps with the same sensation but for its time; returns `TurningKind.scales` afterwards."""
        for _ in range(n_steps):
            self._rule.advance(self._now, sensation, self._timestep_s)
        return self._rule.scales(self._now, self._n_segments)

    def _values(self) -> Values:
        return {"half_scale": self._rule.scales(self._now, self._n_segments)}

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"segment": list(range(1, self._n_segments + 1)), "half": list(HALVES)}

    def _attrs(self) -> dict[str, float | int | str]:
        return {"turning": self._rule.kind}


class TurningController(SavedWrapper):
    """A controller whose pattern another one makes, and whose sides a steering scales.

    The pattern senses that it is scaled only through the body: its rhythm is its own.

    Raises:
        ConfigError: Whole rings, or a pattern whose state cannot be saved.
    """

    prefixes = ("pattern_", "turning_")
    between: Steering

    def __init__(
        self, pattern: Controller, section: TurningKind, n_segments: int, n_muscles: int, control_timestep_s: float
    ) -> None:
        """Wraps the controller that makes the pattern for all ``n_muscles``."""
        if n_muscles != len(HALVES) * n_segments:
            raise ConfigError(f"turning needs half-rings: {2 * n_segments} muscles, not {n_muscles}")
        if not isinstance(pattern, Stateful):
            raise ConfigError(f"turning needs a pattern whose state can be saved, not {type(pattern).__name__}")
        super().__init__(pattern, Steering(section, n_segments, control_timestep_s))
        self._timestep_s, self._senses = control_timestep_s, section.senses

    @property
    def senses(self) -> tuple[str, ...]:
        """What it senses, names in `annelid.control.SENSED`."""
        pattern = getattr(self.inner, "senses", ("lengthening_m",))
        return tuple(dict.fromkeys((*pattern, *self._senses)))

    def reset(self, seed: int) -> None:
        """Returns to the initial state; ``seed`` is the pattern's."""
        self.inner.reset(seed)
        self.between.reset()

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `stride`."""
        return self.stride(sensation, 1)[0]

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `annelid.protocols.StridingController.stride`."""
        first = round(sensation.time_s / self._timestep_s)
        felt = [sensation, *(sensation.later((first + k) * self._timestep_s) for k in range(1, n_steps))]
        scales = np.stack([self.between.advance(one) for one in felt])
        if isinstance(self.inner, StridingController):
            activation = self.inner.stride(sensation, n_steps)
        else:
            activation = np.stack([self.inner.step(one) for one in felt])
        return (activation.reshape(scales.shape) * scales).reshape(n_steps, -1)

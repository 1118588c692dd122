"""How a worm with half-rings turns: what scales the activation of its left and of its right side."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from annelid.config.sections import NonNegative, Positive, Section, kind_or

Modulation = Annotated[float, Field(ge=-1, le=1)]
Waypoint = tuple[Annotated[float, Field(ge=-1e4, le=1e4)], Annotated[float, Field(ge=-1e4, le=1e4)]]


class Descending(Section):
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


class ConstantTurning(Descending):
    """A constant modulation: the worm crawls in a circle."""

    kind: Literal["constant"] = "constant"
    modulation: Modulation = Field(default=0.0, description="wanted modulation: 1 silences the left side, -1 the right")


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


class CourseTurning(Steered):
    """Steering to one waypoint after another; behind the last one the worm crawls on unsteered."""

    kind: Literal["course"] = "course"
    waypoints: Annotated[tuple[Waypoint, ...], Field(min_length=1)] = Field(
        description="x and y of each, m, in the coordinates of the run file: a worm with body.heading_deg = 0 starts "
        "along 0 <= x <= its length, leads towards -x, and its left is -y"
    )
    reach_m: Positive = Field(default=0.3, description="a waypoint counts once the foremost ring is this near to it")


class TouchTurning(Section):
    """Turning away from contact, as the authors published it.

    f is the force on the right of the foremost segment minus that on its left. ``|f| > arm_N`` starts a timer of
    ``hold_s``. While it runs and ``|f| >= least_N``, the side away from contact is scaled by
    ``max((full_N - |f|) / full_N, 0)``, of which the smallest so far holds. When it has run out both sides are whole
    again, and only then can it start anew. A scale changes by at most ``rate_per_s``.
    """

    kind: Literal["touch"] = "touch"
    arm_N: NonNegative = Field(default=2.0, description="difference of the front's touch that starts the timer")
    hold_s: Positive = Field(default=6.0, description="time of the timer")
    least_N: NonNegative = Field(default=1.0, description="difference below which a running timer scales nothing")
    full_N: Positive = Field(default=15.0, description="difference at which a side is silenced")
    rate_per_s: Positive = Field(default=10.0, description="fastest change of a scale")


TurningSection = Annotated[
    Annotated[ConstantTurning, Tag("constant")]
    | Annotated[HeadingTurning, Tag("heading")]
    | Annotated[CourseTurning, Tag("course")]
    | Annotated[TouchTurning, Tag("touch")],
    kind_or("constant"),
]

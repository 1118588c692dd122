"""What a kind answers when it is asked: goals, walls, a model, its elements, and what is wrong with a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

Place = Annotated[float, Field(ge=-1e4, le=1e4)]
Post = tuple[Place, Place, Annotated[float, Field(gt=0, le=100)]]
"""Of an upright round post: x, y and radius, m."""


class Goals(NamedTuple):
    """Places on the ground that a worm is steered to.

    Attributes:
        points_m: x and y of each, m.
        reach_m: Distance at which one counts as reached, m.
    """

    points_m: tuple[tuple[float, float], ...] = ()
    reach_m: float = 0.0


class OwnModel(NamedTuple):
    """A robot that a file describes whole.

    Attributes:
        xml: The robot and its ground as MJCF.
        actuators: Names of the actuators of its segments, segment by segment.
    """

    xml: str
    actuators: tuple[str, ...]


class Walls(NamedTuple):
    """What stands upright on a ground.

    Attributes:
        rail_gap_m: Distance of two guard rails along x, the worm midway, m; None for none.
        posts: x, y and radius of upright round posts, m.
    """

    rail_gap_m: float | None = None
    posts: tuple[Post, ...] = ()


class Elements(NamedTuple):
    """How finely a body is divided.

    Attributes:
        field: Dotted path of the field that says it.
        number: Its value.
        most: The greatest that is allowed.
    """

    field: str
    number: int
    most: int


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong with a configuration.

    Attributes:
        field: Dotted path of the field to change.
        value: Its value.
        problem: What is wrong, in a sentence without a full stop.
        instead: What to set instead, with a number.
        severity: "error" where the run can mean nothing and is refused, "warning" where it is doubtful.
    """

    field: str
    value: object
    problem: str
    instead: str
    severity: Literal["error", "warning"] = "warning"

    def __str__(self) -> str:
        """Returns one sentence."""
        return f"{self.field} = {_text(self.value)}: {self.problem}; {self.instead}"


def _text(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:g}" if isinstance(value, int | float) else str(value)

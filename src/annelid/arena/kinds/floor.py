"""A floor: level, or a slope that the worm climbs; between guard rails and with posts if wanted."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from annelid.arena.centre_line import UP
from annelid.arena.surface import Plane, Surface
from annelid.config.answers import Post, Walls
from annelid.config.run import ArenaKind
from annelid.config.sections import NonNegative, Positive

Slope = Annotated[
    float,
    Field(
        ge=-60,
        le=60,
        description="how steeply it rises towards -x, where the worm leads at the start; the model's axes lie in "
        "the slope",
    ),
]
"""Angle of an arena's axes, degrees."""


class Ground(ArenaKind):
    """What floors and reliefs have in common; it lies along x."""

    floor_gap_m: NonNegative = Field(default=0.009, description="distance of the floor below the mesh's lowest line")
    slope_deg: Slope = 0.0

    @property
    def floor_depth_m(self) -> float:
        """As `floor_gap_m`."""
        return self.floor_gap_m


class Floor(Ground):
    """A plane: level, or a slope that the worm climbs; between guard rails and with posts if wanted."""

    kind: Literal["floor"] = "floor"
    rail_gap_m: Positive | None = Field(
        default=None, description="distance of two upright guard rails, the worm midway (not set: none)"
    )
    posts: Annotated[tuple[Post, ...], Field(max_length=1000)] | None = Field(
        default=None,
        description="x, y and radius of upright round posts, m; the worm starts along 0 <= x <= its length, leads "
        "towards -x, and its left is -y (not set: none)",
    )

    @property
    def walls(self) -> Walls:
        """Guard rails and posts."""
        return Walls(self.rail_gap_m, self.posts or ())

    @property
    def is_plane(self) -> bool:
        """True."""
        return True

    def ground(self) -> Surface:
        """Returns the plane."""
        return Plane(UP, -self.floor_gap_m)

"""A floor: level, or a slope that the worm climbs; between guard rails and with posts if wanted."""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal

from pydantic import Field

from annelid.arena.centre_line import UP
from annelid.arena.surface import Plane, Surface
from annelid.config.answers import Post, Walls
from annelid.config.run import ArenaKind, RunConfig
from annelid.config.sections import NonNegative, Positive

Slope = Annotated[
    float,
    Field(
        ge=-60,
        le=60,
        description="how steeply it rises towards -x, where a worm with body.heading_deg = 0 leads; the model's axes "
        "lie in the slope",
    ),
]
"""Angle of an arena's axes, degrees."""


class Ground(ArenaKind):
    """What floors and reliefs have in common; it lies along x."""

    floor_gap_m: NonNegative = Field(default=0.009, description="distance of the floor below the mesh's lowest line")
    slope_deg: Slope = 0.0

    @property
    def slope_rad(self) -> float:
        """As `slope_deg`, in rad."""
        return radians(self.slope_deg)

    @property
    def floor_depth_m(self) -> float:
        """As `floor_gap_m`."""
        return self.floor_gap_m

    def check_with(self, config: RunConfig) -> None:
        """Checks that the worm leads towards -x.

        Raises:
            ValueError: It leads elsewhere.
        """
        refuse_heading(config, f"arena.kind = {self.kind!r}")


class Floor(Ground):
    """A plane: level, or a slope that the worm climbs; between guard rails and with posts if wanted."""

    kind: Literal["floor"] = "floor"
    rail_gap_m: Positive | None = Field(
        default=None, description="distance of two upright guard rails, the worm midway (not set: none)"
    )
    posts: Annotated[tuple[Post, ...], Field(max_length=1000)] | None = Field(
        default=None,
        description="x, y and radius of upright round posts, m; a worm with body.heading_deg = 0 starts along "
        "0 <= x <= its length, leads towards -x, and its left is -y (not set: none)",
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

    def check_with(self, config: RunConfig) -> None:
        """Checks that the worm leads towards -x between guard rails.

        Raises:
            ValueError: It leads elsewhere.
        """
        if self.rail_gap_m is not None:
            refuse_heading(config, f"arena.rail_gap_m = {self.rail_gap_m:g}")


def refuse_heading(config: RunConfig, where: str) -> None:
    """Raises ValueError for a worm that does not lead towards -x where an arena, by this field, lies along x."""
    heading_deg = config.body.first_heading_deg
    if heading_deg:
        raise ValueError(
            f"body.heading_deg = {heading_deg:g}: must be 0 with {where}, which lies along x; take a floor without "
            "rails (arena.kind = 'floor')"
        )

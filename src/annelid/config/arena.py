"""The 3D worm's ground: level or sloping floors, steps, rough ground, and pipes."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from annelid.config.sections import Impedance, NonNegative, Positive, Section, Seed, kind_or

Friction = Annotated[float, Field(ge=0.01, le=100)]
Place = Annotated[float, Field(ge=-1e4, le=1e4)]
Post = tuple[Place, Place, Annotated[float, Field(gt=0, le=100)]]
Slope = Annotated[float, Field(ge=-60, le=60)]


class Arena(Section):
    """What every ground has: friction, gravity and the softness of contacts."""

    friction: Friction = Field(default=1.0, description="coefficient of sliding friction")
    backward_friction: Friction | None = Field(
        default=None, description="the same where the skin slides towards the worm's rear, as setae do (not set: alike)"
    )
    gravity_m_per_s2: NonNegative = Field(default=9.81, description="0 for a weightless worm")
    contact_time_constant_s: Positive = Field(default=0.02, description="solref time constant of the contacts")
    contact_impedance: Impedance = Field(
        default=(0.9, 0.95, 0.001), description="solimp (d0, dwidth, width) of the contacts"
    )
    friction_cone: Literal["pyramidal", "elliptic"] = Field(
        default="pyramidal",
        description="elliptic: friction is alike in every direction of sliding; pyramidal: it is weaker by 16 % at 45 "
        "degrees to the world's axes",
    )

    @property
    def has_setae(self) -> bool:
        """Whether friction depends on the direction in which the skin slides."""
        return self.backward_friction not in (None, self.friction)


SHARED = tuple(Arena.model_fields)
"""Fields of every arena; a worm that is put elsewhere keeps those that the place does not state."""


class Floor(Arena):
    """A plane: level, or a slope that the worm climbs; between guard rails and with posts if wanted."""

    kind: Literal["floor"] = "floor"
    floor_gap_m: NonNegative = Field(default=0.009, description="distance of the floor below the mesh's lowest line")
    slope_deg: Slope = Field(
        default=0.0,
        description="how steeply it rises towards -x, where a worm with body.heading_deg = 0 leads; the model's axes "
        "lie in the slope",
    )
    rail_gap_m: Positive | None = Field(
        default=None, description="distance of two upright guard rails, the worm midway (not set: none)"
    )
    posts: Annotated[tuple[Post, ...], Field(max_length=1000)] | None = Field(
        default=None,
        description="x, y and radius of upright round posts, m; a worm with body.heading_deg = 0 starts along "
        "0 <= x <= its length, leads towards -x, and its left is -y (not set: none)",
    )

    @property
    def has_walls(self) -> bool:
        """Whether rails or posts stand on it."""
        return self.rail_gap_m is not None or bool(self.posts)


class Relief(Floor):
    """A floor whose relief begins in front of the worm."""

    start_m: NonNegative = Field(default=0.1, description="level ground between the worm's front and the relief")


class Steps(Relief):
    """A flight of steps that the worm climbs."""

    kind: Literal["steps"] = "steps"  # type: ignore[assignment]
    step_height_m: Positive = Field(default=0.02, description="height of each step")
    step_length_m: Positive = Field(default=0.3, description="length of each step")
    rounding_m: Positive = Field(default=0.008, description="radius of the steps' rounded edges and inner corners")

    @model_validator(mode="after")
    def _rounded_steps_fit(self) -> Self:
        most = min(self.step_height_m, self.step_length_m) / 2
        if self.rounding_m > most:
            raise ValueError(
                f"arena.rounding_m = {self.rounding_m:g}: must be at most {most:g}, half of a step's height and length"
            )
        return self


class Rough(Relief):
    """Rough ground: a random height with a Gaussian correlation."""

    kind: Literal["rough"] = "rough"  # type: ignore[assignment]
    roughness_m: Positive = Field(default=0.008, description="root mean square of the height")
    correlation_m: Positive = Field(default=0.15, description="distance at which heights correlate by 1/e")
    relief_seed: Seed = Field(default=0, description="seed of the random ground")

    @model_validator(mode="after")
    def _not_too_steep(self) -> Self:
        if self.roughness_m > 0.2 * self.correlation_m:
            raise ValueError(
                f"arena.roughness_m = {self.roughness_m:g}: must be at most a fifth of arena.correlation_m = "
                f"{self.correlation_m:g}, or the ground is no gentle surface"
            )
        return self


class Pipe(Arena):
    """A pipe: a centre line of straights and curves, and a bore that may change along it.

    The worm starts inside the entry, which goes on behind it; the exit goes on too. The bore's lowest line at the entry
    is that of the mesh. Lengths along the pipe count from the worm's front.
    """

    kind: Literal["pipe"] = "pipe"
    bore_m: Positive = Field(default=0.16, description="radius of the bore, free for the worm's skin")
    entry_clearance_m: NonNegative = Field(
        default=0.003, description="how much wider the bore is where the worm starts, so that its strands fit in"
    )
    course: Literal["straight", "bend", "s", "helix"] = Field(
        default="straight", description="the centre line: one bend, two opposite ones, or a rising helix"
    )
    straight_m: NonNegative = Field(default=0.2, description="straight pipe between the worm's front and the curve")
    radius_m: Positive = Field(default=0.5, description="radius of the centre line's curves")
    turn_deg: Annotated[float, Field(ge=-3600, le=3600)] = Field(
        default=90.0, description="angle of each curve (helix: of the whole), positive to the worm's left"
    )
    pitch_m: NonNegative = Field(default=0.5, description="rise of the helix in a turn")
    profile: Literal["even", "taper", "hourglass"] = Field(
        default="even", description="the bore along the pipe: the same, narrowing for good, or narrowest midway"
    )
    narrowest_m: Positive = Field(default=0.13, description="radius of the narrowest bore of a taper or an hourglass")
    profile_start_m: NonNegative = Field(default=0.2, description="where the bore begins to narrow")
    profile_length_m: Positive = Field(default=0.5, description="length over which it changes")

    @model_validator(mode="after")
    def _a_pipe_that_can_be(self) -> Self:
        if self.profile != "even" and self.narrowest_m >= self.bore_m:
            raise ValueError(
                f"arena.narrowest_m = {self.narrowest_m:g}: must be less than arena.bore_m = {self.bore_m:g}"
            )
        widest = self.bore_m + self.entry_clearance_m
        if self.course == "bend" and abs(self.turn_deg) > 180:
            raise ValueError(f"arena.turn_deg = {self.turn_deg:g}: a bend must be in -180 .. 180; a helix may go on")
        if self.course == "s" and abs(self.turn_deg) > 135:
            raise ValueError(f"arena.turn_deg = {self.turn_deg:g}: each curve of an s must be in -135 .. 135")
        if self.course in ("bend", "s") and abs(self.turn_deg) > 135 and self.radius_m <= widest:
            raise ValueError(
                f"arena.radius_m = {self.radius_m:g}: must be more than {widest:g}, or the legs of the bend overlap"
            )
        if self.course == "helix":
            if self.radius_m <= widest:
                raise ValueError(
                    f"arena.radius_m = {self.radius_m:g}: must be more than {widest:g} for a helix, or the pipe "
                    "overlaps itself"
                )
            if abs(self.turn_deg) > 270 and self.pitch_m <= 2.2 * widest:
                raise ValueError(
                    f"arena.pitch_m = {self.pitch_m:g}: must be more than {2.2 * widest:g} for turns that lie above "
                    "each other"
                )
        return self


ArenaSection = Annotated[
    Annotated[Floor, Tag("floor")]
    | Annotated[Steps, Tag("steps")]
    | Annotated[Rough, Tag("rough")]
    | Annotated[Pipe, Tag("pipe")],
    kind_or("floor"),
]

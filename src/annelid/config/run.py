"""The whole of a run: the worm in its arena, its controller, clock, records and guards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, Tag, model_validator

from annelid.config.arena import ArenaSection, Floor, Pipe
from annelid.config.controllers import (
    ControllerSection,
    HeteroclinicChannel,
    PressureSns,
    Program,
    SnsController,
    StretchSensor,
)
from annelid.config.planar import Boxerbaum2012Body, Daltorio2013Body, PlanarBody, PlanarWorm
from annelid.config.sections import Line, NonNegative, Positive, Section, Seed, kind_or
from annelid.config.turning import Descending, TurningSection
from annelid.config.worm import WormBody

Timestep = Annotated[float, Field(ge=1e-6, le=1.0)]
MOST_SAMPLES = 10_000_000

Body = Annotated[
    Annotated[WormBody, Tag("worm")]
    | Annotated[PlanarBody, Tag("riddle2022")]
    | Annotated[Daltorio2013Body, Tag("daltorio2013")]
    | Annotated[Boxerbaum2012Body, Tag("boxerbaum2012")],
    kind_or("worm"),
]


def _is_multiple(large: float, small: float) -> bool:
    ratio = large / small
    return round(ratio) >= 1 and abs(ratio - round(ratio)) < 1e-6 * ratio


class Clock(Section):
    """Time steps: one is an integer multiple of the other."""

    control_timestep_s: Timestep = Field(default=0.001, description="step of the nervous system")
    physics_timestep_s: Timestep = Field(default=0.005, description="step of the body")

    @model_validator(mode="after")
    def _multiples(self) -> Self:
        small, large = sorted((self.control_timestep_s, self.physics_timestep_s))
        if not _is_multiple(large, small):
            raise ValueError(
                f"clock.control_timestep_s = {self.control_timestep_s:g} and clock.physics_timestep_s = "
                f"{self.physics_timestep_s:g}: one must be an integer multiple of the other"
            )
        return self


class Record(Section):
    """What goes into the run file how often."""

    signals_interval_s: Positive = Field(default=0.005, description="interval of potentials, lengths and forces")
    frames_interval_s: Positive = Field(default=0.04, description="interval of whole postures, for pictures and video")


class Guard(Section):
    """Limits at which a run stops because its numbers have run away."""

    kinetic_energy_J: Positive = Field(default=20.0, description="of the whole body")
    height_m: Positive = Field(default=1.0, description="of any crossing above the ground, or off a pipe's wall")
    edge_strain: Positive = Field(default=0.05, description="of any edge of a rod")
    pin_gap_m: Positive = Field(default=0.15, description="between the two strands of a pinned crossing")
    depth_m: Positive = Field(default=0.05, description="of any vertex below the ground, or outside a pipe's wall")
    stretch: Positive = Field(
        default=1.1, description="of any axial spring, over the length at which the strands beside it are straight"
    )
    ring_closure: NonNegative = Field(
        default=1.0,
        description="least length of any ring, over that at which the strands of neighbouring crossings touch; 0: none",
    )


class RunConfig(Section):
    """Everything that defines a run; the run file carries it whole."""

    name: Line = Field(
        default="custom", max_length=200, description="name of the preset or of the user's own configuration"
    )
    summary: Line = Field(default="", max_length=1000, description="one line for the list of presets")
    duration_s: Positive = Field(default=5.0, description="simulated time")
    seed: Seed = Field(default=0, description="seed of every random draw")
    body: Body = WormBody()
    arena: ArenaSection | None = Field(default=None, description="the 3D worm's ground; planar worms have none")
    controller: ControllerSection = SnsController()
    turning: TurningSection | None = Field(
        default=None, description="what scales the two sides of a worm with half-rings"
    )
    sensor: StretchSensor = StretchSensor()
    clock: Clock = Clock()
    record: Record = Record()
    guard: Guard = Guard()

    @model_validator(mode="before")
    @classmethod
    def _ground_under_the_worm(cls, tree: Any) -> Any:
        if not isinstance(tree, Mapping) or tree.get("arena") is not None:
            return tree
        body = tree.get("body", {})
        kind = body.get("kind", "worm") if isinstance(body, Mapping) else getattr(body, "kind", "worm")
        return {**tree, "arena": {}} if kind == "worm" else tree

    @model_validator(mode="after")
    def _no_ground_for_planar_worms(self) -> Self:
        if isinstance(self.body, PlanarWorm) and self.arena is not None:
            raise ValueError(f"arena has no effect on body.kind = {self.body.kind!r}, which touches no ground")
        return self

    @model_validator(mode="after")
    def _the_worm_fits_into_the_entry(self) -> Self:
        if isinstance(self.arena, Pipe) and isinstance(self.body, WormBody):
            free, needed = self.arena.bore_m + self.arena.entry_clearance_m, self.body.mesh.radius_m
            if free < needed:
                raise ValueError(
                    f"arena.bore_m = {self.arena.bore_m:g}: with arena.entry_clearance_m = "
                    f"{self.arena.entry_clearance_m:g} it must be at least body.mesh.radius_m = {needed:g}, the worm "
                    "that starts inside; make it narrower further on with arena.profile"
                )
        return self

    @model_validator(mode="after")
    def _walls_and_relief_lie_along_x(self) -> Self:
        body, arena = self.body, self.arena
        if not isinstance(body, WormBody) or arena is None or not body.heading_deg:
            return self
        if type(arena) is not Floor:
            where = f"arena.kind = {arena.kind!r}"
        elif arena.rail_gap_m is not None:
            where = f"arena.rail_gap_m = {arena.rail_gap_m:g}"
        else:
            return self
        raise ValueError(
            f"body.heading_deg = {body.heading_deg:g}: must be 0 with {where}, which lies along x; take a floor "
            "without rails (arena.kind = 'floor')"
        )

    @model_validator(mode="after")
    def _contractions_are_of_segments_that_exist(self) -> Self:
        if isinstance(self.controller, Program):
            for i, contraction in enumerate(self.controller.contractions):
                if contraction.segment > self.body.n_segments:
                    raise ValueError(
                        f"controller.contractions.{i}.segment = {contraction.segment}: must be in "
                        f"1 .. {self.body.n_segments}, the segments of the body"
                    )
        return self

    @model_validator(mode="after")
    def _turning_needs_two_sides(self) -> Self:
        if self.turning is not None and not (isinstance(self.body, WormBody) and self.body.rings.layout == "halves"):
            raise ValueError(
                f"turning.kind = {self.turning.kind!r} needs a left and a right half of every ring: "
                "body.kind = 'worm' with body.rings.layout = 'halves'"
            )
        if isinstance(self.turning, Descending) and self.turning.shares is not None:
            n = len(self.turning.shares)
            if n != self.body.n_segments:
                raise ValueError(f"turning.shares has {n} entries: must have {self.body.n_segments}, one a segment")
        return self

    @model_validator(mode="after")
    def _contact_needs_ground(self) -> Self:
        contact = isinstance(self.controller, HeteroclinicChannel) and self.controller.feedback == "contact"
        if contact and isinstance(self.body, PlanarBody | Boxerbaum2012Body):
            raise ValueError(
                f"controller.feedback = 'contact' has no effect on body.kind = {self.body.kind!r}, which touches no "
                "ground: choose 'none' or 'stretch'"
            )
        return self

    @model_validator(mode="after")
    def _pressure_needs_a_skin(self) -> Self:
        if isinstance(self.controller, PressureSns) and not isinstance(self.body, WormBody):
            raise ValueError(
                f"controller.kind = 'sns-pressure' needs the touch of a skin, which body.kind = {self.body.kind!r} "
                "has not; only the 3D worm ('worm') has"
            )
        return self

    @model_validator(mode="after")
    def _intervals_are_whole_steps(self) -> Self:
        step = self.clock.control_timestep_s
        for field, value in (
            ("record.signals_interval_s", self.record.signals_interval_s),
            ("record.frames_interval_s", self.record.frames_interval_s),
            ("duration_s", self.duration_s),
        ):
            if not _is_multiple(value, step):
                raise ValueError(
                    f"{field} = {value:g} must be an integer multiple of clock.control_timestep_s = {step:g}"
                )
        return self

    @model_validator(mode="after")
    def _samples_have_an_end(self) -> Self:
        for field, interval in (
            ("record.signals_interval_s", self.record.signals_interval_s),
            ("record.frames_interval_s", self.record.frames_interval_s),
        ):
            if self.duration_s / interval > MOST_SAMPLES:
                raise ValueError(
                    f"duration_s = {self.duration_s:g} at {field} = {interval:g} makes more than {MOST_SAMPLES:,} "
                    "samples: shorten the run or lengthen the interval"
                )
        return self

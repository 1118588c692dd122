"""The whole of a run: the worm in its arena, its controller, clock, records and guards."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from annelid.config.arena import ArenaKind
from annelid.config.kinds import BodyKind, Choice, ControllerKind, TurningKind, default_of, kinds_of
from annelid.config.sections import Line, NonNegative, Positive, Section, Seed, Share
from annelid.errors import listed
from annelid.textfiles import parse_toml

Timestep = Annotated[float, Field(ge=1e-6, le=1.0)]
MOST_SAMPLES = 10_000_000


def _is_multiple(large: float, small: float) -> bool:
    ratio = large / small
    return round(ratio) >= 1 and abs(ratio - round(ratio)) < 1e-6 * ratio


@cache
def published_worms() -> Mapping[str, list[dict[str, Any]]]:
    """Returns what ``data/published.toml`` has under each name: worms, each with the fields given and its numbers."""
    file = resources.files("annelid") / "data" / "published.toml"
    return parse_toml(file.read_text(encoding="utf-8"), file.name)


def _known(name: str) -> str:
    if name not in published_worms():
        raise ValueError(f"must be one of {listed(sorted(published_worms()))}")
    return name


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


class StretchSensor(Section):
    """How the nervous system reads its segments' lengths."""

    tolerance_m: NonNegative = Field(default=0.010, description="on while a segment is within this of its rest length")
    hysteresis_m: NonNegative = Field(default=0.0, description="once on, stays on until this much beyond the tolerance")
    startup_hold_s: NonNegative = Field(
        default=0.2, description="sensor of segment 1 held off for this long at the start"
    )
    noise_m: NonNegative = Field(default=0.0, description="standard deviation of the noise on every reading")


class Record(Section):
    """What goes into the run file how often."""

    signals_interval_s: Positive = Field(default=0.005, description="interval of potentials, lengths and forces")
    frames_interval_s: Positive = Field(default=0.04, description="interval of whole postures, for pictures and video")


class Guard(Section):
    """Limits at which a run stops because its numbers have run away."""

    kinetic_energy_J: Positive = Field(default=20.0, description="of the whole body and of what moves in a scene")
    height_m: Positive = Field(
        default=1.0, description="of any crossing above the ground (in a scene: its z = 0), or off a pipe's wall"
    )
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


class Trial(Section):
    """What goes wrong on purpose, and what a controller may not know; fields that are not set do nothing.

    Every random draw depends on the run's seed and the time alone, so that a run continues bit for bit.
    """

    blind: bool = Field(
        default=False, description="the controller is built without arena, noise, trial or seed; reset with 0"
    )
    drift_m_per_s: NonNegative = Field(default=0.0, description="largest rate at which a reading of stretch drifts")
    resolution_m: NonNegative = Field(default=0.0, description="stretch is read in multiples of this")
    loss: Share = Field(default=0.0, description="share of the time in which a sensor keeps its last reading")
    loss_s: Annotated[float, Field(ge=0.01, le=1e4)] = Field(default=0.2, description="time that one loss lasts")
    delay_s: Annotated[float, Field(ge=0, le=2)] = Field(default=0.0, description="age of what the controller senses")
    backlash: Share = Field(default=0.0, description="change of a command that is lost where it reverses")
    weak_segment: int = Field(default=1, ge=1, le=200, description="segment that weakens")
    weak_strength: Share = Field(default=1.0, description="share of its activation that it is left")
    weak_from_s: NonNegative = Field(default=0.0, description="when it weakens")
    push_N: NonNegative = Field(default=0.0, description="force that pushes the ring of the middle segment to its left")
    push_from_s: NonNegative = Field(default=0.0, description="when the push begins")
    push_s: Positive = Field(default=0.5, description="time that it lasts")
    silent_s: NonNegative = Field(default=0.0, description="until then no command reaches a muscle")
    random_s: NonNegative = Field(default=0.0, description="until then random commands reach the muscles")

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has the segment that weakens, and can be pushed."""
        if self.weak_segment > config.body.n_segments:
            raise ValueError(
                f"trial.weak_segment = {self.weak_segment}: must be in 1 .. {config.body.n_segments}, the segments of "
                "the body"
            )
        if self.push_N and not config.body.can_be_pushed:
            raise ValueError(
                f"trial.push_N = {self.push_N:g}: body.kind = {config.body.kind!r} cannot be pushed; leave it at 0"
            )

    def blinded(self, config: RunConfig) -> RunConfig:
        """Returns what a blind controller may know of a configuration."""
        arena = None if config.arena is None else default_of(ArenaKind)
        sensor = config.sensor.model_copy(update={"noise_m": 0.0})
        return config.model_copy(update={"arena": arena, "sensor": sensor, "trial": None, "seed": 0})


class RunConfig(Section):
    """Everything that defines a run; the run file carries it whole."""

    name: Line = Field(
        default="custom", max_length=200, description="name of the preset or of the user's own configuration"
    )
    summary: Line = Field(default="", max_length=1000, description="one line for the list of presets")
    published: Annotated[str, AfterValidator(_known)] | None = Field(
        default=None, description="published numbers that its runs are compared with, where they are of such a worm"
    )
    duration_s: Positive = Field(default=5.0, description="simulated time")
    seed: Seed = Field(default=0, description="seed of every random draw")
    body: Annotated[BodyKind, Choice()] = Field(default_factory=lambda: default_of(BodyKind))
    arena: Annotated[ArenaKind, Choice()] | None = Field(
        default=None, description="the 3D worm's ground; planar worms have none"
    )
    controller: Annotated[ControllerKind, Choice()] = Field(default_factory=lambda: default_of(ControllerKind))
    turning: Annotated[TurningKind, Choice()] | None = Field(
        default=None, description="what scales the two sides of a worm with half-rings"
    )
    sensor: StretchSensor = StretchSensor()
    trial: Trial | None = Field(default=None, description="what goes wrong on purpose; nothing by default")
    clock: Clock = Clock()
    record: Record = Record()
    guard: Guard = Guard()

    @model_validator(mode="before")
    @classmethod
    def _ground_under_the_body(cls, tree: Any) -> Any:
        if not isinstance(tree, Mapping) or tree.get("arena") is not None:
            return tree
        body = tree.get("body", {})
        kind = body.get("kind", BodyKind.default) if isinstance(body, Mapping) else getattr(body, "kind", None)
        stands = kinds_of(BodyKind).get(kind) if isinstance(kind, str) else None
        return {**tree, "arena": {}} if stands is not None and stands.needs_arena else tree

    @model_validator(mode="after")
    def _sections_fit_together(self) -> Self:
        for section in (self.body, self.arena, self.controller, self.turning, self.trial):
            if section is not None:
                section.check_with(self)
        return self

    @model_validator(mode="after")
    def _intervals_divide_the_run(self) -> Self:
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
            if self.duration_s / value > MOST_SAMPLES:
                raise ValueError(
                    f"duration_s = {self.duration_s:g} at {field} = {value:g} makes more than {MOST_SAMPLES:,} "
                    "samples: shorten the run or lengthen the interval"
                )
        return self

"""The whole of a run, the families of kinds that it chooses from, and what each of them is asked.

These belong together: a run is made of kinds, and a kind is checked against its run, and built for it.
"""

from __future__ import annotations

import warnings
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources
from math import radians
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, Field, model_validator

from annelid.config.answers import Elements, Finding, Goals, OwnModel, Walls
from annelid.config.kinds import Choice, Kind, Knob, above, default_of, kinds_of
from annelid.config.sections import Friction, Impedance, Line, NonNegative, Positive, Section, Seed
from annelid.config.settings import Clock, Contraction, Guard, Record, StretchSensor, is_multiple
from annelid.errors import ConfigError, listed
from annelid.registry import Registry
from annelid.textfiles import parse_toml

if TYPE_CHECKING:
    import mujoco

    from annelid.arena.centre_line import Bore, Course
    from annelid.arena.surface import Shape, Surface
    from annelid.morphology import MeshGeometry
    from annelid.protocols import Array, Controller, Plant, Sensation, Values

MOST_SAMPLES = 10_000_000


@cache
def published_worms() -> Mapping[str, list[dict[str, Any]]]:
    """Returns what ``data/published.toml`` has under each name: worms, each with the fields given and its numbers."""
    file = resources.files("annelid") / "data" / "published.toml"
    return parse_toml(file.read_text(encoding="utf-8"), file.name)


def _known(name: str) -> str:
    if name not in published_worms():
        raise ValueError(f"must be one of {listed(sorted(published_worms()))}")
    return name


class ControllerKind(Kind):
    """Base of the controllers' sections.

    Attributes:
        sensor_fields: Fields of the section ``sensor`` that it uses.
        tuned: What `annelid tune` varies unless the user says otherwise, its timing and its sensors' switching: each
            ``FIELD=LOW:HIGH`` or ``FIELD=LOW:HIGH:log``.
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("controller.kind", "annelid.control")
    default: ClassVar[str] = "sns"
    sensor_fields: ClassVar[frozenset[str]] = frozenset()
    tuned: ClassVar[tuple[str, ...]] = ()

    @property
    def scheduled(self) -> tuple[Contraction, ...]:
        """The contractions that are scheduled beforehand, none for a controller that makes them itself."""
        return ()

    @abstractmethod
    def build(self, config: RunConfig, plant: Plant) -> Controller:
        """Builds the controller in its initial state.

        Args:
            config: The configuration that the section is of.
            plant: The body that it drives.

        Raises:
            ConfigError: It cannot be built with these values.
        """


class TurningKind(Kind):
    """Base of the sections that scale the two sides of a worm with half-rings, by a rule with a state of its own.

    Attributes:
        senses: What the rule senses, names in `annelid.control.SENSED`.
    """

    senses: ClassVar[tuple[str, ...]] = ()
    registry: ClassVar[Registry[type[Any]]] = Registry("turning.kind", "annelid.control.turning")
    default: ClassVar[str] = "constant"

    def check_with(self, config: RunConfig) -> None:
        """Checks that the body has two sides."""
        if not config.body.has_halves:
            raise ValueError(
                f"turning.kind = {self.kind!r} needs a left and a right half of every ring: body.kind = 'worm' with "
                "body.rings.layout = 'halves'"
            )

    @property
    def goals(self) -> Goals:
        """The places on the ground that the worm is steered to."""
        return Goals()

    @abstractmethod
    def at_start(self) -> dict[str, Any]:
        """Returns the state with which both sides are whole."""

    @abstractmethod
    def advance(self, now: dict[str, Any], sensation: Sensation, timestep_s: float) -> None:
        """Takes one control step, in place.

        Raises:
            ConfigError: The body cannot sense what the rule needs.
        """

    @abstractmethod
    def scales(self, now: dict[str, Any], n_segments: int) -> Array:
        """Returns what is left of the activation of each half, in [0, 1], ``(n_segments, 2)``: left and right half."""


class BodyKind(Kind):
    """Base of the bodies' sections: what analysis, pictures, views, exports and checks ask a body.

    A body has one of three shapes: the mesh of a 3D worm (`geometry`), the model of a robot (`own_model`), or that of a
    planar body, which moves along x and z (`outlines`).

    Attributes:
        needs_arena: Whether it stands on an arena, the default one where none is given.
        is_planar: Whether it moves in one plane, and is drawn from its side.
        has_skin: Whether the sides of its segments feel touch.
        can_be_pushed: Whether a trial may push it.
        is_papers: Whether it is in the paper's own formulation, which others are compared with.
        has_rigid_crossings: Whether the two strands of a crossing share a point.
        segments_field: Dotted path of the field that says how many segments it has.
        frame_size: Width and height of a picture, pixels.
        video_size: The same of a video, multiples of 16, as its codec likes them.
        n_segments: Actuated segments.
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("body.kind", "annelid.body.worm")
    default: ClassVar[str] = "worm"
    needs_arena: ClassVar[bool] = False
    is_planar: ClassVar[bool] = False
    has_skin: ClassVar[bool] = False
    can_be_pushed: ClassVar[bool] = False
    segments_field: ClassVar[str] = "body.n_segments"
    frame_size: ClassVar[tuple[int, int]] = (1280, 800)
    video_size: ClassVar[tuple[int, int]] = (960, 544)

    @property
    def is_papers(self) -> bool:
        """As the class says."""
        return False

    @property
    def has_rigid_crossings(self) -> bool:
        """As the class says."""
        return False

    def geometry(self) -> MeshGeometry | None:
        """Returns the mesh at rest; None for a body that is no mesh of strands."""
        return None

    def outlines(self, values: Values) -> Array:
        """Returns where the sides of the segments of a planar body are.

        Args:
            values: The signals that it records, by name: of one instant, or of many along a first axis.

        Returns:
            Corners of every segment in the order in which they are drawn, x and z, m, ``(.., n_segments, n_corners,
            2)``.

        Raises:
            ConfigError: It is no planar body, or one without this method.
        """
        raise ConfigError(
            f"body.kind = {self.kind!r} cannot be drawn or viewed: its class gives no outlines. Write its method "
            "outlines(values) and set is_planar = True; docs/how_to/own_kind.md has an example"
        )

    @property
    def first_sensor(self) -> str:
        """Where the first of a segment's stretch sensors lies, in words; empty where there is but one."""
        return ""

    @property
    def elements(self) -> Elements | None:
        """How finely it is divided; None where that means nothing."""
        return None

    @property
    def step_cost_ms(self) -> float:
        """About how long a physics step takes on one core, ms."""
        return 0.05

    def findings(self, config: RunConfig) -> Iterator[Finding]:
        """Checks the numbers of a run against one another, before anything is computed; by default finds nothing.

        Args:
            config: The configuration that the section is of.
        """
        yield from ()

    def refuse_fidelity(self, level: str) -> None:
        """Refuses a level of fidelity (`annelid.config.fidelity`) where it was not measured.

        Raises:
            ConfigError: The levels are not for this body.
        """
        raise ConfigError(
            f"fidelity = {level!r} is for the 3D worm (body.kind = 'worm'), not for body.kind = {self.kind!r}"
        )

    @property
    def wall_distance_m(self) -> float | None:
        """Distance of the walls that a planar worm crawls between; None where there are none."""
        return None

    @property
    def own_model(self) -> OwnModel | None:
        """The model of a robot that a file describes whole; None where annelid builds it."""
        return None

    if TYPE_CHECKING:

        @property
        def n_segments(self) -> int:
            """A field of some bodies, and follows from other fields in others."""
            ...

    @property
    def has_halves(self) -> bool:
        """Whether each segment has a left and a right muscle."""
        return False

    @abstractmethod
    def build(self, config: RunConfig) -> Plant:
        """Builds the body at rest.

        Args:
            config: The configuration that the section is of.

        Raises:
            ConfigError: It cannot be built with these values.
        """


class ArenaKind(Kind):
    """Base of the arenas' sections: the fields of every ground, and what the body, the pictures and the tasks ask it.

    Attributes:
        is_closed: Whether its walls surround the worm; they are drawn so that one sees through them.
        is_scene: Whether all that the skin touches comes from `add_own`, as geoms that the engine collides with it.
    """

    registry: ClassVar[Registry[type[Any]]] = Registry("arena.kind", "annelid.arena.kinds")
    default: ClassVar[str] = "floor"
    is_closed: ClassVar[bool] = False
    is_scene: ClassVar[bool] = False

    friction: Friction = Field(default=1.0, description="coefficient of sliding friction")
    backward_friction: Friction | None = Field(
        default=None, description="the same where the skin slides towards the worm's rear, as setae do (not set: alike)"
    )
    gravity_m_per_s2: NonNegative = Field(default=9.81, description="0 for a weightless worm")
    contact_time_constant_s: Positive = Field(default=0.02, description="solref time constant of the contacts")
    contact_impedance: Impedance = Field(
        default=(0.9, 0.95, 0.001), description="solimp (d0, dwidth, width) of the contacts"
    )

    def knobs(self) -> tuple[Knob, ...]:
        """Returns its friction, as `Kind.knobs`."""
        sliding = f"Sliding friction of skin and ground ({'forwards' if self.has_setae else 'any direction'}). "
        hint = sliding + "Takes effect in the next step."
        return (Knob("arena.friction", "friction", 1.0, 0.01, above(self.friction, 2.0), 0.01, hint),)

    @property
    def has_setae(self) -> bool:
        """Whether friction depends on the direction in which the skin slides."""
        return self.backward_friction not in (None, self.friction)

    @property
    def has_moving_planes(self) -> bool:
        """Whether the skin feels the ground through planes that move with it, not through a plane of the engine."""
        return not self.is_plane or self.has_setae

    @property
    def is_plane(self) -> bool:
        """Whether its ground is one plane."""
        return False

    @property
    def walls(self) -> Walls:
        """What stands upright on it."""
        return Walls()

    @property
    def slope_rad(self) -> float:
        """How steeply the model's axes rise towards -x, rad; level without a field ``slope_deg``."""
        return radians(getattr(self, "slope_deg", 0.0))

    @property
    @abstractmethod
    def floor_depth_m(self) -> float:
        """How far the floor that is drawn lies below the mesh's lowest line at the start, m."""

    @abstractmethod
    def ground(self) -> Surface:
        """Returns its surface without what stands upright on it, in the coordinates of the worm's model."""

    def centre_line(self) -> Course | None:
        """Returns the centre line of a pipe, None where there is none."""
        return None

    def bore(self) -> Bore | None:
        """Returns the radius along the centre line, None where there is none."""
        return None

    def reach_m(self) -> tuple[float, float] | None:
        """Returns the arc lengths of a pipe between which it bends or changes its bore, None where there is no pipe."""
        return None

    def shape(self, length_m: float) -> Shape | None:
        """Returns the shape of its ground to be drawn, None where a plane is.

        Args:
            length_m: Length of the worm, which stands or lies in it.
        """
        return None

    @property
    def object_names(self) -> tuple[str, ...]:
        """Names of the things that move in it, in the order of the model."""
        return ()

    def add_own(self, spec: mujoco.MjSpec) -> None:
        """Adds what it has beyond its surface to a worm's spec: nothing unless `is_scene`."""

    def add_panels(self, spec: mujoco.MjSpec, length_m: float) -> None:
        """Adds geoms that hold a worm in plain MuJoCo where the ground is not one plane; they are not drawn.

        Args:
            spec: The worm's spec.
            length_m: Length of the worm.
        """


SHARED = tuple(name for name in ArenaKind.model_fields if name != "kind")
"""Fields of every arena; a worm that is put elsewhere keeps those that the place does not state."""


class TrialKind(Kind):
    """Base of the sections of what goes wrong on purpose between a controller and its body; annelid has none itself."""

    registry: ClassVar[Registry[type[Any]]] = Registry("trial.kind")
    default: ClassVar[str] = "faults"

    def known(self, config: RunConfig, plant: Plant) -> tuple[RunConfig, Plant]:
        """Returns what a controller may know of its run and its body when it is built: all of it."""
        return config, plant

    @abstractmethod
    def between(self, controller: Controller, config: RunConfig, plant: Plant) -> Controller:
        """Returns a controller with all that goes wrong between it and the body; what can be saved still can.

        Args:
            controller: The controller.
            config: The configuration that the section is of.
            plant: The body.
        """


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
    trial: Annotated[TrialKind, Choice()] | None = Field(
        default=None, description="what goes wrong on purpose; nothing by default"
    )
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
        if not is_multiple(self.duration_s, step):
            whole = float(f"{max(round(self.duration_s / step), 1) * step:.9g}")
            was = f"duration_s = {self.duration_s:g}"
            warnings.warn(f"{was} is taken as {whole:g}, a whole number of control steps", stacklevel=2)
            object.__setattr__(self, "duration_s", whole)  # The section is frozen.
        for field, value in (
            ("record.signals_interval_s", self.record.signals_interval_s),
            ("record.frames_interval_s", self.record.frames_interval_s),
        ):
            if not is_multiple(value, step):
                raise ValueError(
                    f"{field} = {value:g} must be an integer multiple of clock.control_timestep_s = {step:g}"
                )
            if self.duration_s / value > MOST_SAMPLES:
                raise ValueError(
                    f"duration_s = {self.duration_s:g} at {field} = {value:g} makes more than {MOST_SAMPLES:,} "
                    "samples: shorten the run or lengthen the interval"
                )
        return self

"""The 3D worm's body: mesh, materials, springs, and any kind of ring actuators and formulation."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from math import pi
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from annelid.body.actuators import ActuatorKind
from annelid.body.formulations import FormulationKind
from annelid.config.kinds import Choice, default_of
from annelid.config.run import BodyKind, RunConfig
from annelid.config.sections import Length, Modulus, NonNegative, PerSegmentOf, Positive, Section
from annelid.errors import ConfigError, shown

if TYPE_CHECKING:
    from annelid.body.actuators.muscle import Rings
    from annelid.protocols import Plant

EQUAL_STIFFNESS_RADIUS_M = 0.00299
"""Radius of a solid strand that bends as the robot's tube: the authors' choice of 2025."""
ALIKE_IN_A_GROUP = ("mesh", "strands", "pins", "springs")
"""Sections that decide how much a segment resists its ring."""
RelativeFriction = Annotated[float, Field(ge=0.01, le=100)]
LONGEST_BUILD_S = 100.0
"""Estimated time to build a body, above which it is refused, s."""


class Mesh(Section):
    """Geometry of the helical mesh (lengths in m)."""

    segment_fields: ClassVar[tuple[str, ...]] = ("radius_m",)
    n_segments: Annotated[int, Field(ge=3, le=200)] = Field(default=3, description="actuated segments")
    n_helices: Annotated[int, Field(ge=6, le=96)] = Field(
        default=12, description="strands, half of each handedness; even"
    )
    radius_m: PerSegmentOf[Length] = Field(
        default=0.16,
        description="radius of the tube at rest, one number for all or one per segment: that of its ring, linear "
        "between two rings and the same beyond the first and the last",
    )
    angular_rate_rad_per_m: Annotated[float, Field(ge=1e-3, le=1e4)] = Field(
        default=14.0, description="turn of a strand per metre of body; the pitch is 2 pi over this"
    )
    elements_per_side: Annotated[int, Field(ge=1, le=32)] = Field(
        default=3, description="straight elements between neighbouring crossings"
    )
    elements_per_end: Annotated[int, Field(ge=1, le=32)] | None = Field(
        default=None, description="straight elements in each free end of a strand; default as many as in a side"
    )
    planes_between_rings: Annotated[int, Field(ge=2, le=50)] = Field(
        default=4, description="crossing planes from one ring to the next"
    )
    free_planes_at_ends: Annotated[int, Field(ge=1, le=50)] = Field(
        default=3, description="crossing planes before the first and after the last ring"
    )
    rear_overhang_m: Annotated[float, Field(ge=1e-4, le=1e3)] | None = Field(
        default=None,
        description="free strand behind the last crossing, along the body; default half a plane spacing",
    )

    @field_validator("n_helices")
    @classmethod
    def _even(cls, value: int) -> int:
        if value % 2:
            raise ValueError("the number of helices must be even, half of each handedness, and at least 6")
        return value

    @property
    def radii_m(self) -> list[float]:
        """Radius of every ring at rest, m."""
        return self.of_each("radius_m", self.n_segments)


class Strands(Section):
    """Material of the strands.

    Where segments differ, each part has the value of the segment whose ring is nearest at rest, and midway between two
    rings their mean.
    """

    segment_fields: ClassVar[tuple[str, ...]] = ("young_modulus_Pa", "shear_modulus_Pa", "linear_density_kg_per_m")
    radius_m: Length = Field(default=0.002, description="radius of the solid round cross-section")
    young_modulus_Pa: PerSegmentOf[Modulus] = Field(
        default=0.3e9, description="resists bending, one number for all or one per segment"
    )
    shear_modulus_Pa: PerSegmentOf[Modulus] = Field(
        default=0.2e9, description="resists twisting, one number for all or one per segment"
    )
    relative_stiffness: tuple[Annotated[float, Field(ge=1e-3, le=1e3)], ...] | None = Field(
        default=None,
        description="of every strand, in bending and in twist, over what moduli and radius give: one number per "
        "strand, first all clockwise ones, then all others (not set: all alike)",
    )
    linear_density_kg_per_m: PerSegmentOf[Positive] = Field(
        default=0.01291, description="mass per length of strand, one number for all or one per segment"
    )
    damping_time_s: NonNegative = Field(
        default=0.145,
        description="Kelvin-Voigt time of the material, its viscous over its elastic modulus, for bending in every "
        "direction and twist",
    )

    @property
    def bending_rigidity_Nm2(self) -> float:
        """Bending moment per curvature, E I, N m^2."""
        return self.one_number("young_modulus_Pa") * pi * self.radius_m**4 / 4

    @property
    def stiffness_differs(self) -> bool:
        """Whether it is not that of one material everywhere."""
        moduli = (self.young_modulus_Pa, self.shear_modulus_Pa)
        along = any(isinstance(value, tuple) and len(set(value)) > 1 for value in moduli)
        return along or any(share != 1.0 for share in self.relative_stiffness or ())


class Pins(Section):
    """The pins that join two strands at a crossing."""

    segment_fields: ClassVar[tuple[str, ...]] = ("mass_kg",)
    mass_kg: PerSegmentOf[Positive] = Field(
        default=0.00052,
        description="mass of one pin, one number for all or one per segment: for pins nearest to its ring, midway "
        "between two rings the mean",
    )
    radius_m: Length = Field(default=0.005, description="radius of the drawn sphere")


class Joints(Section):
    """Resistance of the crossings to a change of the angle between their two strands."""

    dry_friction_Nm: NonNegative = Field(
        default=0.0, description="Coulomb torque of one crossing, at the angle it has at rest"
    )
    viscous_friction_Nms_per_rad: NonNegative = Field(
        default=0.0, description="torque of one crossing per angular velocity, at the angle it has at rest"
    )


class Springs(Section):
    """Axial springs between crossings two planes apart at the same angle."""

    segment_fields: ClassVar[tuple[str, ...]] = ("stiffness_N_per_m", "rest_length_m")
    stiffness_N_per_m: PerSegmentOf[NonNegative] = Field(
        default=19.9,
        description="spring rate, one number for all or one per segment: for springs whose middle is nearest to its "
        "ring, midway between two rings the mean",
    )
    rest_length_m: PerSegmentOf[Positive] | None = Field(
        default=None,
        description="one number for all or one per segment, as the stiffness (not set: as drawn, unstretched at rest)",
    )
    tension_only: bool = Field(default=False, description="true: slack below rest length; false: pushes as well")
    sensors: Literal["all", "sides"] = Field(
        default="all",
        description="which of the springs that span a ring carry a stretch sensor: all, or the leftmost (-y) and the "
        "rightmost",
    )

    @property
    def first_sensor(self) -> str:
        """Where the first stretch sensor of a segment lies, in words."""
        return "first helix" if self.sensors == "all" else "left side"


class WormBody(BodyKind):
    """Any 3D worm of helical strands, rings and springs on the ground."""

    cites: ClassVar[tuple[tuple[str, str], ...]] = (
        ("todorov2012", "the physics engine"),
        ("wang", "the robot that the 3D worm is a model of"),
    )
    needs_arena: ClassVar[bool] = True
    can_be_pushed: ClassVar[bool] = True
    has_skin: ClassVar[bool] = True
    segment_fields: ClassVar[tuple[str, ...]] = ("relative_friction",)
    heading_deg: Annotated[float, Field(ge=-360, le=360)] = Field(
        default=0.0,
        description="where the worm leads at the start, about its front end: 0 is towards -x, positive to its left "
        "(90: towards -y)",
    )
    relative_friction: PerSegmentOf[RelativeFriction] | None = Field(
        default=None,
        description="friction of the skin over that of the arena, one number for all or one per segment: for the skin "
        "nearest to its ring, midway between two rings the mean (not set: 1)",
    )
    mesh: Mesh = Mesh()
    strands: Strands = Strands()
    pins: Pins = Pins()
    joints: Joints | None = None
    springs: Springs = Springs()
    rings: Annotated[ActuatorKind, Choice()] = Field(default_factory=lambda: default_of(ActuatorKind))
    formulation: Annotated[FormulationKind, Choice()] = Field(default_factory=lambda: default_of(FormulationKind))

    def build(self, config: RunConfig) -> Plant:
        """Builds the worm's plant, as `BodyKind.build`."""
        # The simulation is built on this module, and loads the engine.
        return import_module("annelid.simulation.worm").WormPlant(config)

    def refuse_fidelity(self, level: str) -> None:
        """Refuses a level where the formulation does."""
        self.formulation.refuse_fidelity(level)

    @property
    def has_halves(self) -> bool:
        """Whether its rings are halved."""
        return self.rings.layout == "halves"

    @property
    def n_segments(self) -> int:
        """Number of actuated segments."""
        return self.mesh.n_segments

    @property
    def relative_frictions(self) -> list[float]:
        """Friction of every segment's skin over that of the arena."""
        given = self.relative_friction is not None
        return self.of_each("relative_friction", self.n_segments) if given else [1.0] * self.n_segments

    def groups(self) -> list[tuple[list[int], Self]]:
        """Groups the segments whose mesh, strands, pins and springs are alike.

        Returns:
            The segments of every group, counted from 0, and the body as if all segments were as these, with the lengths
            and forces of their rings alone. So those sections have one number where they may have one per segment.
        """
        parts: dict[str, Section] = {name: getattr(self, name) for name in ALIKE_IN_A_GROUP}
        n, groups = self.n_segments, dict[tuple[float, ...], list[int]]()
        of_each = [part.of_each(name, n) for part in parts.values() for name in part.segment_fields]
        for segment, numbers in enumerate(zip(*of_each, strict=True)):
            groups.setdefault(numbers, []).append(segment)
        rings = {} if len(groups) == 1 else {tuple(own): self.rings.of_segments(own, n) for own in groups.values()}

        def alone(own: list[int]) -> Self:
            alike = {name: part.of_segment(own[0]) for name, part in parts.items()}
            return self.model_copy(update={**alike, "rings": rings.get(tuple(own), self.rings)})

        return [(own, alone(own)) for own in groups.values()]

    @property
    def muscles(self) -> Rings:
        """The ring muscles; `ConfigError` where the rings have actuators of another kind."""
        if self.rings.muscle is None:
            raise ConfigError(
                f"body.rings.kind = {self.rings.kind!r} has no muscles; this needs body.rings.kind = 'muscle'"
            )
        return self.rings.muscle

    def cited(self) -> tuple[tuple[str, str], ...]:
        """Returns the engine and the robot, and what formulation, strands and actuators rest on."""
        strands: tuple[tuple[str, str], ...] = ()
        if self.strands.radius_m == EQUAL_STIFFNESS_RADIUS_M:
            strands = (
                ("riddle2025", "strands of the stiffness of the robot's tubes"),
                ("riddle2025models", "its model files"),
            )
        return (*self.cites, *self.formulation.cited(), *strands, *self.rings.cited())

    def _fields_per_segment(self) -> Iterator[tuple[str, Section, str]]:
        """Yields every field that takes one number per segment: path and section that have it, and its name."""
        yield from (("body", self, name) for name in self.segment_fields)
        for part in ALIKE_IN_A_GROUP:
            section: Section = getattr(self, part)
            yield from ((f"body.{part}", section, name) for name in section.segment_fields)
        yield "body.rings", self.rings, self.rings.force_field

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        mesh = self.mesh
        planes = mesh.planes_between_rings * (mesh.n_segments - 1) + 2 * mesh.free_planes_at_ends
        at_ends = 2 * (mesh.elements_per_end or mesh.elements_per_side)
        elements = mesh.n_helices * (mesh.elements_per_side * planes + at_ends)
        time_s, memory_GB = self.formulation.build_cost(elements, mesh.n_helices)
        if time_s > LONGEST_BUILD_S:
            raise ValueError(
                f"body.mesh.n_segments = {mesh.n_segments}, body.mesh.n_helices = {mesh.n_helices} and "
                f"body.mesh.elements_per_side = {mesh.elements_per_side} make {elements:,} elements, which take about "
                f"{time_s:,.0f} s and {memory_GB:,.1f} GB to build; at most {LONGEST_BUILD_S:g} s are allowed: lower "
                "one of them"
            )
        return self

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        mesh, rings, n = self.mesh, self.rings, self.mesh.n_segments
        for path, section, name in self._fields_per_segment():
            if (given := len(section.of_each(name, n))) != n:
                raise ValueError(
                    f"{path}.{name} = {shown(list(getattr(section, name)))} has {given} numbers for {n} segments: "
                    f"give a number, or {n} numbers, one per segment"
                )
        of_strands, n_strands = self.strands.relative_stiffness, mesh.n_helices
        if of_strands is not None and len(of_strands) != n_strands:
            raise ValueError(
                f"body.strands.relative_stiffness = {shown(list(of_strands))} has {len(of_strands)} numbers for "
                f"{n_strands} strands: give {n_strands} numbers, one per strand, or 'none'"
            )
        self.formulation.check_body(self)
        if self.strands.radius_m >= min(mesh.radii_m):
            raise ValueError(
                f"body.strands.radius_m = {self.strands.radius_m:g} must be less than body.mesh.radius_m = "
                f"{min(mesh.radii_m):g}"
            )
        if self.has_halves and mesh.n_helices % 4:
            raise ValueError(
                "body.rings.layout = 'halves' needs body.mesh.n_helices to be a multiple of 4, "
                f"not {mesh.n_helices}: equal halves need an even number of crossings round a ring"
            )
        if (given := len(rings.length_ranges(n))) != n:
            raise ValueError(
                f"body.rings.length_range_m gives {given} ranges for {n} segments: "
                "give one pair for each, or one for all, for example body.rings.length_range_m=[0.566,1.067]"
            )
        return self


class HelicalWorm(WormBody):
    """The 3D worm."""

    kind: Literal["worm"] = "worm"

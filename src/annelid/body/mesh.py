"""The 3D worm's mesh: its geometry, materials, pins and springs, all that does not depend on rings or formulation."""

from __future__ import annotations

from math import pi
from typing import Annotated, ClassVar, Literal

from pydantic import Field, field_validator

from annelid.config.answers import Elements
from annelid.config.kinds import Knob, two_digits
from annelid.config.run import BodyKind
from annelid.config.sections import Length, Modulus, NonNegative, PerSegmentOf, Positive, Section
from annelid.morphology import MeshGeometry, helical_mesh

MOST_ELEMENTS = 32


class Mesh(Section):
    """Geometry of the helical mesh (lengths in m)."""

    segment_fields: ClassVar[tuple[str, ...]] = ("radius_m",)
    n_segments: Annotated[int, Field(ge=3, le=200)] = Field(default=3, description="actuated segments")
    n_helices: Annotated[int, Field(ge=6, le=96)] = Field(
        default=12, description="strands, half of each handedness; even"
    )
    radius_m: PerSegmentOf[Length] = Field(
        default=0.16,
        description="radius of the tube at rest: one number, or one for the ring of each segment, linear between rings",
    )
    angular_rate_rad_per_m: Annotated[float, Field(ge=1e-3, le=1e4)] = Field(
        default=14.0, description="turn of a strand per metre of body; the pitch is 2 pi over this"
    )
    elements_per_side: Annotated[int, Field(ge=1, le=MOST_ELEMENTS)] = Field(
        default=3, description="straight elements between neighbouring crossings"
    )
    elements_per_end: Annotated[int, Field(ge=1, le=MOST_ELEMENTS)] | None = Field(
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

    def geometry(self) -> MeshGeometry:
        """Returns the mesh at rest."""
        return helical_mesh(**self.model_dump())


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
        """Whether segments have strands of another material."""
        moduli = (self.young_modulus_Pa, self.shear_modulus_Pa)
        return any(isinstance(value, tuple) and len(set(value)) > 1 for value in moduli)


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


class MeshBody(BodyKind):
    """A 3D worm without its rings and its formulation, which ask it what they need."""

    mesh: Mesh = Mesh()
    strands: Strands = Strands()
    pins: Pins = Pins()
    joints: Joints | None = None
    springs: Springs = Springs()

    segments_field: ClassVar[str] = "body.mesh.n_segments"

    @property
    def n_segments(self) -> int:
        """Number of actuated segments."""
        return self.mesh.n_segments

    def geometry(self) -> MeshGeometry:
        """Returns the mesh at rest."""
        return self.mesh.geometry()

    def knobs(self) -> tuple[Knob, ...]:
        """Returns the stiffness of strands and springs, as `Kind.knobs`; a slider has one number, for all segments."""
        rebuilt, knobs = "The body is rebuilt and goes on where it is.", []
        if isinstance(modulus_Pa := self.strands.young_modulus_Pa, float):
            field, gpa = "body.strands.young_modulus_Pa", 1e-9 * modulus_Pa
            low, high, step = map(two_digits, (gpa / 4, 4 * gpa, gpa / 40))
            hint = f"Young's modulus of the strands, which resists bending. {rebuilt}"
            knobs.append(Knob(field, "strands (GPa)", 1e-9, low, high, step, hint))
        if isinstance(rate := self.springs.stiffness_N_per_m, float):
            field, high = "body.springs.stiffness_N_per_m", two_digits(4 * rate) or 100.0
            knobs.append(
                Knob(field, "springs (N/m)", 1.0, 0.0, high, 0.1, f"Stiffness of the axial springs. {rebuilt}")
            )
        return tuple(knobs)

    @property
    def first_sensor(self) -> str:
        """Where the first stretch sensor of a segment lies."""
        return self.springs.first_sensor

    @property
    def elements(self) -> Elements:
        """Straight elements between neighbouring crossings."""
        return Elements("body.mesh.elements_per_side", self.mesh.elements_per_side, MOST_ELEMENTS)

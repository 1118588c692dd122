"""The 3D worm's body: mesh, materials, rings, and the two formulations."""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, Tag, field_validator, model_validator

from annelid.config.kinds import BodyKind
from annelid.config.sections import Impedance, Length, Modulus, NonNegative, Positive, Range, Section, kind_or
from annelid.errors import ConfigError

if TYPE_CHECKING:
    from annelid.config.run import RunConfig
    from annelid.protocols import Plant

JOINT_DAMPING = 0.12
"""The paper's, N m s/rad."""
LONGEST_BUILD_S = 100.0
"""Estimated time to build a body, above which it is refused, s."""


class Mesh(Section):
    """Geometry of the helical mesh (lengths in m)."""

    n_segments: Annotated[int, Field(ge=3, le=200)] = Field(default=3, description="actuated segments")
    n_helices: Annotated[int, Field(ge=6, le=96)] = Field(
        default=12, description="strands, half of each handedness; even"
    )
    radius_m: Length = Field(default=0.16, description="radius of the tube at rest")
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


class Strands(Section):
    """Material of the strands."""

    radius_m: Length = Field(default=0.002, description="radius of the solid round cross-section")
    young_modulus_Pa: Modulus = Field(default=0.3e9, description="resists bending")
    shear_modulus_Pa: Modulus = Field(default=0.2e9, description="resists twisting")
    linear_density_kg_per_m: Positive = Field(default=0.01291, description="mass per length of strand")
    damping_time_s: NonNegative | None = Field(
        default=None,
        description="Kelvin-Voigt time of the material, its viscous over its elastic modulus, for bending in every "
        "direction and twist (not set: loss_factor or joint_damping_Nms_per_rad)",
    )
    loss_factor: Annotated[float, Field(ge=0, le=10)] | None = Field(
        default=None,
        description="tan delta of the material at loss_frequency_Hz, instead of damping_time_s (not set: none)",
    )
    loss_frequency_Hz: Positive | None = Field(
        default=None, description="frequency at which the loss factor holds (not set: none)"
    )
    joint_damping_Nms_per_rad: NonNegative = Field(
        default=JOINT_DAMPING,
        description="viscous resistance to bending between two elements whatever their length; not used where the "
        "material's damping is given",
    )

    @model_validator(mode="after")
    def _damped_in_one_way(self) -> Self:
        if self.damping_time_s is not None and self.loss_factor is not None:
            raise ValueError(
                f"body.strands.damping_time_s = {self.damping_time_s:g} and body.strands.loss_factor = "
                f"{self.loss_factor:g} both give the damping of the material: set one of them to 'none'"
            )
        if self.material_damping_s is not None and self.joint_damping_Nms_per_rad != JOINT_DAMPING:
            raise ValueError(
                f"body.strands.joint_damping_Nms_per_rad = {self.joint_damping_Nms_per_rad:g} has no effect where the "
                "damping of the material is given: set body.strands.damping_time_s, or set that to 'none'"
            )
        if (self.loss_factor is None) != (self.loss_frequency_Hz is None):
            raise ValueError(
                "body.strands.loss_factor needs body.strands.loss_frequency_Hz, the frequency at which it holds, and "
                "the other way round"
            )
        return self

    @property
    def material_damping_s(self) -> float | None:
        """Kelvin-Voigt time of the material, s; None where each joint has a damping of its own instead."""
        if self.loss_factor is not None and self.loss_frequency_Hz is not None:
            return self.loss_factor / (2 * pi * self.loss_frequency_Hz)
        return self.damping_time_s

    @property
    def bending_rigidity_Nm2(self) -> float:
        """Bending moment per curvature, E I, N m^2."""
        return self.young_modulus_Pa * pi * self.radius_m**4 / 4

    def joint_damping(self, stiffness_Nm_per_rad: float) -> float:
        """Returns the damping of a joint between two elements with a stiffness, N m s/rad."""
        time_s = self.material_damping_s
        return self.joint_damping_Nms_per_rad if time_s is None else time_s * stiffness_Nm_per_rad


class Pins(Section):
    """The pins that join two strands at a crossing."""

    mass_kg: Positive = Field(default=0.00052, description="mass of one pin")
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

    stiffness_N_per_m: NonNegative = Field(default=19.9, description="spring rate")
    rest_length_m: Positive | None = Field(default=None, description="default: two plane spacings, unstretched at rest")
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


def _not_empty(value: Any, actuators: str) -> Any:
    if value == ():
        raise ValueError(f"needs one number for all {actuators} or one a segment")
    return value


def _one_a_segment(value: float | tuple[float, ...], n_segments: int) -> list[float]:
    return list(value) if isinstance(value, tuple) else [value] * n_segments


class RingCables(Section):
    """What ring actuators of all kinds have in common: how they lie, and between which lengths they work."""

    layout: Literal["whole", "halves"] = Field(
        default="whole",
        description="one actuator round the body, or a left (-y: segment 1 leads towards -x) and a right one",
    )
    length_range_m: Range | tuple[Range, ...] = Field(
        default=(0.566, 1.067),
        description="operating range of a whole ring, one pair for all or one pair a segment",
    )

    @field_validator("length_range_m")
    @classmethod
    def _ordered(cls, value: Any) -> Any:
        if not value:
            raise ValueError("needs one pair for all rings or one pair a segment")
        for low, high in value if isinstance(value[0], tuple) else (value,):
            if low >= high:
                raise ValueError("each length range needs its lower bound below its upper bound")
        return value

    def length_ranges(self, n_segments: int) -> list[tuple[float, float]]:
        """Returns one operating range for each segment's whole ring, m."""
        if isinstance(self.length_range_m[0], tuple):
            return [(float(low), float(high)) for low, high in self.length_range_m]  # type: ignore[misc]
        low, high = self.length_range_m
        return [(float(low), float(high))] * n_segments  # type: ignore[arg-type]


class Rings(RingCables):
    """Ring muscles: MuJoCo's force-length-velocity muscle on a closed ring (or two half-rings).

    The muscle's optimal length is ``(length_range[1] - length_range[0]) / (1.05 - 0.75)``: MuJoCo scales the
    given range to 0.75-1.05 of it. The force is ``peak_force_N * (activation * FL * FV + FP)``.
    """

    kind: Literal["muscle"] = "muscle"
    peak_force_N: Positive | tuple[Positive, ...] = Field(
        default=117.57, description="isometric force at the optimal length, F0, one number for all or one a segment"
    )
    minimum_length: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.58, description="lmin, relative to the optimal length"
    )
    maximum_length: Annotated[float, Field(gt=1, le=1e6)] = Field(
        default=1.6, description="lmax, relative to the optimal length"
    )
    maximum_velocity: Positive = Field(default=1.5, description="vmax, optimal lengths per second")
    passive_peak: Positive = Field(default=1.3, description="fpmax, relative to the peak force")
    lengthening_peak: Positive = Field(default=1.2, description="fvmax, relative to the peak force")
    activation_dynamics: bool = Field(
        default=False, description="true: MuJoCo's first-order 10/40 ms lag; false: activation acts at once"
    )

    @field_validator("peak_force_N")
    @classmethod
    def _given(cls, value: Any) -> Any:
        return _not_empty(value, "muscles")

    def peak_forces(self, n_segments: int) -> list[float]:
        """Returns the peak force of every segment's muscles, N."""
        return _one_a_segment(self.peak_force_N, n_segments)


class ServoRings(RingCables):
    """Servos, each of which winds a cable that lies round a ring (or half of it) and can only pull.

    Activation commands the cable's slack length, from the longest at 0 to the shortest at 1, and the servo winds or
    pays out towards it at no more than its speed limit. The cable's tension is ``stiffness (length - slack length) +
    damping rate``, kept between 0 and the force limit; at the limit the servo stalls, and winds on only as its ring
    gives way.
    """

    kind: Literal["servo"] = "servo"
    length_range_m: Range | tuple[Range, ...] = Field(
        default=(0.62, 0.96),
        description="shortest and longest cable of a whole ring (half-rings have half of it each), one pair for all or "
        "one pair a segment",
    )
    force_limit_N: Positive | tuple[Positive, ...] = Field(
        default=13.0, description="tension at which a servo stalls, one number for all or one a segment"
    )
    speed_limit_m_per_s: Positive = Field(default=0.064, description="fastest winding and paying out")
    stiffness_N_per_m: Positive = Field(default=1000.0, description="tension of a cable per length that it lacks")
    damping_Ns_per_m: NonNegative = Field(default=10.0, description="tension of a taut cable per rate of its length")

    @field_validator("force_limit_N")
    @classmethod
    def _given(cls, value: Any) -> Any:
        return _not_empty(value, "servos")

    def force_limits(self, n_segments: int) -> list[float]:
        """Returns the force limit of every segment's servos, N."""
        return _one_a_segment(self.force_limit_N, n_segments)


RingsSection = Annotated[Annotated[Rings, Tag("muscle")] | Annotated[ServoRings, Tag("servo")], kind_or("muscle")]


class Rods(Section):
    """The fast formulation: elastic rods, which share one vertex at each crossing unless pins are separate."""

    kind: Literal["rods"] = "rods"
    edge_time_constant_s: Positive = Field(default=0.001, description="time constant of the inextensible edges")
    solver_iterations: Annotated[int, Field(ge=10, le=100_000)] = Field(
        default=100, description="Newton iterations at most"
    )
    solver_tolerance: NonNegative = Field(default=1e-6, description="Newton tolerance")
    friction_impedance_ratio: Positive = Field(
        default=100.0, description="MuJoCo's impratio; 1 lets light vertices creep on the floor"
    )
    lateral_damping_Nms_per_rad: NonNegative = Field(
        default=0.0,
        description="viscous resistance to bending across the plane of a strand's own curvature, for which the "
        "engine's curved rods have none",
    )
    pins: Literal["shared", "separate"] = Field(
        default="shared",
        description="both strands of a crossing share its vertex, or a pin mass is tied to a vertex of each",
    )
    pin_stiffness_N_per_m: Positive = Field(
        default=22.0, description="of the tie between a separate pin and each of its strands"
    )
    pin_damping_Ns_per_m: Positive = Field(default=0.88, description="of the same tie")
    pin_inertance_kg: Positive = Field(
        default=0.0094, description="of the same tie: its force per relative acceleration, numerical"
    )


class Chain(Section):
    """The paper's formulation: rigid capsules on damped elastic joints, with a point mass at every pin."""

    kind: Literal["chain"] = "chain"
    joint: Literal["ball", "hinges"] = Field(
        default="ball",
        description="one isotropic ball joint, or three hinges with torsion apart from bending",
    )
    armature_kg_m2: NonNegative = Field(default=0.01, description="numerical inertia of the joints")
    pin_time_constant_s: Positive = Field(default=0.02, description="solref time constant of the pin constraints")
    pin_impedance: Impedance = Field(
        default=(0.9, 0.95, 0.001), description="solimp (d0, dwidth, width) of the pin constraints"
    )
    pins: Literal["separate", "direct"] = Field(
        default="separate", description="strands tied to a pin mass each, or straight to one another"
    )
    integrator: Literal["RK4", "Euler"] = Field(default="RK4", description="time integration")
    solver_iterations: Annotated[int, Field(ge=10, le=100_000)] = Field(
        default=500, description="PGS iterations at most"
    )
    solver_tolerance: NonNegative = Field(default=1e-8, description="PGS tolerance")


Formulation = Annotated[Annotated[Rods, Tag("rods")] | Annotated[Chain, Tag("chain")], kind_or("rods")]


class WormBody(BodyKind):
    """The 3D worm."""

    needs_arena: ClassVar[bool] = True
    has_skin: ClassVar[bool] = True
    kind: Literal["worm"] = "worm"
    heading_deg: Annotated[float, Field(ge=-360, le=360)] = Field(
        default=0.0,
        description="where the worm leads at the start, about its front end: 0 is towards -x, positive to its left "
        "(90: towards -y)",
    )
    mesh: Mesh = Mesh()
    strands: Strands = Strands()
    pins: Pins = Pins()
    joints: Joints | None = None
    springs: Springs = Springs()
    rings: RingsSection = Rings()
    formulation: Formulation = Rods()

    def build(self, config: RunConfig) -> Plant:
        """Builds the worm's plant in the engine, as `BodyKind.build`."""
        from annelid.simulation.worm import WormPlant

        return WormPlant(config)

    @property
    def has_halves(self) -> bool:
        """Whether its rings are halved."""
        return self.rings.layout == "halves"

    @property
    def n_segments(self) -> int:
        """Number of actuated segments."""
        return self.mesh.n_segments

    @property
    def muscles(self) -> Rings:
        """The ring muscles.

        Raises:
            ConfigError: The rings have servos.
        """
        if isinstance(self.rings, ServoRings):
            raise ConfigError("body.rings.kind = 'servo' has no muscles; this needs body.rings.kind = 'muscle'")
        return self.rings

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        mesh = self.mesh
        planes = mesh.planes_between_rings * (mesh.n_segments - 1) + 2 * mesh.free_planes_at_ends
        at_ends = 2 * (mesh.elements_per_end or mesh.elements_per_side)
        elements = mesh.n_helices * (mesh.elements_per_side * planes + at_ends)
        # Measured on one core: the factorisation of rods fills with the number of helices.
        chain = isinstance(self.formulation, Chain)
        time_s = 2e-6 * elements**2 if chain else 1e-8 * elements**2 * mesh.n_helices
        memory_GB = 5e-5 * elements if chain else 2e-6 * elements * mesh.n_helices
        if time_s > LONGEST_BUILD_S:
            raise ValueError(
                f"body.mesh.n_segments = {mesh.n_segments}, body.mesh.n_helices = {mesh.n_helices} and "
                f"body.mesh.elements_per_side = {mesh.elements_per_side} make {elements:,} elements, which take about "
                f"{time_s:,.0f} s and {memory_GB:,.1f} GB to build; at most {LONGEST_BUILD_S:g} s are allowed: lower "
                "one of them"
            )
        return self

    @model_validator(mode="after")
    def _damped_by_one_law(self) -> Self:
        lateral = self.formulation.lateral_damping_Nms_per_rad if isinstance(self.formulation, Rods) else 0.0
        if lateral > 0 and self.strands.material_damping_s is not None:
            raise ValueError(
                f"body.formulation.lateral_damping_Nms_per_rad = {lateral:g} must be 0 where body.strands gives the "
                "damping of the material, which acts in every direction"
            )
        if lateral > 0 and self.heading_deg:
            raise ValueError(
                f"body.heading_deg = {self.heading_deg:g}: must be 0 with body.formulation.lateral_damping_Nms_per_rad "
                f"= {lateral:g}, whose dampers are fixed in the world; give body.strands.damping_time_s instead"
            )
        return self

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        if self.strands.radius_m >= self.mesh.radius_m:
            raise ValueError(
                f"body.strands.radius_m = {self.strands.radius_m:g} must be less than "
                f"body.mesh.radius_m = {self.mesh.radius_m:g}"
            )
        if self.rings.layout == "halves" and self.mesh.n_helices % 4:
            raise ValueError(
                f"body.rings.layout = 'halves' needs body.mesh.n_helices to be a multiple of 4, "
                f"not {self.mesh.n_helices}: equal halves need an even number of crossings round a ring"
            )
        n = len(self.rings.length_ranges(self.mesh.n_segments))
        if n != self.mesh.n_segments:
            raise ValueError(
                f"body.rings.length_range_m gives {n} ranges for {self.mesh.n_segments} segments: "
                "give one pair for each, or one for all, for example body.rings.length_range_m=[0.566,1.067]"
            )
        if isinstance(self.rings, ServoRings):
            field, n = "force_limit_N", len(self.rings.force_limits(self.mesh.n_segments))
        else:
            field, n = "peak_force_N", len(self.rings.peak_forces(self.mesh.n_segments))
        if n != self.mesh.n_segments:
            raise ValueError(
                f"body.rings.{field} gives {n} values for {self.mesh.n_segments} segments: "
                f"give one for each, or one for all, for example body.rings.{field}=13"
            )
        return self

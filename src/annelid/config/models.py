"""The sections of a configuration: frozen models with the unit in every field's name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, field_validator, model_validator

Positive = Annotated[float, Field(gt=0, le=1e15)]
NonNegative = Annotated[float, Field(ge=0, le=1e15)]
Timestep = Annotated[float, Field(ge=1e-6, le=1.0)]
Impedance = tuple[Annotated[float, Field(gt=0, lt=1)], Annotated[float, Field(gt=0, lt=1)], Positive]
MOST_SAMPLES = 10_000_000
Range = tuple[Positive, Positive]


def _is_multiple(large: float, small: float) -> bool:
    ratio = large / small
    return round(ratio) >= 1 and abs(ratio - round(ratio)) < 1e-6 * ratio


class Section(BaseModel):
    """Base of every section: immutable, and no field but the declared ones."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Mesh(Section):
    """Geometry of the helical mesh (lengths in m)."""

    n_segments: Annotated[int, Field(ge=3, le=200)] = Field(default=3, description="actuated segments")
    n_helices: Annotated[int, Field(ge=6, le=96)] = Field(
        default=12, description="strands, half of each handedness; even"
    )
    radius_m: Positive = Field(default=0.16, description="radius of the tube at rest")
    angular_rate_rad_per_m: Positive = Field(
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
    rear_overhang_m: Positive | None = Field(
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

    radius_m: Positive = Field(default=0.002, description="radius of the solid round cross-section")
    young_modulus_Pa: Positive = Field(default=0.3e9, description="resists bending")
    shear_modulus_Pa: Positive = Field(default=0.2e9, description="resists twisting")
    linear_density_kg_per_m: Positive = Field(default=0.01291, description="mass per length of strand")
    joint_damping_Nms_per_rad: NonNegative = Field(
        default=0.12, description="viscous resistance to bending between two elements"
    )


class Pins(Section):
    """The pins that join two strands at a crossing."""

    mass_kg: Positive = Field(default=0.00052, description="mass of one pin")
    radius_m: Positive = Field(default=0.005, description="radius of the drawn sphere")


class Springs(Section):
    """Axial springs between crossings two planes apart at the same angle."""

    stiffness_N_per_m: NonNegative = Field(default=19.9, description="spring rate")
    rest_length_m: Positive | None = Field(default=None, description="default: two plane spacings, unstretched at rest")
    tension_only: bool = Field(default=False, description="true: slack below rest length; false: pushes as well")


class Rings(Section):
    """Ring muscles: MuJoCo's force-length-velocity muscle on a closed ring (or two half-rings).

    The muscle's optimal length is ``(length_range[1] - length_range[0]) / (1.05 - 0.75)``: MuJoCo scales the
    given range to 0.75-1.05 of it. The force is ``peak_force_N * (activation * FL * FV + FP)``.
    """

    layout: Literal["whole", "halves"] = Field(
        default="whole",
        description="one muscle round the body, or a left (-y: segment 1 leads towards -x) and a right one",
    )
    peak_force_N: Positive = Field(default=117.57, description="isometric force at the optimal length, F0")
    length_range_m: Range | tuple[Range, ...] = Field(
        default=(0.566, 1.067),
        description="operating range of a whole ring, one pair for all or one pair a segment",
    )
    minimum_length: Positive = Field(default=0.58, description="lmin, relative to the optimal length")
    maximum_length: Positive = Field(default=1.6, description="lmax, relative to the optimal length")
    maximum_velocity: Positive = Field(default=1.5, description="vmax, optimal lengths per second")
    passive_peak: NonNegative = Field(default=1.3, description="fpmax, relative to the peak force")
    lengthening_peak: Positive = Field(default=1.2, description="fvmax, relative to the peak force")
    activation_dynamics: bool = Field(
        default=False, description="true: MuJoCo's first-order 10/40 ms lag; false: activation acts at once"
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


def _kind_or(default: str) -> Discriminator:
    """Tells a union's member by its ``kind``, or takes the default kind where none is given."""

    def kind_of(value: Any) -> Any:
        return value.get("kind", default) if isinstance(value, Mapping) else getattr(value, "kind", default)

    return Discriminator(kind_of)


Formulation = Annotated[Annotated[Rods, Tag("rods")] | Annotated[Chain, Tag("chain")], _kind_or("rods")]


class WormBody(Section):
    """The 3D worm."""

    kind: Literal["worm"] = "worm"
    mesh: Mesh = Mesh()
    strands: Strands = Strands()
    pins: Pins = Pins()
    springs: Springs = Springs()
    rings: Rings = Rings()
    formulation: Formulation = Rods()

    @property
    def n_segments(self) -> int:
        """Number of actuated segments."""
        return self.mesh.n_segments

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
        return self


class PlanarWorm(Section):
    """What every planar worm has: its segments are rhombi in a row."""

    n_segments: Annotated[int, Field(ge=3, le=200)] = Field(default=3, description="actuated segments")


class PlanarBody(PlanarWorm):
    """The kinematic planar worm of Riddle 2022: rhombi with rigid sides and speed-limited actuators."""

    kind: Literal["riddle2022"] = "riddle2022"
    side_m: Positive = Field(default=0.073, description="side of a rhombus")
    height_min_m: Positive = Field(default=0.065, description="height when contracted")
    height_max_m: Positive = Field(default=0.11, description="height when relaxed")
    gain: Positive = Field(
        default=1.3, description="proportional gain k of the actuator; 1.3, 1.9, 3.6 for 300, 200, 100 ms"
    )

    @model_validator(mode="after")
    def _heights_fit_the_rhombus(self) -> Self:
        if not self.height_min_m < self.height_max_m < 2 * self.side_m:
            raise ValueError("heights must satisfy height_min_m < height_max_m < 2 side_m")
        return self


class DynamicPlanarWorm(PlanarWorm):
    """What the planar worms with masses and forces share; no paper in hand states these constants.

    They are those of a light robot of the size of Riddle 2022's: sides and heights are that worm's, spring and muscle
    balance near its contracted height, the damper gives its time constant of about 0.1 s.
    """

    side_m: Positive = Field(default=0.073, description="side of a rhombus")
    height_relaxed_m: Positive = Field(default=0.11, description="height at which the return spring is slack")
    height_shortest_m: Positive = Field(default=0.055, description="height at which a muscle's force has fallen to 0")
    joint_mass_kg: Positive = Field(default=0.05, description="mass of a joint on the axis")
    vertex_mass_kg: Positive = Field(default=0.05, description="mass of an upper or a lower vertex")
    spring_stiffness_N_per_m: Positive = Field(default=200.0, description="return spring along a segment")
    muscle_force_N: NonNegative = Field(default=19.0, description="of a fully active muscle at the relaxed height")
    height_damping_Ns_per_m: NonNegative = Field(
        default=35.0, description="viscous resistance to a change of a segment's height"
    )

    @model_validator(mode="after")
    def _heights_fit_the_rhombus(self) -> Self:
        if not self.height_shortest_m < self.height_relaxed_m < 2 * self.side_m:
            raise ValueError(
                f"body.height_shortest_m = {self.height_shortest_m:g} and body.height_relaxed_m = "
                f"{self.height_relaxed_m:g} must satisfy height_shortest_m < height_relaxed_m < 2 side_m = "
                f"{2 * self.side_m:g}"
            )
        return self


class Daltorio2013Body(DynamicPlanarWorm):
    """The planar worm of Daltorio 2013: rigid-sided rhombi, torsional springs between them, and the walls of a pipe."""

    kind: Literal["daltorio2013"] = "daltorio2013"
    torsion_stiffness_Nm_per_rad: NonNegative = Field(
        default=0.2, description="torsional springs between neighbouring segments"
    )
    torsion_damping_Nms_per_rad: NonNegative = Field(default=0.0, description="viscous resistance beside them")
    pipe_diameter_m: Positive = Field(default=0.1, description="distance of the walls from one another")
    wall_stiffness_N_per_m: Positive = Field(default=2000.0, description="force per indentation at one vertex")
    wall_friction: NonNegative = Field(default=0.5, description="coefficient of Coulomb friction with the walls")

    @model_validator(mode="after")
    def _the_worm_can_leave_the_wall(self) -> Self:
        if self.pipe_diameter_m <= self.height_shortest_m:
            raise ValueError(
                f"body.pipe_diameter_m = {self.pipe_diameter_m:g} must be greater than body.height_shortest_m = "
                f"{self.height_shortest_m:g}"
            )
        return self


class Boxerbaum2012Body(DynamicPlanarWorm):
    """The planar worm of Boxerbaum 2012: rhombi whose sides bend in their middle, without ground."""

    kind: Literal["boxerbaum2012"] = "boxerbaum2012"
    middle_mass_kg: Positive = Field(default=0.02, description="mass of the middle of a side")
    torsion_stiffness_Nm_per_rad: Positive = Field(default=0.2, description="torsional spring in the middle of a side")
    torsion_damping_Nms_per_rad: NonNegative = Field(default=0.01, description="viscous resistance beside it")


Body = Annotated[
    Annotated[WormBody, Tag("worm")]
    | Annotated[PlanarBody, Tag("riddle2022")]
    | Annotated[Daltorio2013Body, Tag("daltorio2013")]
    | Annotated[Boxerbaum2012Body, Tag("boxerbaum2012")],
    _kind_or("worm"),
]


class Arena(Section):
    """Where the worm crawls: flat ground under gravity."""

    friction: Annotated[float, Field(ge=0.01, le=100)] = Field(
        default=1.0, description="coefficient of sliding friction"
    )
    floor_gap_m: NonNegative = Field(default=0.009, description="distance of the floor below the mesh's lowest line")
    gravity_m_per_s2: NonNegative = Field(default=9.81, description="0 for a weightless worm")
    contact_time_constant_s: Positive = Field(default=0.02, description="solref time constant of the contacts")
    contact_impedance: Impedance = Field(
        default=(0.9, 0.95, 0.001), description="solimp (d0, dwidth, width) of the contacts"
    )


class StretchSensor(Section):
    """How the nervous system reads its segments' lengths."""

    tolerance_m: NonNegative = Field(default=0.010, description="on while a segment is within this of its rest length")
    hysteresis_m: NonNegative = Field(default=0.0, description="once on, stays on until this much beyond the tolerance")
    startup_hold_s: NonNegative = Field(
        default=0.2, description="sensor of segment 1 held off for this long at the start"
    )
    noise_m: NonNegative = Field(default=0.0, description="standard deviation of the noise on every reading")


class SnsController(Section):
    """The paper's synthetic nervous system: one half-centre a segment, gated by its neighbour's stretch."""

    kind: Literal["sns"] = "sns"
    capacitance_nF: Positive = Field(default=5.0, description="membrane capacitance C")
    leak_conductance_uS: Positive = Field(default=1.0, description="leak conductance Gm")
    range_mV: Positive = Field(default=20.0, description="operating range R")
    bifurcation_mV: Positive = Field(
        default=0.01, description="delta: how far past the bifurcation the half-centre sits"
    )
    offset_mV: Positive = Field(default=0.1, description="how far below rest an inhibited neuron is held")
    inhibitory_reversal_mV: Annotated[float, Field(lt=0)] = Field(default=-40.0, description="relative to rest")
    excitatory_reversal_mV: Positive = Field(default=194.0, description="relative to rest")
    sodium_reversal_mV: Positive = Field(default=110.0, description="relative to rest")
    gate_slope_per_mV: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.05, description="slope S of the sodium gates"
    )
    gate_time_constant_ms: Positive = Field(default=300.0, description="tau_h,max; sets the period: 300, 200 or 100")
    sensor_current_nA: NonNegative = Field(default=20.0, description="current of a stretch sensor that is on")
    kick_nA: NonNegative = Field(default=1.0, description="current into the first contraction neuron at the first step")
    activation: Literal["sigmoid", "linear"] = Field(
        default="sigmoid", description="Eq. 2, or the planar worm's clipped difference of the half-centre"
    )
    activation_slope_per_mV: Positive = Field(default=0.35, description="slope of the sigmoid")
    scheme: Literal["euler", "toolbox", "heun"] = Field(
        default="euler",
        description="forward Euler, SNS-Toolbox's order (gates before potentials), or second order",
    )
    gate_start: Literal["steady", "toolbox"] = Field(
        default="steady", description="gates start at h_inf(U), or as SNS-Toolbox starts them"
    )


class Contraction(Section):
    """One contraction of one segment's ring."""

    segment: Annotated[int, Field(ge=1, le=200)] = Field(description="counted from 1 at the front")
    start_s: NonNegative = Field(description="when the activation begins to rise")
    stop_s: Positive = Field(description="when it begins to fall")
    activation: Annotated[float, Field(gt=0, le=1)] = Field(default=1.0, description="level that it rises to")

    @model_validator(mode="after")
    def _starts_before_it_stops(self) -> Self:
        if self.start_s >= self.stop_s:
            raise ValueError(
                f"controller.contractions: stop_s = {self.stop_s:g} of a contraction of segment {self.segment} must be "
                f"greater than its start_s = {self.start_s:g}"
            )
        return self


class Program(Section):
    """Open loop: contractions at times laid down beforehand, whatever the sensors read.

    Where contractions of one segment overlap, the larger activation wins.
    """

    kind: Literal["program"] = "program"
    contractions: tuple[Contraction, ...] = Field(description="segment, start_s, stop_s and activation of each")
    ramp_s: NonNegative = Field(default=0.0, description="time that a rise or fall between 0 and the full level takes")


class SineWave(Section):
    """Open loop: a sinusoidal wave from front to rear, segment 1 contracted at the start."""

    kind: Literal["sine"] = "sine"
    period_s: Positive = Field(default=2.625, description="time of one cycle; the paper's three segments take 2.625")
    waves: Annotated[float, Field(ge=-100, le=100)] = Field(
        default=1.0, description="waves on the body at once; negative ones run forwards, 0 is no wave"
    )
    level: Annotated[float, Field(gt=0, le=1)] = Field(default=1.0, description="largest activation")


class TimedWave(Section):
    """Open loop: each segment contracts by a ramp, holds, and lets go by a ramp, one after another.

    The authors' patterns: "3x1" is 1 s up, 1 s hold, 1 s down, the next segment 1 s later (the defaults); "2x2" is the
    same with the next segment 2 s later and two waves at once (``interval_s = 2``, ``waves = 2``). Six segments repeat
    either every 6 s.
    """

    kind: Literal["timed"] = "timed"
    rise_s: NonNegative = Field(default=1.0, description="time to contract; 0 for a step")
    hold_s: NonNegative = Field(default=1.0, description="time contracted")
    fall_s: NonNegative = Field(default=1.0, description="time to let go; 0 for a step")
    interval_s: Positive = Field(default=1.0, description="the next segment begins this much later")
    waves: Annotated[int, Field(ge=1, le=100)] = Field(
        default=1, description="waves on the body at once: the cycle is n_segments times interval_s over this"
    )
    level: Annotated[float, Field(gt=0, le=1)] = Field(default=1.0, description="activation while contracted")

    @model_validator(mode="after")
    def _it_contracts(self) -> Self:
        if self.rise_s + self.hold_s + self.fall_s == 0:
            raise ValueError("controller.rise_s, hold_s and fall_s are all 0: the segments would never contract")
        return self


class HeteroclinicChannel(Section):
    """A stable heteroclinic channel (Horchler 2015, Daltorio 2013): one saddle a segment, visited in order.

    A segment's activation is its node's activity. Alone it dwells at a node for about ``ln(1 / noise)`` or
    ``ln(1 / bias)`` over the leaving rate ``growth_rate_per_s / saddle_value``; feedback from the body ends the dwell.
    The literature gives no constants for this worm: with ours the bias alone makes a dwell of 0.88 s, the paper's
    interval from segment to segment.
    """

    kind: Literal["shc"] = "shc"
    growth_rate_per_s: Annotated[float, Field(gt=0, le=500)] = Field(
        default=20.0, description="rate at which activities settle and decay; at most 0.5 over the control timestep"
    )
    saddle_value: Annotated[float, Field(gt=1, le=100)] = Field(
        default=2.0, description="that rate over the rate at which a node is left"
    )
    noise: Annotated[float, Field(ge=0, le=1)] = Field(
        default=1e-6, description="standard deviation of the noise, per square root of a second"
    )
    bias_per_s: Annotated[float, Field(ge=0, le=100)] = Field(
        default=5e-4, description="constant input to every node; a larger one shortens the dwell"
    )
    feedback: Literal["none", "stretch", "contact"] = Field(
        default="stretch",
        description="what excites a node's successor: nothing, the present segment having lengthened by "
        "stretch_cue_m, or the segment before it bearing contact_cue_N",
    )
    feedback_gain_per_s: Annotated[float, Field(ge=0, le=100)] = Field(
        default=0.1, description="input to the successor of an active node whose cue is on"
    )
    stretch_cue_m: NonNegative = Field(default=0.02, description="lengthening at which a segment has its shape")
    contact_cue_N: NonNegative = Field(
        default=0.2, description="size of the force of the ground with which a segment holds fast"
    )

    @model_validator(mode="after")
    def _it_leaves_its_first_node(self) -> Self:
        if self.noise == 0 and self.bias_per_s == 0 and (self.feedback == "none" or self.feedback_gain_per_s == 0):
            raise ValueError(
                "controller.noise, controller.bias_per_s and the feedback are all 0: the ring would rest at its first "
                "node for ever"
            )
        return self


class PhaseChain(Section):
    """Phase oscillators under a descending drive (Ijspeert 2007): the salamander's constants, one segment each.

    Activation is an oscillator's output over its largest, ``r (1 + cos theta) / (2 R(5))``.
    """

    kind: Literal["phase-chain"] = "phase-chain"
    drive: Annotated[float, Field(ge=0, le=10)] = Field(
        default=4.0, description="descending drive at the start: the body swims in 3 .. 5, is silent outside 1 .. 5"
    )
    drive_slope_per_s: Annotated[float, Field(ge=-100, le=100)] = Field(
        default=0.0, description="change of the drive, which stays in 0 .. 10"
    )
    limbs: bool = Field(
        default=False, description="true: limb oscillators force a standing wave below drive 3 (walking)"
    )
    waves: Annotated[float, Field(ge=-100, le=100)] = Field(
        default=1.0, description="waves on the body at once, by the phase bias; the salamander's swimming has 1"
    )
    coupling_per_s: Positive = Field(default=10.0, description="coupling of neighbours")
    slowing: Positive = Field(default=1.0, description="times slower than the salamander, in all of its rates")


class AdaptiveSns(Section):
    """The synthetic nervous system with a descending neuron, whose activity sets the rate of all half-centres.

    The activity that is asked for is ``drive + drive_slope_per_s time + stretch_gain_per_m stretch``, kept in 0 .. 1,
    with the mean lengthening of all segments as stretch: a manual, a timed and a sensory drive. The descending neuron
    follows it with its time constant.
    """

    kind: Literal["adaptive"] = "adaptive"
    network: SnsController = SnsController()
    drive: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="0: the slow rhythm of the half-centres alone; 1: about three times as fast"
    )
    drive_slope_per_s: Annotated[float, Field(ge=-100, le=100)] = Field(
        default=0.0, description="change of the manual drive"
    )
    stretch_gain_per_m: Annotated[float, Field(ge=-1000, le=1000)] = Field(
        default=0.0, description="drive per mean lengthening of the segments"
    )
    drive_time_constant_s: Annotated[float, Field(ge=1e-3, le=1e4)] = Field(
        default=0.05, description="time constant of the descending neuron"
    )


ControllerSection = Annotated[
    Annotated[SnsController, Tag("sns")]
    | Annotated[Program, Tag("program")]
    | Annotated[SineWave, Tag("sine")]
    | Annotated[TimedWave, Tag("timed")]
    | Annotated[HeteroclinicChannel, Tag("shc")]
    | Annotated[PhaseChain, Tag("phase-chain")]
    | Annotated[AdaptiveSns, Tag("adaptive")],
    _kind_or("sns"),
]


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
    height_m: Positive = Field(default=1.0, description="of any crossing above the floor")
    edge_strain: Positive = Field(default=0.05, description="of any edge of a rod")
    pin_gap_m: Positive = Field(default=0.15, description="between the two strands of a pinned crossing")


class RunConfig(Section):
    """Everything that defines a run; the run file carries it whole."""

    name: str = Field(default="custom", description="name of the preset or of the user's own configuration")
    summary: str = Field(default="", description="one line for the list of presets")
    duration_s: Positive = Field(default=5.0, description="simulated time")
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="seed of every random draw")
    body: Body = WormBody()
    arena: Arena | None = Field(default=None, description="the 3D worm's ground; planar worms have none")
    controller: ControllerSection = SnsController()
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
    def _contact_needs_ground(self) -> Self:
        contact = isinstance(self.controller, HeteroclinicChannel) and self.controller.feedback == "contact"
        if contact and isinstance(self.body, PlanarBody | Boxerbaum2012Body):
            raise ValueError(
                f"controller.feedback = 'contact' has no effect on body.kind = {self.body.kind!r}, which touches no "
                "ground: choose 'none' or 'stretch'"
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

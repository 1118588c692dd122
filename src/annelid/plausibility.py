"""What is wrong with a 3D worm before it runs: lengths, forces, steps and tolerances held against one another.

Everything here follows from the configuration alone, in closed form, in under a millisecond and without the engine.

How much the mesh resists: where a ring of the length L = m c is drawn in (m crossings, c apart), the rhombi round it
close. With h, the hypotenuse of a rhombus' two diagonals at rest, they keep ``c = h sin(a)`` and springs of the length
``x = h cos(a)``, a being half the angle at which strands meet. Each strand of bending stiffness EI is bent by the
change of a over about one side s of the rhombus, and the springs of rate k and rest length x0 are drawn out. With the
virtual work of the ring's tension T, ``T dL = d(energy)``, this is

    T(a) = 1.3 EI (a0 - a) / (s^2 cos(a)) + k (x - x0) tan(a)

The number of strands drops out. The factor 1.3 is fitted to the one ring that the authors simulated in a load frame
(E 2 GPa, radius 2.99 mm), whose curve the estimate then follows within 15 % from 10 to 100 mm of its diameter. The end
rings bear about a fifth less, and with the paper's soft strands the estimate is low by up to a half. So it is good to a
factor of two, and nothing is refused on its account unless it is exceeded by more. Measured, rings of that mesh
collapse at 14 to 16 N; the estimate at a third of a0 is 16.8 N.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, degrees, hypot, log, pi, radians, sqrt, tan
from typing import TYPE_CHECKING, Literal

from annelid.body.worm import WormBody
from annelid.errors import ConfigError
from annelid.morphology import Rhombus, rhombus

if TYPE_CHECKING:
    from annelid.body.actuators import ActuatorKind
    from annelid.config.run import RunConfig

HARDLY = 0.02
"""Share of its length at rest below which a ring has hardly been shortened."""
COLLAPSED = 0.2
"""Ring length over that at rest below which a ring counts as collapsed; in all presets it stays above 0.3."""
NUMERICAL_SHARE = 1 / 3
"""Share of the muscles' work lost to the integrator above which a run is doubtful."""
IDLE_SHARE = 1e-3
"""Share of its greatest force that an actuator must reach in a contraction."""

_BENDING = 1.3
UNSURE = 2.0
SHRUNK = 2 / 3
"""Length over that at rest to which actuators may draw a ring before anything is activated."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong with a configuration.

    Attributes:
        field: Dotted path of the field to change.
        value: Its value.
        problem: What is wrong, in a sentence without a full stop.
        instead: What to set instead, with a number.
        severity: "error" where the run can mean nothing and is refused, "warning" where it is doubtful.
    """

    field: str
    value: object
    problem: str
    instead: str
    severity: Literal["error", "warning"]

    def __str__(self) -> str:
        """Returns one sentence."""
        return f"{self.field} = {_text(self.value)}: {self.problem}; {self.instead}"


def check(config: RunConfig) -> list[Finding]:
    """Holds the numbers of a configuration against one another, before anything is computed.

    Args:
        config: Any configuration; of a planar worm there is nothing to check.

    Returns:
        What is wrong, errors first; empty where nothing is.
    """
    if not isinstance(config.body, WormBody):
        return []
    body = config.body
    found = [*_mesh(body), *body.rings.findings(body), *_materials(body), *_steps(config), *_senses(config)]
    first: dict[tuple[str, str], Finding] = {}
    for finding in found:
        # Rings with ranges of their own may share a fault.
        first.setdefault((finding.field, finding.severity), finding)
    return sorted(first.values(), key=lambda finding: finding.severity)


def refuse_nonsense(config: RunConfig) -> tuple[str, ...]:
    """Refuses what can mean nothing.

    Returns:
        The warnings, a sentence each.

    Raises:
        ConfigError: `check` finds an error.
    """
    found = check(config)
    errors = [str(finding) for finding in found if finding.severity == "error"]
    if errors:
        raise ConfigError(". ".join(errors))
    return tuple(str(finding) for finding in found)


def rhombus_of(body: WormBody) -> Rhombus:
    """Returns the rhombus of a body at rest."""
    mesh = body.mesh
    return rhombus(mesh.n_helices, mesh.radius_m, mesh.angular_rate_rad_per_m, mesh.elements_per_side)


def touching_ring_m(body: WormBody) -> float:
    """Returns the length of a ring at which the strands of neighbouring crossings touch, m."""
    return body.mesh.n_helices // 2 * 2.0 * body.strands.radius_m


def bearable_force_N(body: WormBody, share: float = 1 / 3) -> float:
    """Estimates the tension under which a ring closes, N: see the page's head.

    Args:
        body: The worm's body.
        share: Opening of the rhombi up to which it is drawn in, over that at rest.
    """
    shape, strands, springs = rhombus_of(body), body.strands, body.springs
    stiffness = strands.bending_rigidity_Nm2
    rest, opening = shape.opening_rad, share * shape.opening_rad
    bending = _BENDING * stiffness * (rest - opening) / (shape.side_m**2 * cos(opening))
    length = hypot(shape.across_m, shape.along_m) * cos(opening)
    stretch = length - (springs.rest_length_m or shape.along_m)
    if springs.tension_only:
        stretch = max(0.0, stretch)
    return bending + springs.stiffness_N_per_m * stretch * tan(opening)


def _mesh(body: WormBody) -> Iterator[Finding]:
    shape, mesh, strands = rhombus_of(body), body.mesh, body.strands
    thickness = 2.0 * strands.radius_m
    # Parallel strands are as far apart as the height of the rhombus.
    room = min(shape.across_m, shape.across_m * shape.along_m / hypot(shape.across_m, shape.along_m))
    if room <= thickness:
        yield Finding(
            "body.mesh.n_helices",
            mesh.n_helices,
            f"neighbouring strands are {room:.3g} m apart at rest and {thickness:.3g} m thick, so that they overlap",
            f"set body.strands.radius_m below {room / 4:.2g}, or fewer helices",
            "error",
        )
    most = shape.longest_m / shape.along_m
    if most > 4.0:
        yield Finding(
            "body.mesh.angular_rate_rad_per_m",
            mesh.angular_rate_rad_per_m,
            f"the strands lie almost along the rings, so that a segment can stretch to {most:.1f} times its length",
            f"set at most {2.0 / mesh.radius_m:.3g} with this radius (twice the length is usual)",
            "warning",
        )
    elif most < 1.1:
        yield Finding(
            "body.mesh.angular_rate_rad_per_m",
            mesh.angular_rate_rad_per_m,
            f"the strands lie almost along the body, so that a segment can stretch to {most:.2f} times its length only",
            f"set about {2.0 / mesh.radius_m:.3g} with this radius",
            "warning",
        )
    if shape.bend_rad > radians(45.0):
        elements = round(shape.bend_rad * mesh.elements_per_side / radians(30.0) + 0.5)
        yield Finding(
            "body.mesh.elements_per_side",
            mesh.elements_per_side,
            f"a strand turns by {shape.bend_rad * 180 / pi:.0f} degrees about the body in one straight element",
            f"set at least {elements}",
            "warning",
        )
    rest = body.springs.rest_length_m
    if rest is not None and not 0.5 <= rest / shape.along_m <= 1.5:
        yield Finding(
            "body.springs.rest_length_m",
            rest,
            f"the mesh holds these springs at {shape.along_m:.3g} m, {shape.along_m / rest:.2g} times that",
            f"set between {0.5 * shape.along_m:.2g} and {1.5 * shape.along_m:.2g}, or leave it out",
            "warning",
        )


def strongest(rings: ActuatorKind, n_segments: int) -> Iterator[tuple[float, float, float]]:
    """Returns every operating range of the rings, m, with the greatest force of an actuator that has it, N."""
    spans, forces = rings.length_ranges(n_segments), rings.forces(n_segments)
    for low, high in dict.fromkeys(spans):
        yield low, high, max(force for own, force in zip(spans, forces, strict=True) if own == (low, high))


def weak(body: WormBody, field: str, value: float, force_N: float) -> Iterator[Finding]:
    """Holds the greatest force of an actuator against what hardly closes a ring."""
    needed = bearable_force_N(body, 1.0 - HARDLY)
    if force_N < needed / UNSURE:
        yield Finding(
            f"body.rings.{field}",
            value,
            f"a ring is pulled with {force_N:.2g} N at most, where {needed:.2g} N shorten it by {100 * HARDLY:g} %",
            f"set at least {UNSURE * value * needed / force_N:.2g}" if force_N else "set more",
            "warning",
        )


def crushes(field: str, force_N: float, bearable_N: float, share: float) -> Finding:
    """Tells of an actuator that closes its ring to a share of its length at rest."""
    return Finding(
        field,
        force_N,
        f"rings close under about {bearable_N:.2g} N, and nothing stops them above {100 * max(0.0, share):.0f} % of "
        "their length at rest",
        f"set at most {bearable_N:.2g}, or limit the length with body.rings.length_range_m",
        "warning",
    )


def _materials(body: WormBody) -> Iterator[Finding]:
    strands = body.strands
    density = strands.linear_density_kg_per_m / (pi * strands.radius_m**2)
    ratio = strands.shear_modulus_Pa / strands.young_modulus_Pa
    area = pi * strands.radius_m**2
    for field, value, problem, low, high, least, most in (
        ("young_modulus_Pa", strands.young_modulus_Pa, "no strand is made of this", 1e6, 4e11, 1e6, 4e11),
        (
            "shear_modulus_Pa",
            strands.shear_modulus_Pa,
            f"that is {ratio:.2g} of the Young's modulus, where an isotropic material has 0.33 to 0.5",
            0.1 * strands.young_modulus_Pa,
            strands.young_modulus_Pa,
            strands.young_modulus_Pa / 3,
            strands.young_modulus_Pa / 2,
        ),
        (
            "linear_density_kg_per_m",
            strands.linear_density_kg_per_m,
            f"with this radius that is {density:.3g} kg/m^3",
            50.0 * area,
            25_000.0 * area,
            500.0 * area,
            2000.0 * area,
        ),
    ):
        if not low <= value <= high:
            instead = f"set between {least:.2g} and {most:.2g}"
            yield Finding(f"body.strands.{field}", value, problem, instead, "warning")


def _steps(config: RunConfig) -> Iterator[Finding]:
    """The physics step against what it must resolve."""
    body, arena, step = config.body, config.arena, config.clock.physics_timestep_s
    assert isinstance(body, WormBody)
    assert arena is not None
    yield from body.formulation.findings(config)
    # At one step the engine's floor is twice as soft as asked, which has been measured; at less nothing has.
    if arena.contact_time_constant_s < 0.5 * step:
        yield softened("arena.contact_time_constant_s", arena.contact_time_constant_s, "contacts", step)
    if arena.slope_rad:
        # On ground that rises ahead the skin slides towards the rear.
        rise = arena.slope_rad * cos(radians(body.heading_deg))
        backward = rise > 1e-9 and arena.backward_friction is not None
        field, friction = ("backward_friction", arena.backward_friction) if backward else ("friction", arena.friction)
        steepness = tan(abs(arena.slope_rad))
        if steepness >= (friction or 0.0):
            yield Finding(
                "arena.slope_deg",
                round(degrees(arena.slope_rad), 9),
                f"with arena.{field} = {friction:g} the worm slides down",
                f"set arena.{field} above {steepness:.2g}",
                "warning",
            )


def softened(field: str, value: float, what: str, step: float) -> Finding:
    """Tells of a time constant that the engine cannot resolve."""
    return Finding(
        field,
        value,
        f"the engine cannot resolve this in steps of {step:g} s and makes the {what} as soft as with {2 * step:g} s",
        f"set {2 * step:g}, or clock.physics_timestep_s = {value / 2:.1g}",
        "warning",
    )


def tolerance_window_m(config: RunConfig) -> tuple[float, float] | None:
    """Estimates between which tolerances of the stretch sensors the paper's controller walks in order, m.

    Below, contracting neighbours lift a segment at rest out of its tolerance. Above, a segment that lets go is back
    within it before the next has left it: all sensors say "at rest", and nothing contracts again. The middle of both
    is the tolerance to set. Fitted to the paper's robot of rods under a timed wave, with moduli of 0.3 to 2 GPa,
    friction of 0.05 to 1 and damping times of 0.05 to 0.36 s, within 5 mm (docs/robust.md). The stiffness enters
    as ``sqrt(EI / (k s^3))``, with the springs' rate k and the side s of a rhombus: the stiffer the strands, the
    further a contraction spreads.

    Args:
        config: Any configuration.

    Returns:
        How far neighbours lift a segment, and the length beyond rest at which the releasing and the next segment are
        equally long; where the first is the larger, no tolerance is known to do. None for bodies that were not
        measured: other than rods with rigid crossings, of a material with a damping time of 0.05 to 0.4 s, contracted
        by muscles all round.
    """
    body, arena = config.body, config.arena
    if not isinstance(body, WormBody) or arena is None:
        return None
    damping_s, rings = body.strands.material_damping_s, body.rings
    if not damping_s or not body.formulation.has_rigid_crossings or rings.muscle is None or rings.layout != "whole":
        return None
    # Beyond what was measured the lines that were fitted say nothing.
    if not body.springs.stiffness_N_per_m or not 0.05 <= damping_s <= 0.4:
        return None
    shape, strands = rhombus_of(body), body.strands
    rigidity = strands.bending_rigidity_Nm2
    spread = sqrt(rigidity / (body.springs.stiffness_N_per_m * shape.side_m**3))
    slippery = log(1.0 / min(max(arena.friction, 0.05), 1.0))
    most = shape.longest_m - shape.along_m
    lift = max(0.02, spread * (0.24 + 0.84 * damping_s) + 0.015 * slippery - 0.15)
    return most * lift, most * (0.16 + 0.087 * spread + 0.48 * damping_s)


def _senses(config: RunConfig) -> Iterator[Finding]:
    """The sensors' tolerance against what a segment can lengthen by, and its neighbours lift it by."""
    if "tolerance_m" not in config.controller.sensor_fields:
        return
    assert isinstance(config.body, WormBody)
    shape, tolerance = rhombus_of(config.body), config.sensor.tolerance_m
    most = shape.longest_m - shape.along_m
    window = tolerance_window_m(config)
    low, high = window or (0.02 * most, 0.25 * most)
    problem, instead = "", f"set about {(low + high) / 2 if window else 0.12 * most:.2g}"
    if tolerance >= most:
        problem = (
            f"a segment lengthens by at most {most:.2g} m before its strands are straight: its sensor never goes off"
        )
    elif window and low >= high:
        problem = (
            f"contracting neighbours lift a segment by about {low:.2g} m, and one that lets go is within {high:.2g} m "
            "before the next is beyond it, so that no tolerance is known to keep the order"
        )
        instead = "take controller.kind = sns-robust, or softer strands"
    elif tolerance > high and window:
        problem = (
            f"a segment that lets go is within {high:.2g} m before the next is beyond it: sensors may never go off"
        )
    elif tolerance > high:
        problem = (
            f"that is over a quarter of the {most:.2g} m by which a segment can lengthen: sensors may never go off"
        )
    elif tolerance < low:
        lift = low if window else 0.1 * most
        problem = f"a contracting neighbour lifts a segment by up to {lift:.2g} m: sensors may never go on"
    if problem:
        yield Finding("sensor.tolerance_m", tolerance, problem, instead, "warning")


def _text(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    return f"{value:g}" if isinstance(value, int | float) else str(value)

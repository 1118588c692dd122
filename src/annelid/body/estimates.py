"""How much a mesh resists its rings, in closed form, and what is found by checking a worm's numbers against it.

Where a ring of m crossings, c apart, is drawn in, the rhombi round it close. With h, the hypotenuse of a rhombus' two
diagonals at rest, they keep ``c = h sin(a)`` and springs of the length ``x = h cos(a)``, a being half the angle at
which strands meet. Each strand of bending stiffness EI is bent by the change of a over about one side s of the rhombus,
and the springs of rate k and rest length x0 are drawn out. The virtual work of the ring's tension T gives

    T(a) = 1.3 EI (a0 - a) / (s^2 cos(a)) + k (x - x0) tan(a)

The factor 1.3 is fitted to the one ring that the authors simulated in a load frame (E 2 GPa, radius 2.99 mm), whose
curve the estimate then follows within 15 % from 10 to 100 mm of its diameter. End rings bear a fifth less, and with the
paper's soft strands the estimate is low by up to a half: it is good to a factor of two, and nothing is refused on its
account unless it is exceeded by more. Rings of that mesh collapse at 14 to 16 N; the estimate at a0 / 3 is 16.8 N.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, hypot, sqrt, tan

from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.morphology import Rhombus, rhombus

LEAST_SHORTENED = 0.02
"""Share of its length at rest below which a ring has hardly been shortened."""
COLLAPSED = 0.2
"""Ring length over that at rest below which a ring counts as collapsed; in all presets it stays above 0.3."""
_BENDING = 1.3
ESTIMATE_FACTOR = 2.0
MOST_SHRUNK_AT_REST = 2 / 3
"""Length over that at rest to which actuators may draw a ring before anything is activated."""
_MUSCLE_STEP = 3.0
"""Of worms with stiff strands, 3 and 5 cm in radius, steps of 2.6 to 3.6 ran, and some of 4.2 and 5.2 failed."""
WALKS_FROM = 0.75
"""Of the lift by the neighbours: the smallest tolerance with which the worm walks, within 3 mm in five cases."""


def rhombus_of(body: MeshBody) -> Rhombus:
    """Returns the rhombus at rest of a body whose segments have one radius."""
    mesh = body.mesh
    return rhombus(mesh.n_helices, mesh.one_number("radius_m"), mesh.angular_rate_rad_per_m, mesh.elements_per_side)


def touching_ring_m(body: MeshBody) -> float:
    """Returns the length of a ring at which the strands of neighbouring crossings touch, m."""
    return body.mesh.n_helices // 2 * 2.0 * body.strands.radius_m


def bearable_force_N(body: MeshBody, share: float = 1 / 3) -> float:
    """Estimates the tension at which a ring closes to a share of the rhombi's opening at rest, N: see the module.

    Segments must be alike, as `WormBody.groups` makes them.

    Args:
        body: The worm.
        share: Opening of the rhombi over that at rest.
    """
    shape, springs = rhombus_of(body), body.springs
    rest, opening = shape.opening_rad, share * shape.opening_rad
    bending = _BENDING * body.strands.bending_rigidity_Nm2 * (rest - opening) / (shape.side_m**2 * cos(opening))
    spring_m = shape.along_m if springs.rest_length_m is None else springs.one_number("rest_length_m")
    stretch = hypot(shape.across_m, shape.along_m) * cos(opening) - spring_m
    if springs.tension_only:
        stretch = max(0.0, stretch)
    return bending + springs.one_number("stiffness_N_per_m") * stretch * tan(opening)


def longest_step_s(body: MeshBody, force_N: float) -> float:
    """Returns the longest physics step in which muscles of a greatest force move their segments reliably, s.

    It is in proportion to the root of a segment's mass times its ring's length over the force; the factor is measured.

    Args:
        body: The worm; its segments must be alike, as `WormBody.groups` makes them.
        force_N: Greatest force of a ring's muscle.
    """
    shape, mesh = rhombus_of(body), body.mesh
    strands = mesh.n_helices * mesh.planes_between_rings * shape.side_m
    mass_kg = body.strands.one_number("linear_density_kg_per_m") * strands
    return _MUSCLE_STEP * sqrt(mass_kg * shape.ring_length_m / max(force_N, 1e-9))


def weakness_findings(body: MeshBody, field: str, value: float, force_N: float) -> Iterator[Finding]:
    """Checks the greatest force of an actuator against what hardly closes a ring."""
    needed = bearable_force_N(body, 1.0 - LEAST_SHORTENED)
    if force_N < needed / ESTIMATE_FACTOR:
        share = 100 * LEAST_SHORTENED
        problem = f"a ring is pulled with {force_N:.2g} N at most, where {needed:.2g} N shorten it by {share:g} %"
        instead = f"set at least {ESTIMATE_FACTOR * value * needed / force_N:.2g}" if force_N else "set more"
        yield Finding(f"body.rings.{field}", value, problem, instead)


def crush_findings(field: str, force_N: float, bearable_N: float, share: float) -> Iterator[Finding]:
    """Checks a force against what the mesh bears, where its actuator closes a ring to a share of its length at rest."""
    if share < COLLAPSED and force_N > ESTIMATE_FACTOR * bearable_N:
        problem = (
            f"rings close under about {bearable_N:.2g} N, and nothing stops them above {100 * max(0.0, share):.0f} % "
            "of their length at rest"
        )
        instead = f"set at most {bearable_N:.2g}, or limit the length with body.rings.length_range_m"
        yield Finding(f"body.rings.{field}", force_N, problem, instead)


def soft_constraint(field: str, value: float, what: str, step: float, engine_s: float | None = None) -> Finding:
    """Reports a time constant that the engine cannot resolve in steps, or in its own where these are shorter, s."""
    least = 2.0 * (engine_s or step)
    return Finding(
        field,
        value,
        f"the engine cannot resolve this in steps of {step:g} s and makes the {what} as soft as with {least:.3g} s",
        f"set {least:.2g}, or clock.physics_timestep_s = {value * step / least:.1g}",
    )

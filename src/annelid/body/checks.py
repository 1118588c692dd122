"""What is wrong with a 3D worm before it runs: lengths, forces, steps and tolerances checked against one another.

Everything here follows from the configuration alone, in closed form, in under a millisecond and without the engine.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, hypot, pi, radians, tan

from annelid.body.estimates import WALKS_FROM, longest_step_s, rhombus_of, soft_constraint
from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.config.run import RunConfig


def mesh_findings(body: MeshBody) -> Iterator[Finding]:
    """Checks the proportions of the mesh; segments must be alike, as `WormBody.groups` makes them."""
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
    most, usual = shape.longest_m / shape.along_m, 2.0 / mesh.one_number("radius_m")
    problem = instead = ""
    if most > 4.0:
        problem = (
            f"the strands lie almost along the rings, so that a segment can stretch to {most:.1f} times its length"
        )
        instead = f"set at most {usual:.3g} with this radius (twice the length is usual)"
    elif most < 1.1:
        problem = (
            f"the strands lie almost along the body, so that a segment can stretch to {most:.2f} times its length only"
        )
        instead = f"set about {usual:.3g} with this radius"
    if problem:
        yield Finding("body.mesh.angular_rate_rad_per_m", mesh.angular_rate_rad_per_m, problem, instead)
    if shape.bend_rad > radians(45.0):
        elements = round(shape.bend_rad * mesh.elements_per_side / radians(30.0) + 0.5)
        yield Finding(
            "body.mesh.elements_per_side",
            mesh.elements_per_side,
            f"a strand turns by {shape.bend_rad * 180 / pi:.0f} degrees about the body in one straight element",
            f"set at least {elements}",
        )
    rest = None if body.springs.rest_length_m is None else body.springs.one_number("rest_length_m")
    if rest is not None and not 0.5 <= rest / shape.along_m <= 1.5:
        yield Finding(
            "body.springs.rest_length_m",
            rest,
            f"the mesh holds these springs at {shape.along_m:.3g} m, {shape.along_m / rest:.2g} times that",
            f"set between {0.5 * shape.along_m:.2g} and {1.5 * shape.along_m:.2g}, or leave it out",
        )


def material_findings(body: MeshBody) -> Iterator[Finding]:
    """Checks moduli and densities against those of materials that there are."""
    young, shear, line = map(
        body.strands.one_number, ("young_modulus_Pa", "shear_modulus_Pa", "linear_density_kg_per_m")
    )
    area = pi * body.strands.radius_m**2
    ratio = (
        f"that is {shear / young:.2g} of body.strands.young_modulus_Pa, where an isotropic material has 0.33 to 0.5: "
        "both moduli change together"
    )
    density = f"with this radius that is {line / area:.3g} kg/m^3"
    # Each with the bounds beyond which it is doubtful, and those to set it between.
    for field, value, problem, low, high, least, most in (
        ("young_modulus_Pa", young, "no strand is made of this", 1e6, 4e11, 1e6, 4e11),
        ("shear_modulus_Pa", shear, ratio, 0.25 * young, young, young / 3, young / 2),
        ("linear_density_kg_per_m", line, density, 50.0 * area, 25_000.0 * area, 500.0 * area, 2000.0 * area),
    ):
        if not low <= value <= high:
            yield Finding(f"body.strands.{field}", value, problem, f"set between {least:.2g} and {most:.2g}")


def ground_findings(config: RunConfig, body: MeshBody, force_N: float) -> Iterator[Finding]:
    """Checks the muscles' greatest force and contacts against the physics step, and the friction against the slope."""
    arena, step = config.arena, config.clock.physics_timestep_s
    assert arena is not None
    if step > (longest := longest_step_s(body, force_N)):
        problem = f"{force_N:.3g} N move segments as light as these too fast: the engine's solve may fail"
        yield Finding("clock.physics_timestep_s", step, problem, f"set at most {longest:.2g}, or take weaker muscles")
    # Down to half a step contacts are up to twice as soft as asked, which has been measured; below nothing has.
    if arena.contact_time_constant_s < 0.5 * step:
        yield soft_constraint(
            "arena.contact_time_constant_s", arena.contact_time_constant_s, "contacts", step, 0.5 * step
        )
    if not arena.slope_rad:
        return
    # On ground that rises ahead the skin slides towards the rear.
    backward = arena.slope_rad > 0.0 and arena.backward_friction is not None
    field, friction = ("backward_friction", arena.backward_friction) if backward else ("friction", arena.friction)
    steepness = tan(abs(arena.slope_rad))
    if steepness >= (friction or 0.0):
        problem = f"with arena.{field} = {friction:g} the worm slides down"
        slope_deg = round(degrees(arena.slope_rad), 9)
        yield Finding("arena.slope_deg", slope_deg, problem, f"set arena.{field} above {steepness:.2g}")


def tolerance_findings(
    config: RunConfig, body: MeshBody, window: tuple[float, float] | None, *, lags: bool
) -> Iterator[Finding]:
    """Checks the sensors' tolerance against what a segment can lengthen by, and neighbours lift it by: the window."""
    if "tolerance_m" not in config.controller.sensor_fields:
        return
    shape, tolerance = rhombus_of(body), config.sensor.tolerance_m
    most = shape.longest_m - shape.along_m
    # Muscles that lag let segments pass each other at more than half of that (docs/evidence/robust.md).
    share = 0.5 if lags else 0.25
    low, high = window or (0.02 * most, share * most)
    instead = f"set about {(low + high) / 2 if window else 0.48 * high:.2g}"
    if tolerance >= most:
        problem = f"a segment lengthens by at most {most:.2g} m, to straight strands: its sensor never switches off"
    elif window and low >= high:
        problem = (
            f"no tolerance is known to keep the order. Neighbours lengthen a segment by {low:.2g} m, which must switch "
            f"nothing; above {high:.2g} m a relaxing segment's sensor switches on too early"
        )
        instead = "take controller.kind = sns-robust, or softer strands"
    elif tolerance > high and window:
        problem = (
            f"above {high:.2g} m a relaxing segment's sensor switches on before that of the next one is off, so that "
            "the wave may stop"
        )
    elif tolerance > high:
        lengthens = f"{most:.2g} m by which a segment can lengthen"
        problem = f"that is over {100 * share:.0f} % of the {lengthens}: sensors may never switch off"
    elif tolerance < low:
        lift = low / WALKS_FROM if window else 0.1 * most
        problem = f"a contracting neighbour lengthens a segment by up to {lift:.2g} m: sensors may never switch on"
    else:
        return
    yield Finding("sensor.tolerance_m", tolerance, problem, instead)

"""A worm of another size that moves as a known one does: every coupled number by Froude similarity.

Lengths grow with the radius and times with its square root, so that gravity stays what it is. The material is stiffer
in proportion to the side of a rhombus, which keeps the mesh's stiffness over its weight, and forces grow with the
weight. With the known worm's shape and numbers of segments and strands the whole motion is the known one's, enlarged;
with others it is close to it.
"""

from __future__ import annotations

from math import ceil, log, pi, sqrt
from textwrap import wrap
from typing import Any

from annelid.body import (
    Mesh,
    WormBody,
    bearable_force_N,
    build_spec,
    compile_spec,
    longest_step_s,
    rhombus_of,
    worm_of,
)
from annelid.config import RunConfig, check_section, load_config, toml_value
from annelid.errors import ConfigError, require_finite, require_positive
from annelid.morphology import rhombus
from annelid.plausibility import refuse_nonsense
from annelid.text import LINE

BASE = "riddle2023-rods"
"""The preset that new worms are similar to."""
LARGEST_ANGLE_RAD = pi / 6
"""Largest angle by which a strand may turn in one element."""
MOST_ELEMENTS = 3900
"""Most elements of all strands: two moving bodies each, and plain MuJoCo is slow above 8,192."""
LEAST_SHAPE, MOST_SHAPE = 1.2, 4.0
"""Turn of a strand along one radius of the axis, rad, within which a length is accepted; the base's is 2.24."""
MOST_RADIUS_M = 1.0
"""Six times that of the largest robot; more is taken for millimetres."""
CYCLES = 4
"""Cycles of the paper's network, 0.875 s a segment at the base's size, that a run lasts."""
TURN_S = 0.875

Fields = dict[str, tuple[Any, str]]
"""Values by dotted path, each with the rule that it follows."""


def similar_worm(
    radius_m: float,
    n_segments: int = 3,
    n_helices: int = 12,
    length_m: float | None = None,
    rear_radius_m: float | None = None,
    segment_length_m: float | None = None,
    strand_radius_m: float | None = None,
    young_modulus_Pa: float | None = None,
) -> Fields:
    """Returns the fields in which a worm differs from `BASE`.

    Args:
        radius_m: Radius at rest.
        n_segments: Segments.
        n_helices: Strands, half of each handedness.
        length_m: Length at rest; by default that at which rhombi have the shape of the base's.
        rear_radius_m: Radius at rest of the last ring, where the body tapers; all else follows the first's.
        segment_length_m: Distance of two rings at rest, in place of the length.
        strand_radius_m: Radius of the strands, which are solid; by default in proportion to the side of a rhombus.
        young_modulus_Pa: Young's modulus of the strands; by default likewise.

    Raises:
        ConfigError: A number is out of its range, or with this length strands would lie along the body or the rings.
    """
    asked = {
        "radius_m": radius_m,
        "rear_radius_m": rear_radius_m,
        "length_m": length_m,
        "segment_length_m": segment_length_m,
        "strand_radius_m": strand_radius_m,
        "young_modulus_Pa": young_modulus_Pa,
    }
    for name, value in asked.items():
        if value is not None:
            require_finite(**{name: value})
            require_positive(**{name: value})
            if name.endswith("radius_m") and value > MOST_RADIUS_M:
                raise ConfigError(
                    f"{name} = {value:g} is over {MOST_RADIUS_M:g} m: give metres; {value:g} mm are {value / 1e3:g}"
                )
    if length_m is not None and segment_length_m is not None:
        raise ConfigError("length_m and segment_length_m say the same: give one of them")
    base = load_config(BASE)
    known, arena = worm_of(base), base.arena
    assert arena is not None
    # Checked before anything is computed from them.
    geometry = {"n_segments": n_segments, "n_helices": n_helices, "radius_m": radius_m}
    check_section(Mesh, known.mesh.model_dump() | geometry)
    scale = radius_m / known.mesh.one_number("radius_m")
    slower = sqrt(scale)
    planes, rate = _planes_and_rate(known, radius_m, n_segments, n_helices, length_m, segment_length_m)
    turn = pi / (n_helices // 2)
    sides = n_helices * (planes * (n_segments + 1))
    elements = max(ceil(turn / LARGEST_ANGLE_RAD - 1e-9), min(known.mesh.elements_per_side, MOST_ELEMENTS // sides))
    shape, own = rhombus_of(known), rhombus(n_helices, radius_m, rate, elements)
    # Of a rhombus of strands as thick as the side asks for, the weight goes with side^3 and the force that bends them
    # with E side^2: a modulus in proportion to the side keeps their ratio.
    longer = own.side_m / shape.side_m
    strands, pins, springs, rings = known.strands, known.pins, known.springs, known.rings
    ranges = [length * own.ring_length_m / shape.ring_length_m for length in rings.length_ranges(1)[0]]
    impedance = [*arena.contact_impedance[:2], arena.contact_impedance[2] * scale]
    side = "in proportion to the side of a rhombus"
    strand, strand_rule = (
        (strands.radius_m * longer, side) if strand_radius_m is None else (strand_radius_m, "as asked")
    )
    thicker, base_Pa = strand / strands.radius_m, strands.one_number("young_modulus_Pa")
    young_Pa, young_rule = (
        (young_modulus_Pa, "as asked") if young_modulus_Pa else (base_Pa * longer, f"{side}, as the weight needs")
    )
    stiffer = young_Pa / base_Pa
    of_length = "the length asked for" if length_m or segment_length_m else "rhombi of the same shape"
    fields: Fields = {f"body.mesh.{name}": (value, "as asked") for name, value in geometry.items()} | {
        "body.mesh.angular_rate_rad_per_m": (rate, of_length),
        "body.mesh.elements_per_side": (
            elements,
            "as there; a strand turns by at most 30 degrees in one, and the engine slows above 3,900",
        ),
        "body.mesh.planes_between_rings": (planes, "rhombi nearly of the same shape"),
        "body.mesh.free_planes_at_ends": (planes - 1, "one less than between rings"),
        "body.mesh.rear_overhang_m": (turn / rate / 2.0, "half the distance of two planes"),
        "body.strands.radius_m": (strand, strand_rule),
        "body.strands.young_modulus_Pa": (young_Pa, young_rule),
        "body.strands.shear_modulus_Pa": (
            strands.one_number("shear_modulus_Pa") * stiffer,
            "the same ratio to Young's modulus",
        ),
        "body.strands.linear_density_kg_per_m": (
            strands.one_number("linear_density_kg_per_m") * thicker**2,
            "the same density",
        ),
        "body.strands.damping_time_s": (strands.damping_time_s * slower, "a time: radius^0.5"),
        "body.pins.mass_kg": (pins.one_number("mass_kg") * thicker**2 * longer, "the same share of the weight"),
        "body.pins.radius_m": (pins.radius_m * scale, "a length"),
        "body.springs.stiffness_N_per_m": (
            springs.one_number("stiffness_N_per_m") * stiffer * thicker**4 / longer**3,
            "strands' bending stiffness over side^3",
        ),
        "body.rings.length_range_m": (ranges, "the same share of the ring at rest"),
        "body.rings.maximum_velocity": (
            rings.model_dump()["maximum_velocity"] / slower,
            "lengths a second: radius^-0.5",
        ),
        "body.rings.activation_times_s": (
            [time_s * slower for time_s in rings.model_dump()["activation_times_s"]],
            "times: radius^0.5",
        ),
        "body.formulation.edge_time_constant_s": (
            known.formulation.model_dump()["edge_time_constant_s"] * slower,
            "a time",
        ),
        "arena.contact_time_constant_s": (arena.contact_time_constant_s * slower, "a time"),
        "arena.contact_impedance": (impedance, "the last is a length"),
        "arena.floor_gap_m": (arena.model_dump()["floor_gap_m"] * scale, "a length"),
    }
    weight = thicker**2 * longer * n_helices / known.mesh.n_helices * n_segments / known.mesh.n_segments
    network = base.controller.model_dump()
    fields |= {
        "controller.capacitance_nF": (network["capacitance_nF"] * slower, "a time constant: radius^0.5"),
        "controller.gate_time_constant_ms": (network["gate_time_constant_ms"] * slower, "a time: radius^0.5"),
        "sensor.startup_hold_s": (base.sensor.startup_hold_s * slower, "a time: radius^0.5"),
        "guard.kinetic_energy_J": (base.guard.kinetic_energy_J * weight * scale, "weight times length"),
        "guard.height_m": (base.guard.height_m * scale, "a length"),
        "guard.depth_m": (base.guard.depth_m * scale, "a length"),
    }
    # What follows from the whole mesh. The window was measured at the base's damping, which a similar worm's is.
    similar = load_config(BASE, _values(fields) | {"body.strands.damping_time_s": strands.damping_time_s})
    body = worm_of(similar)
    window = body.tolerance_window_m(arena.friction)
    assert window is not None
    force = rings.forces(1)[0] * bearable_force_N(body) / bearable_force_N(known)
    low, high = window
    if low >= high:
        raise ConfigError(f"n_helices = {n_helices}: neighbours lift a segment further than it lengthens; take more")
    fields["body.rings.peak_force_N"] = (force, "the same share of what the mesh bears")
    steps = _steps(base, n_segments, slower, longest_step_s(body, force))
    if rear_radius_m is not None:
        fields |= _tapered(body, force, ranges, rear_radius_m)
    fields["sensor.tolerance_m"] = ((low + high) / 2.0, f"middle of the window {1e3 * low:.2g} to {1e3 * high:.2g} mm")
    # Steps stay whole multiples of one another.
    return {path: (_rounded(value), rule) for path, (value, rule) in fields.items()} | steps


def _tapered(body: WormBody, force_N: float, range_m: list[float], rear_radius_m: float) -> Fields:
    """Returns what differs among the segments of a body whose radius changes evenly from the first ring to the last."""
    n, front_m = body.n_segments, body.mesh.radii_m[0]
    radii = [front_m + (rear_radius_m - front_m) * ring / (n - 1) for ring in range(n)]
    mesh = check_section(Mesh, body.mesh.model_dump() | {"radius_m": radii})
    bodies = [body.model_copy(update={"mesh": mesh.of_segment(ring)}) for ring in range(n)]
    forces = [force_N * bearable_force_N(one) / bearable_force_N(body) for one in bodies]
    ranges = [[bound * radius / front_m for bound in range_m] for radius in radii]
    return {
        "body.mesh.radius_m": (radii, "even from the first ring to the last"),
        "body.rings.length_range_m": (ranges, "the same share of each ring at rest"),
        "body.rings.peak_force_N": (forces, "the same share of what the mesh bears there"),
    }


def worm_text(fields: Fields) -> str:
    """Returns a worm of `similar_worm` as TOML that ``annelid run`` takes, with the rule behind every number.

    Raises:
        ConfigError: Its run would be refused, by the checks or by the engine.
    """
    config = load_config(BASE, _values(fields))
    refuse_nonsense(config)
    compile_spec(build_spec(config))
    tables: dict[str, list[str]] = {"": []}
    for path, (value, rule) in fields.items():
        table, _, name = path.rpartition(".")
        line = f"{name} = {toml_value(value)}"
        with_rule = f"{line:<40}  # {rule}"
        above = wrap(rule, LINE, initial_indent="# ", subsequent_indent="# ")
        tables.setdefault(table, []).extend([with_rule] if len(with_rule) <= LINE else [*above, line])
    mesh = worm_of(config).mesh
    shape = f"radius {mesh.radii_m[0]:g} m, {mesh.n_segments} segments and {mesh.n_helices} strands"
    heading = [
        *wrap(f"A worm of {shape} that moves as {BASE} does.", LINE, initial_indent="# ", subsequent_indent="# "),
        "# Numbers follow from the geometry by Froude similarity. The rule stands beside",
        f'# each; "the same" is as in {BASE}. Replace what you can measure on',
        "# your robot. annelid check compares the numbers with one another.",
        f'extends = "{BASE}"',
    ]
    parts = ["\n".join(([f"[{name}]"] if name else heading) + lines) for name, lines in tables.items()]
    return "\n\n".join(parts) + "\n"


def _steps(base: RunConfig, n_segments: int, slower: float, longest_s: float) -> Fields:
    """The clock's steps, times as all others but no longer than muscles bear, and what is a multiple of them."""
    clock, record = base.clock, base.record
    control_s = float(f"{min(clock.control_timestep_s * slower, 0.95 * longest_s):.2g}")
    n_control = min(round(clock.physics_timestep_s / clock.control_timestep_s), int(longest_s / control_s))
    physics_s = n_control * control_s
    n_signal = round(record.signals_interval_s * slower / physics_s)
    n_frame = n_signal * round(record.frames_interval_s / record.signals_interval_s)
    n_physics = ceil(CYCLES * n_segments * TURN_S * slower / physics_s)
    return {
        "duration_s": (round(n_physics * physics_s, 9), f"{CYCLES} cycles"),
        "clock.control_timestep_s": (control_s, "a time: radius^0.5, at most the body's step"),
        "clock.physics_timestep_s": (
            round(physics_s, 9),
            f"steps of the network: {n_control}, fewer for strong muscles",
        ),
        "record.signals_interval_s": (round(n_signal * physics_s, 9), f"steps of the body: {n_signal}"),
        "record.frames_interval_s": (round(n_frame * physics_s, 9), f"steps of the body: {n_frame}"),
    }


def _planes_and_rate(
    known: WormBody,
    radius_m: float,
    n_segments: int,
    n_helices: int,
    length_m: float | None,
    segment_length_m: float | None,
) -> tuple[int, float]:
    """Planes between rings, and turn of a strand along the axis, rad/m, that give a length of the worm or a segment."""
    mesh = known.mesh
    shape, half = mesh.angular_rate_rad_per_m * mesh.one_number("radius_m"), n_helices // 2
    wanted_m = length_m or segment_length_m
    if wanted_m is None:
        return mesh.planes_between_rings, shape / radius_m

    def rate(planes: int) -> float:
        spaces = planes if segment_length_m else 2 * (planes - 1) + (n_segments - 1) * planes + 1
        return pi / half * spaces / wanted_m

    planes = min((4, 6, 8), key=lambda one: abs(log(rate(one) * radius_m / shape)))
    if not LEAST_SHAPE <= (turn := rate(planes) * radius_m) <= MOST_SHAPE:
        most, least = (wanted_m * turn / bound for bound in (LEAST_SHAPE, MOST_SHAPE))
        name = "length_m" if length_m else "segment_length_m"
        raise ConfigError(
            f"{name} = {wanted_m:g} does not fit {n_segments} segments of radius {radius_m:g} m: "
            f"it must be between {least:.2g} and {most:.2g} m"
        )
    return planes, rate(planes)


def _values(fields: Fields) -> dict[str, Any]:
    return {path: value for path, (value, _) in fields.items()}


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value

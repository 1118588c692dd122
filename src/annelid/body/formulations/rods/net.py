"""The fast formulation: elastic rods that share one vertex at each crossing.

Every mesh vertex is a body on three slides; a crossing is ONE such body for both of its strands, so a pin costs
no constraint and cannot part. Each strand is a 1D flex through its vertices' bodies, a discrete elastic rod with
bending and torsion, kept inextensible by edge constraints. A rod's twist needs one hinge per edge, found by its
name; without the hinges the model compiles and is far too floppy.

A plant has rows for bending and twist in place of the engine's (`annelid.body.formulations.rods.strains`), and its
bodies in the order that makes its steps cheap (`annelid.body.formulations.rods.elimination`). Separate pins are point
masses tied to a vertex of each strand by springs and dashpots (`annelid.body.constraint_rows`).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import groupby
from operator import itemgetter
from typing import Any

import mujoco
import numpy as np

from annelid.arena.friction import contact_options
from annelid.body.actuation import crossing_site, mark_crossing
from annelid.body.constraint_rows import HELD, LEAST_INERTIA_KG_M2, add_held_coordinate, add_holder, add_tie
from annelid.body.formulations import WRITTEN, Tie, densities_kg_per_m
from annelid.body.formulations.rods.elimination import elimination_order
from annelid.body.formulations.rods.strains import add_strains, net_stiffness, twist_names
from annelid.body.mesh import MeshBody, Strands
from annelid.config import ArenaKind
from annelid.errors import ConfigError
from annelid.morphology import Array, MeshGeometry

AXES = np.eye(3)
ORIGIN = np.zeros(3)
STRAND_RGBA = ((0.12, 0.35, 0.75, 1.0), (0.25, 0.5, 0.85, 1.0))
EDGE_IMPEDANCE = [0.99, 0.999, 0.001, 0.5, 2.0]
HIDDEN_GROUP = 4
BODIES_IN_PART = 200
ARENA_BYTES, ARENA_BYTES_A_BODY, ARENA_BYTES_A_PAIR = 256_000_000, 20_000, 6
"""Memory for one step: three times of what 96 segments use, a hundred times of what three use."""
Maker = Callable[[mujoco.MjSpec, str], object]
"""Adds one body of a name to the world."""
SOLVER_ITERATIONS, SOLVER_TOLERANCE = 300, 1e-6
"""At 1e-4 what is pulled and held creeps by a percent; 1e-12 is the same as 1e-6 within 0.1 %."""
TWIST_MASS_KG = 1e-9
"""The hinges carry polar inertia only; the engine refuses a body of no mass."""
MOST_RAISED = 60.0
"""How many times its own inertia of twist an edge may get, so that the engine takes it. In a step the stiffness
outweighs that inertia some thousand times: a worm of 5 mm, which gets 56 times its own, elongates as a large one
within 0.5 %."""


def add_rods(
    spec: mujoco.MjSpec,
    geometry: MeshGeometry,
    body: MeshBody,
    arena: ArenaKind,
    edge_time_constant_s: float,
    tie: Tie | None,
    *,
    for_plant: bool,
) -> None:
    """Adds the mesh as a net of rods, and the solver settings that it needs, as `FormulationKind.add`.

    Separate pins have a tie to their strands.
    """
    # The one combination under which stiff rods are stable: implicit in position, with Newton.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.iterations = SOLVER_ITERATIONS
    spec.option.tolerance = SOLVER_TOLERANCE
    # The net is one island; looking for others takes 3 % of a step.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
    density = densities_kg_per_m(geometry, body.strands)
    bodies, names = _vertices(geometry, body, arena, tie, density)
    bodies.setdefault(HELD, add_held_coordinate)
    twists = [
        _twist_bodies(f"strand_{strand}", vertices_m, body.strands, density)
        for strand, vertices_m in enumerate(geometry.vertices_m)
    ]
    for each in twists:
        bodies |= each
    if for_plant:
        order = elimination_order([*bodies], geometry, names, [[*each] for each in twists])
        number = {name: i for i, name in enumerate(order)}
        # The engine would take up to a hundred times what it uses, 15 GB for 48 segments.
        spec.memory = ARENA_BYTES + ARENA_BYTES_A_BODY * len(order) + ARENA_BYTES_A_PAIR * len(order) ** 2
        spec.add_numeric(name=WRITTEN, size=len(order), data=[number[name] for name in bodies])
        for first in range(0, len(order), BODIES_IN_PART):
            _add_part(spec, bodies, order[first : first + BODIES_IN_PART], "")
    else:
        for letter, alike in groupby(bodies, itemgetter(0)):
            _add_part(spec, bodies, [*alike], letter)
    if tie is not None:
        for crossing, strands in enumerate(geometry.crossing_strands):
            vertex = geometry.crossing_vertex[geometry.crossing_plane[crossing]]
            for strand in strands:
                add_tie(spec, crossing_site(crossing), names[strand][vertex], tie)
    material = body.strands.of_segment(0)
    stiffness = net_stiffness(geometry, body.strands)
    for strand, (vertices_m, points) in enumerate(zip(geometry.vertices_m, names, strict=True)):
        rgba = STRAND_RGBA[strand // geometry.n_per_plane]
        rows = stiffness[:, strand] if for_plant else None
        options = {"rgba": rgba, "density_kg_per_m": density, "stiffness_Nm": rows, "has_hinges": True}
        add_rod(spec, f"strand_{strand}", vertices_m, points, material, edge_time_constant_s, **options)


def _vertices(
    geometry: MeshGeometry, body: MeshBody, arena: ArenaKind, tie: Tie | None, density_kg_per_m: Array
) -> tuple[dict[str, Maker], list[list[str]]]:
    """Returns what adds the body of every vertex, by its name, crossings first, and the names along each strand."""
    n, contact = geometry.n_segments, contact_options(arena)
    masses = lumped_masses(geometry.vertices_m[0], density_kg_per_m).tolist()
    pins_kg = geometry.along(body.pins.of_each("mass_kg", n), geometry.plane_x_m)
    names = [[vertex_name(s, v) for v in range(len(masses))] for s in range(geometry.n_strands)]
    found: dict[str, Maker] = {}

    def add_point(spec: mujoco.MjSpec, name: str, place: Array, mass_kg: float) -> None:
        add_touch(add_vertex(spec, name, place, mass_kg), body.strands.radius_m, contact)

    def add_crossing(spec: mujoco.MjSpec, name: str, place: Array, mass_kg: float) -> None:
        pin = add_vertex(spec, name, place, mass_kg)
        mark_crossing(pin, name, body.pins.radius_m, 0.0)
        if tie is None:
            add_touch(pin, body.strands.radius_m, contact)

    for crossing in range(geometry.n_crossings):
        name, vertex = crossing_site(crossing), int(geometry.crossing_vertex[geometry.crossing_plane[crossing]])
        place = geometry.crossings_m[crossing]
        pin_kg = float(pins_kg[geometry.crossing_plane[crossing]])
        mass_kg = pin_kg + (2 * masses[vertex] if tie is None else 0.0)
        found[name] = partial(add_crossing, place=place, mass_kg=mass_kg)
        for strand in geometry.crossing_strands[crossing].tolist():
            if tie is None:
                names[strand][vertex] = name
            else:
                found[vertex_name(strand, vertex)] = partial(add_point, place=place, mass_kg=masses[vertex])
                # Where run files of older versions have it.
                found.setdefault(HELD, add_held_coordinate)
    between = sorted({*range(len(masses))} - {*geometry.crossing_vertex.tolist()})
    for strand in range(geometry.n_strands):
        for vertex in between:
            place = geometry.vertices_m[strand, vertex]
            found[vertex_name(strand, vertex)] = partial(add_point, place=place, mass_kg=masses[vertex])
    return found, names


def _add_part(spec: mujoco.MjSpec, bodies: dict[str, Maker], names: list[str], prefix: str) -> None:
    """Adds bodies to the world, built in a spec of their own.

    The engine walks the whole tree at every element that is added to it: 12 s for the bodies of 48 segments, and a
    tenth of it in parts. It says that a model whose names are joined without a prefix, as a plant's, cannot be written.
    """
    part = mujoco.MjSpec()
    part.compiler.degree = spec.compiler.degree
    for name in names:
        bodies[name](part, name.removeprefix(prefix))
    spec.attach(part, prefix=prefix, frame=spec.worldbody.add_frame())
    if prefix:
        # Each part brings an empty class of defaults, which would only fill the written MJCF.
        spec.delete(spec.find_default(f"{prefix}main"))


def vertex_name(strand: int, vertex: int) -> str:
    """Name of the body of a strand's own vertex."""
    return f"vertex_{strand}_{vertex}"


def add_vertex(spec: mujoco.MjSpec, name: str, position: Array, mass: float) -> mujoco.MjsBody:
    """Adds a point mass on three slides along the world's axes, the form that the Newton solver is fastest on."""
    point = add_holder(spec, name, mass, 1e-6 * mass)
    point.pos = position
    for axis, letter in zip(AXES, "xyz", strict=True):
        point.add_joint(name=f"{name}_{letter}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    return point


def add_touch(point: mujoco.MjsBody, radius_m: float, contact: dict[str, Any], place_m: Array = ORIGIN) -> None:
    """Lets a vertex touch the ground: one sphere, where a flex would make a contact for each strand of a crossing.

    Its place is in the axes of the vertex' body, m, ``(3,)``, and its radius that of the strand.
    """
    point.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        pos=place_m,
        size=[radius_m, 0.0, 0.0],
        mass=0.0,
        contype=0,
        conaffinity=1,
        group=HIDDEN_GROUP,
        **contact,
    )


def add_rod(
    spec: mujoco.MjSpec,
    name: str,
    vertices_m: Array,
    bodies: list[str],
    strands: Strands,
    edge_time_constant_s: float,
    *,
    rgba: tuple[float, float, float, float] = STRAND_RGBA[0],
    density_kg_per_m: Array | None = None,
    stiffness_Nm: Array | None = None,
    has_hinges: bool = False,
) -> None:
    """Adds one discrete elastic rod through existing bodies; the rod itself touches nothing.

    Args:
        spec: The spec that has the bodies, each on slides.
        name: Name of the flex; the twist hinges are named after it.
        vertices_m: Rest positions, shape ``(n_vertices, 3)``.
        bodies: Body of each vertex, at the vertex's place.
        strands: Material.
        edge_time_constant_s: Of the inextensible edges.
        rgba: Colour.
        density_kg_per_m: Mass per length of every edge, ``(n_edges,)``, instead of the material's.
        stiffness_Nm: Of the rows that resist bending and twist, ``(3, n_edges - 1)``, for a plant that renews them
            (`RodStrains`); None for the engine's own elasticity, one for the whole rod.
        has_hinges: Whether the spec has the twist hinges of its edges already.
    """
    n_edges = len(vertices_m) - 1
    if density_kg_per_m is None:
        density_kg_per_m = np.full(n_edges, strands.one_number("linear_density_kg_per_m"))
    flex = spec.add_flex(
        name=name,
        dim=1,
        radius=strands.radius_m,
        rgba=rgba,
        selfcollide=0,
        contype=0,
        conaffinity=0,
    )
    if stiffness_Nm is None:
        flex.young, flex.shear = strands.one_number("young_modulus_Pa"), strands.one_number("shear_modulus_Pa")
        flex.damping = strands.damping_time_s
    # In every model, so that a written one has as many coordinates as a plant's.
    add_held_coordinate(spec)
    flex.vertbody = bodies
    flex.elem = np.stack([np.arange(n_edges), np.arange(1, n_edges + 1)], axis=-1).ravel().tolist()
    if not has_hinges:
        for hinge, add in _twist_bodies(name, vertices_m, strands, density_kg_per_m).items():
            add(spec, hinge)
    spec.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_FLEX,
        objtype=mujoco.mjtObj.mjOBJ_FLEX,
        name1=name,
        solref=[edge_time_constant_s, 1.0],
        solimp=EDGE_IMPEDANCE,
    )
    if stiffness_Nm is not None:
        add_strains(spec, name, bodies, stiffness_Nm, strands.damping_time_s)


def _twist_bodies(rod: str, vertices_m: Array, strands: Strands, density_kg_per_m: Array) -> dict[str, Maker]:
    """Returns what adds the bodies of the twist hinges of a named rod's edges; arguments as `add_rod`.

    Raises:
        ConfigError: An edge is too light for the engine.
    """
    lengths = np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    inertias = 0.5 * density_kg_per_m * lengths * strands.radius_m**2
    if (raised := LEAST_INERTIA_KG_M2 / float(inertias.min())) > MOST_RAISED:
        raise ConfigError(
            f"body.strands.radius_m = {strands.radius_m:.3g}: this worm is too small for the engine's numbers; "
            f"one of its shape must be at least {1.01 * (raised / MOST_RAISED) ** 0.2:.3g} times as large"
        )

    def add(spec: mujoco.MjSpec, name: str, inertia: float) -> None:
        holder = add_holder(spec, name, TWIST_MASS_KG, inertia)
        holder.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=AXES[0])

    names = twist_names(rod, len(inertias))
    return {name: partial(add, inertia=inertia) for name, inertia in zip(names, inertias.tolist(), strict=True)}


def lumped_masses(vertices_m: Array, linear_density_kg_per_m: float | Array) -> Array:
    """Shares each element's mass between its two vertices, kg, ``(n_vertices,)``; elements may differ in density."""
    half = 0.5 * linear_density_kg_per_m * np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    return np.append(half, 0.0) + np.insert(half, 0, 0.0)

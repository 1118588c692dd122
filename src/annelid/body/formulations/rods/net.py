"""The fast formulation: elastic rods that share one vertex at each crossing.

Every mesh vertex is a body on three slides; a crossing is ONE such body for both of its strands, so a pin costs
no constraint and cannot part. Each strand is a 1D flex through its vertices' bodies, a discrete elastic rod with
bending and torsion, kept inextensible by edge constraints. A rod's twist needs one hinge per edge, found by its
name; without the hinges the model compiles and is far too floppy.

A plant has rows for bending and twist in place of the engine's (`annelid.body.formulations.rods.strains`). Separate
pins are point masses tied to a vertex of each strand by springs and dashpots (`annelid.body.constraint_rows`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np

from annelid.arena.friction import contact_options
from annelid.body.actuation import crossing_site, mark_crossing
from annelid.body.constraint_rows import LEAST_INERTIA_KG_M2, add_held_coordinate, add_holder, add_tie
from annelid.body.formulations import Tie, densities_kg_per_m
from annelid.body.formulations.rods.strains import add_strains, net_stiffness, twist_name
from annelid.body.mesh import MeshBody, Strands
from annelid.config import ArenaKind
from annelid.errors import ConfigError
from annelid.morphology import Array, MeshGeometry

AXES = np.eye(3)
ORIGIN = np.zeros(3)
STRAND_RGBA = ((0.12, 0.35, 0.75, 1.0), (0.25, 0.5, 0.85, 1.0))
EDGE_IMPEDANCE = [0.99, 0.999, 0.001, 0.5, 2.0]
HIDDEN_GROUP = 4
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
    names = _add_vertices(spec, geometry, body, arena, tie, density)
    material = body.strands.of_segment(0)
    stiffness = net_stiffness(geometry, body.strands)
    for strand, (vertices_m, bodies) in enumerate(zip(geometry.vertices_m, names, strict=True)):
        rgba = STRAND_RGBA[strand // geometry.n_per_plane]
        rows = stiffness[:, strand] if for_plant else None
        options = {"rgba": rgba, "density_kg_per_m": density, "stiffness_Nm": rows}
        add_rod(spec, f"strand_{strand}", vertices_m, bodies, material, edge_time_constant_s, **options)


def _add_vertices(
    spec: mujoco.MjSpec,
    geometry: MeshGeometry,
    body: MeshBody,
    arena: ArenaKind,
    tie: Tie | None,
    density_kg_per_m: Array,
) -> list[list[str]]:
    """Adds a body for every vertex, crossings first (which the solver is fastest with); returns each strand's names."""
    n, contact = geometry.n_segments, contact_options(arena)
    masses = lumped_masses(geometry.vertices_m[0], density_kg_per_m).tolist()
    pins_kg = geometry.along(body.pins.of_each("mass_kg", n), geometry.plane_x_m)
    names = [[vertex_name(s, v) for v in range(len(masses))] for s in range(geometry.n_strands)]
    for crossing in range(geometry.n_crossings):
        name, vertex = crossing_site(crossing), geometry.crossing_vertex[geometry.crossing_plane[crossing]]
        place, strands = geometry.crossings_m[crossing], geometry.crossing_strands[crossing]
        pin_kg = float(pins_kg[geometry.crossing_plane[crossing]])
        pin = add_vertex(spec, name, place, pin_kg + (2 * masses[vertex] if tie is None else 0.0))
        mark_crossing(pin, name, body.pins.radius_m, 0.0)
        if tie is None:
            add_touch(pin, body.strands.radius_m, contact)
            for strand in strands:
                names[strand][vertex] = name
            continue
        for strand in strands:
            point = add_vertex(spec, names[strand][vertex], place, masses[vertex])
            add_touch(point, body.strands.radius_m, contact)
            add_tie(spec, name, point.name, tie)

    between = sorted({*range(len(masses))} - {*geometry.crossing_vertex.tolist()})
    for strand in range(geometry.n_strands):
        with _built_apart(spec, vertex_name(strand, "")) as part:
            for vertex in between:
                point = add_vertex(part, str(vertex), geometry.vertices_m[strand, vertex], masses[vertex])
                add_touch(point, body.strands.radius_m, contact)
    return names


@contextmanager
def _built_apart(spec: mujoco.MjSpec, prefix: str) -> Iterator[mujoco.MjSpec]:
    """Yields a spec of its own for some bodies of the world, whose names get the prefix as they join.

    The engine walks the whole tree at every element that is added to it: 12 s for the bodies of 48 segments, and a
    tenth of it in parts.
    """
    part = mujoco.MjSpec()
    part.compiler.degree = spec.compiler.degree
    yield part
    spec.attach(part, prefix=prefix, frame=spec.worldbody.add_frame())
    # Each part brings an empty class of defaults, which would only fill the written MJCF.
    spec.delete(spec.find_default(f"{prefix}main"))


def vertex_name(strand: int, vertex: int | str) -> str:
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
    """
    lengths = np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    n_edges = len(lengths)
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
    with _built_apart(spec, f"{name}_") as part:
        for edge in range(n_edges):
            hinge = twist_name(name, edge, n_edges).removeprefix(f"{name}_")
            inertia = 0.5 * density_kg_per_m[edge] * lengths[edge] * strands.radius_m**2
            if (raised := LEAST_INERTIA_KG_M2 / inertia) > MOST_RAISED:
                raise ConfigError(
                    f"body.strands.radius_m = {strands.radius_m:.3g}: this worm is too small for the engine's numbers; "
                    f"one of its shape must be at least {1.01 * (raised / MOST_RAISED) ** 0.2:.3g} times as large"
                )
            holder = add_holder(part, hinge, TWIST_MASS_KG, inertia)
            holder.add_joint(name=hinge, type=mujoco.mjtJoint.mjJNT_HINGE, axis=AXES[0])
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


def lumped_masses(vertices_m: Array, linear_density_kg_per_m: float | Array) -> Array:
    """Shares each element's mass between its two vertices, kg, ``(n_vertices,)``; elements may differ in density."""
    half = 0.5 * linear_density_kg_per_m * np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    return np.append(half, 0.0) + np.insert(half, 0, 0.0)

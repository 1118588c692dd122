"""The fast formulation: elastic rods that share one vertex at each crossing.

Every mesh vertex is a body on three slides; a crossing is ONE such body for both of its strands, so a pin costs
no constraint and cannot part. Each strand is a 1D flex through its vertices' bodies, a discrete elastic rod with
bending and torsion, kept inextensible by edge constraints. A rod's twist needs one hinge an edge, found by its
name; without the hinges the model compiles and is far too floppy.
"""

from __future__ import annotations

from math import pi

import mujoco
import numpy as np

from annelid.arena.floor import contact_options
from annelid.body.actuation import crossing_site
from annelid.config import Arena, Rods, Strands, WormBody
from annelid.morphology import Array, MeshGeometry

AXES = np.eye(3)
STRAND_RGBA = ((0.12, 0.35, 0.75, 1.0), (0.25, 0.5, 0.85, 1.0))
PIN_RGBA = (0.25, 0.25, 0.28, 1.0)
EDGE_IMPEDANCE = [0.99, 0.999, 0.001, 0.5, 2.0]
HIDDEN_GROUP = 4
TWIST_MASS_KG = 1e-9
"""The hinges carry polar inertia only; the engine refuses a body of no mass."""


def add_rods(spec: mujoco.MjSpec, geometry: MeshGeometry, body: WormBody, formulation: Rods, arena: Arena) -> None:
    """Adds the mesh as a net of rods, and the solver settings that it needs.

    Args:
        spec: An empty spec.
        geometry: The mesh at rest.
        body: Materials and pins.
        formulation: Numerical settings of the rods.
        arena: Contact settings, which the strands share with the floor.
    """
    _set_solver(spec, formulation)
    names = _add_vertices(spec, geometry, body, contact_options(arena))
    for strand in range(geometry.n_strands):
        add_rod(
            spec,
            f"strand_{strand}",
            geometry.vertices_m[strand],
            names[strand],
            body.strands,
            formulation,
            rgba=STRAND_RGBA[strand // geometry.n_per_plane],
        )


def _set_solver(spec: mujoco.MjSpec, formulation: Rods) -> None:
    """Sets the one combination under which stiff rods are stable: implicit in position, with Newton."""
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.iterations = formulation.solver_iterations
    spec.option.tolerance = formulation.solver_tolerance
    spec.option.impratio = formulation.friction_impedance_ratio
    # The net is one island; looking for others takes 3 % of a step.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)


def _add_vertices(
    spec: mujoco.MjSpec, geometry: MeshGeometry, body: WormBody, contact: dict[str, list[float]]
) -> list[list[str]]:
    """Adds a body for every vertex, crossings first (which the solver is fastest with).

    Returns:
        The names of each strand's bodies from front to back.
    """
    masses = lumped_masses(geometry.vertices_m[0], body.strands.linear_density_kg_per_m).tolist()
    names = [[f"vertex_{s}_{v}" for v in range(len(masses))] for s in range(geometry.n_strands)]
    for crossing in range(geometry.n_crossings):
        name, vertex = crossing_site(crossing), geometry.crossing_vertex[geometry.crossing_plane[crossing]]
        for strand in geometry.crossing_strands[crossing]:
            names[strand][vertex] = name
        pin = add_vertex(spec, name, geometry.crossings_m[crossing], 2 * masses[vertex] + body.pins.mass_kg)
        pin.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[body.pins.radius_m, 0.0, 0.0],
            mass=0.0,
            contype=0,
            conaffinity=0,
            rgba=PIN_RGBA,
        )
        pin.add_site(name=name, size=[0.002, 0.002, 0.002], group=HIDDEN_GROUP)
        _add_touch(pin, body.strands.radius_m, contact)

    at_crossing = set(geometry.crossing_vertex.tolist())
    for strand, own in enumerate(names):
        for vertex, name in enumerate(own):
            if vertex not in at_crossing:
                point = add_vertex(spec, name, geometry.vertices_m[strand, vertex], masses[vertex])
                _add_touch(point, body.strands.radius_m, contact)
    return names


def add_vertex(spec: mujoco.MjSpec, name: str, position: Array, mass: float) -> mujoco.MjsBody:
    """Adds a point mass on three slides along the world's axes, the form that the Newton solver is fastest on."""
    point = spec.worldbody.add_body(
        name=name,
        pos=position,
        mass=mass,
        ipos=[0.0, 0.0, 0.0],
        iquat=[1.0, 0.0, 0.0, 0.0],
        inertia=[1e-6 * mass] * 3,
        explicitinertial=True,
    )
    for axis in AXES:
        point.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    return point


def _add_touch(point: mujoco.MjsBody, radius_m: float, contact: dict[str, list[float]]) -> None:
    """Lets a vertex touch the floor: one sphere, where a flex would make a contact for each strand of a crossing."""
    point.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
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
    formulation: Rods,
    *,
    rgba: tuple[float, float, float, float] = STRAND_RGBA[0],
    clamped: bool = False,
) -> None:
    """Adds one discrete elastic rod through existing bodies; the rod itself touches nothing.

    Args:
        spec: The spec that holds the bodies.
        name: Name of the flex; the twist hinges are named after it.
        vertices_m: Rest positions, shape ``(n_vertices, 3)``.
        bodies: Body of each vertex, at the vertex's place; "world" fixes the vertex.
        strands: Material.
        formulation: Settings of the inextensible edges.
        rgba: Colour.
        clamped: The first two vertices belong to one body (a cantilever): their edge has no twist hinge.
    """
    lengths = np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    n_edges = len(lengths)
    flex = spec.add_flex(
        name=name,
        dim=1,
        radius=strands.radius_m,
        young=strands.young_modulus_Pa,
        shear=strands.shear_modulus_Pa,
        damping=rayleigh_damping_s(strands, float(lengths.mean())),
        rgba=rgba,
        selfcollide=0,
        contype=0,
        conaffinity=0,
    )
    flex.vertbody = bodies
    fixed = np.array([body == "world" for body in bodies])
    if fixed.any():
        flex.vert = np.where(fixed[:, None], vertices_m, 0.0).ravel()
    flex.elem = np.stack([np.arange(n_edges), np.arange(1, n_edges + 1)], axis=-1).ravel().tolist()
    for edge in range(1 if clamped else 0, n_edges):
        suffix = "" if edge == n_edges - 1 else f"_{edge}"
        inertia = 0.5 * strands.linear_density_kg_per_m * lengths[edge] * strands.radius_m**2
        holder = spec.worldbody.add_body(
            name=f"{name}_twist{suffix}",
            mass=TWIST_MASS_KG,
            ipos=[0.0, 0.0, 0.0],
            iquat=[1.0, 0.0, 0.0, 0.0],
            inertia=[inertia] * 3,
            explicitinertial=True,
        )
        holder.add_joint(name=f"{name}_twist{suffix}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=AXES[0])
    spec.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_FLEX,
        objtype=mujoco.mjtObj.mjOBJ_FLEX,
        name1=name,
        solref=[formulation.edge_time_constant_s, 1.0],
        solimp=EDGE_IMPEDANCE,
    )


def lumped_masses(vertices_m: Array, linear_density_kg_per_m: float) -> Array:
    """Shares each element's mass between its two vertices, kg, shape ``(n_vertices,)``."""
    half = 0.5 * linear_density_kg_per_m * np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    return np.append(half, 0.0) + np.insert(half, 0, 0.0)


def rayleigh_damping_s(strands: Strands, element_length_m: float) -> float:
    """Rayleigh time that gives each joint the wanted viscous damping: damping / (E I / element length), s."""
    bending_stiffness = strands.young_modulus_Pa * pi * strands.radius_m**4 / 4 / element_length_m
    return strands.joint_damping_Nms_per_rad / bending_stiffness

"""The paper's formulation: rigid capsules on damped elastic joints, pinned to one another by constraints.

Each strand is a kinematic tree rooted in its middle, which halves the cost of a step against a root at its end
and changes nothing in the physics. Neighbouring capsules are joined by three hinges that resist bending (E I / length)
and torsion (G J / length). A crossing is a point mass on three slides, tied to its strands by two `connect`
constraints.
"""

from __future__ import annotations

from math import pi
from typing import Any

import mujoco
import numpy as np

from annelid.arena.friction import contact_options
from annelid.body.actuation import crossing_site, mark_crossing
from annelid.body.constraint_rows import add_row
from annelid.body.formulations import densities_kg_per_m, stiffness_shares
from annelid.body.formulations.rods.net import AXES, STRAND_RGBA, add_touch
from annelid.body.mechanics import Mechanics
from annelid.body.mesh import MeshBody, Strands
from annelid.config import ArenaKind
from annelid.morphology import Array, MeshGeometry, norm

SOLVER_ITERATIONS = 500
"""As the authors' model files have it; the tolerance is the engine's default."""


def add_chains(
    spec: mujoco.MjSpec,
    geometry: MeshGeometry,
    body: MeshBody,
    arena: ArenaKind,
    armature_kg_m2: float,
    pin_solver: dict[str, list[float]],
    spheres: bool,
) -> None:
    """Adds the mesh as chains of capsules, which touch by spheres at their vertices if so, and the paper's solver.

    Pins are held by constraints with the ``solref`` and ``solimp`` of ``pin_solver``.
    """
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.solver = mujoco.mjtSolver.mjSOL_PGS
    spec.option.iterations = SOLVER_ITERATIONS
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    # The engine's default and that of the authors' files: weaker by 16 % at 45 degrees to the world's axes.
    spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    n, contact = geometry.n_segments, contact_options(arena)
    material, shares = body.strands.of_segment(0), stiffness_shares(geometry, body.strands)
    density = densities_kg_per_m(geometry, body.strands)
    for strand, vertices_m in enumerate(geometry.vertices_m):
        own = {"density_kg_per_m": density, "shares": shares, "contact": contact, "vertices_touch": spheres}
        rgba = STRAND_RGBA[strand // geometry.n_per_plane]
        add_chain(spec, f"strand_{strand}", vertices_m, material, armature_kg_m2, rgba=rgba, **own)
    pins_kg = geometry.along(body.pins.of_each("mass_kg", n), geometry.plane_x_m)
    for crossing in range(geometry.n_crossings):
        mass_kg = float(pins_kg[geometry.crossing_plane[crossing]])
        _add_pin(spec, geometry, crossing, body.pins.radius_m, mass_kg, pin_solver)


def add_chain(
    spec: mujoco.MjSpec,
    name: str,
    vertices_m: Array,
    strands: Strands,
    armature_kg_m2: float,
    *,
    contact: dict[str, Any] | None = None,
    density_kg_per_m: Array | None = None,
    shares: Array | None = None,
    vertices_touch: bool = False,
    rgba: tuple[float, float, float, float] = STRAND_RGBA[0],
    root: int | None = None,
    fixed_root: bool = False,
) -> None:
    """Adds one chain of capsules; element ``e`` is body ``<name>_<e>`` between vertices ``e`` and ``e + 1``.

    The tree grows from a root element, by default the middle one, which may be welded to the world (a cantilever).
    Without contact attributes the chain touches nothing, else by its capsules, or by spheres at its vertices,
    ``(n_vertices, 3)``. Mass per length of every element,
    ``(n_elements,)``, and shares of the stiffness at every inner vertex, ``(2, n_elements - 1)``, are as of a rod.
    """
    n_elements = len(vertices_m) - 1
    if density_kg_per_m is None:
        density_kg_per_m = np.full(n_elements, strands.one_number("linear_density_kg_per_m"))
    if shares is None:
        shares = np.ones((2, n_elements - 1))
    middle = (len(vertices_m) - 1) // 2 if root is None else root

    def add_element(parent: mujoco.MjsBody, element: int, joint_vertex: int, origin: Array) -> mujoco.MjsBody:
        place = vertices_m[joint_vertex]
        link = parent.add_body(name=f"{name}_{element}", pos=place - origin)
        span = vertices_m[[element, element + 1]] - place
        length = float(np.linalg.norm(span[1] - span[0]))
        link.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=span.ravel(),
            size=[strands.radius_m, 0.0, 0.0],
            mass=density_kg_per_m[element] * length,
            contype=0,
            conaffinity=0 if contact is None or vertices_touch else 1,
            rgba=rgba,
            **(contact if contact is not None and not vertices_touch else {}),
        )
        if contact is not None and vertices_touch:
            own = {element, element + 1} if element == middle else {element, element + 1} - {joint_vertex}
            for vertex in sorted(own):
                add_touch(link, strands.radius_m, contact, vertices_m[vertex] - place)
        return link

    first = add_element(spec.worldbody, middle, middle, np.zeros(3))
    if not fixed_root:
        first.add_freejoint()
    for direction in (1, -1):
        parent, origin = first, vertices_m[middle]
        for element in range(middle + direction, n_elements if direction > 0 else -1, direction):
            joint_vertex = element if direction > 0 else element + 1
            parent = add_element(parent, element, joint_vertex, origin)
            origin = vertices_m[joint_vertex]
            _add_joint(parent, vertices_m, joint_vertex, strands, armature_kg_m2, shares[:, joint_vertex - 1].tolist())


def _add_joint(
    link: mujoco.MjsBody, vertices_m: Array, vertex: int, strands: Strands, armature_kg_m2: float, shares: list[float]
) -> None:
    """Joins two elements at a vertex; the joint stands for half of each, as stiff as the material times its shares."""
    before, after = vertices_m[vertex] - vertices_m[vertex - 1], vertices_m[vertex + 1] - vertices_m[vertex]
    length = 0.5 * float(np.linalg.norm(before) + np.linalg.norm(after))
    bending = strands.bending_rigidity_Nm2 * shares[0]
    torsion = strands.one_number("shear_modulus_Pa") * pi * strands.radius_m**4 / 2 * shares[1]
    tangent = before / np.linalg.norm(before) + after / np.linalg.norm(after)
    tangent /= np.linalg.norm(tangent)
    normal = np.cross(tangent, AXES[np.argmin(np.abs(tangent))])
    normal /= np.linalg.norm(normal)
    for axis, rate in ((normal, bending), (np.cross(tangent, normal), bending), (tangent, torsion)):
        stiffness = rate / length
        link.add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE,
            stiffness=[stiffness, 0.0, 0.0],
            damping=[strands.damping_time_s * stiffness, 0.0, 0.0],
            armature=armature_kg_m2,
            axis=axis,
        )


def _add_pin(
    spec: mujoco.MjSpec,
    geometry: MeshGeometry,
    crossing: int,
    radius_m: float,
    mass_kg: float,
    solver: dict[str, list[float]],
) -> None:
    name = crossing_site(crossing)
    vertex = int(geometry.crossing_vertex[geometry.crossing_plane[crossing]])
    links = [spec.body(f"strand_{strand}_{vertex}") for strand in geometry.crossing_strands[crossing]]
    pin = spec.worldbody.add_body(name=name, pos=geometry.crossings_m[crossing])
    for axis in AXES:
        pin.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    mark_crossing(pin, name, radius_m, mass_kg)
    connect, bodies = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_BODY
    for k, link in enumerate(links):
        add_row(spec, connect, bodies, f"pin_{crossing}_{k}", name, link.name, data=[0.0] * 12, **solver)


class ChainMechanics(Mechanics):
    """The engine's own step, and how far the connections of a crossing have given way."""

    def pin_gap_m(self) -> Array:
        """Returns the largest residual of two connections that make one crossing, m, ``()``."""
        model, turn = self.model, self.data.xmat.reshape(-1, 3, 3)
        first, second = (
            self.data.xpos[body] + (turn[body] * local[:, np.newaxis]).sum(axis=-1)
            for body, local in ((model.eq_obj1id, model.eq_data[:, :3]), (model.eq_obj2id, model.eq_data[:, 3:6]))
        )
        residual = first - second
        return norm(residual[0::2] - residual[1::2]).max()

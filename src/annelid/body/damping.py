"""Out-of-plane bending damping of rods: the half that the engine lacks, across the plane in which a vertex is bent.

The engine damps the rate of a vertex' curvature ``2 tan(h)``, where h is half the angle between its two edges, but not
the rate at which the plane of the bend turns in the material. With the edges' directions t0 and t1, lengths l0 and l1,
rates e0' and e1', and b the unit vector across the bend, the curvature moves sideways in the material frame of the rear
edge, whose twist hinge turns at the rate w1, by

    (cos(2h) b . e1' / l1 - b . e0' / l0) / cos(h)^2 - 2 tan(h) w1

and in that of the front edge by the same with the cosine at e0' and with w0. Either is zero in every rigid rotation.
The elastic energy takes the mean over both frames; the damping takes one of them for each vertex, that of every second
edge for the vertices at its two ends, since rows with two hinges take an eighth of a step longer. Times the material's
time and its bending stiffness, it makes bending alike in all directions (Kelvin-Voigt).
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from annelid.body.worm import Strands
from annelid.morphology import Array

AXES = "xyz"
HELD = "damper_reference"
HELD_MASS_KG = 1e-9
_DAMPER = "_damper_"
STRAIGHT = 1e-9
"""Sine of the bend below which a vertex is straight; there the engine itself damps every direction."""


def damper_name(rod: str, vertex: int) -> str:
    """Name of the tendon that damps a vertex of a rod."""
    return f"{rod}{_DAMPER}{vertex}"


def twist_name(rod: str, edge: int, n_edges: int) -> str:
    """Name of the twist hinge of an edge, by which the engine finds it."""
    return f"{rod}_twist" if edge == n_edges - 1 else f"{rod}_twist_{edge}"


def damper_coefficients(lengths_m: Array, strands: Strands, time_s: float) -> Array:
    """Torque per rate at every inner vertex, N m s, ``(..., n_edges - 1)``.

    Args:
        lengths_m: Rest lengths of the edges, m, ``(..., n_edges)``.
        strands: Material.
        time_s: Its Kelvin-Voigt time, s.
    """
    return 2.0 * time_s * strands.bending_rigidity_Nm2 / (lengths_m[..., :-1] + lengths_m[..., 1:])


def damper_rows(vertices_m: Array) -> Array:
    """How the sideways rate of curvature follows from the rates of three vertices and a hinge.

    Args:
        vertices_m: Positions along a rod, m, ``(3, ..., n_vertices)``.

    Returns:
        Coefficients of x, y, z of the vertex in front, of the vertex, of the one behind, 1/m, and of the hinge,
        ``(10, ..., n_vertices - 2)``; zero where the rod is straight.
    """
    edge = vertices_m[..., 1:] - vertices_m[..., :-1]
    per_length = 1.0 / np.sqrt((edge * edge).sum(axis=0))
    tangent = edge * per_length
    t0, t1 = tangent[..., :-1], tangent[..., 1:]
    across = t0[[1, 2, 0]] * t1[[2, 0, 1]] - t0[[2, 0, 1]] * t1[[1, 2, 0]]
    sine, cosine = np.sqrt((across * across).sum(axis=0)), (t0 * t1).sum(axis=0)
    per_cosine = 2.0 / (1.0 + cosine)
    b = across * (per_cosine * (sine > STRAIGHT) / np.maximum(sine, STRAIGHT))
    in_rear = _takes_rear_edge(np.arange(1, sine.shape[-1] + 1))
    front = b * (per_length[..., :-1] * np.where(in_rear, 1.0, cosine))
    rear = b * (per_length[..., 1:] * np.where(in_rear, cosine, 1.0))
    return np.concatenate([front, -front - rear, rear, -(sine * per_cosine)[None]])


def hinge_of(vertex: int) -> int:
    """Edge in whose frame a vertex is damped: the second, fourth, sixth of the rod, for the vertices at its ends."""
    return vertex if _takes_rear_edge(vertex) else vertex - 1


def _takes_rear_edge(vertex: Any) -> Any:
    """Tells of one vertex or of many whether they are damped in the frame of the edge behind."""
    return vertex % 2 == 1


def add_held_coordinate(spec: mujoco.MjSpec) -> None:
    """Adds, once, the coordinate that `annelid.simulation.damping` moves: to every model, so that all have as many."""
    if spec.body(HELD) is None:
        held = add_holder(spec, HELD, HELD_MASS_KG, HELD_MASS_KG)
        held.gravcomp = 1.0
        held.add_joint(name=HELD, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])


def add_dampers(
    spec: mujoco.MjSpec, rod: str, vertices_m: Array, bodies: list[str], strands: Strands, *, clamped: bool
) -> None:
    """Adds a fixed tendon for every inner vertex of a rod, with the coefficients of the posture at rest.

    Args:
        spec: The spec that holds the rod.
        rod: Its name.
        vertices_m: Rest positions, m, ``(n_vertices, 3)``.
        bodies: Body of each vertex, "world" where it is fixed.
        strands: Material.
        clamped: The first edge has no twist hinge.
    """
    assert strands.material_damping_s is not None
    lengths = np.linalg.norm(np.diff(vertices_m, axis=0), axis=1)
    damping = damper_coefficients(lengths, strands, strands.material_damping_s)
    rows = damper_rows(vertices_m.T)
    clamped_hinge = twist_name(rod, 0, len(lengths)) if clamped else ""
    for vertex in range(1, len(bodies) - 1):
        joints = [f"{body}_{axis}" for body in bodies[vertex - 1 : vertex + 2] for axis in AXES]
        joints.append(twist_name(rod, hinge_of(vertex), len(lengths)))
        tendon = spec.add_tendon(name=damper_name(rod, vertex), damping=[damping[vertex - 1], 0.0, 0.0])
        for joint, coefficient in zip(joints, rows[:, vertex - 1].tolist(), strict=True):
            if not joint.startswith("world_") and joint != clamped_hinge:
                tendon.wrap_joint(joint, coefficient)


def is_damper(tendon: mujoco.MjsTendon) -> bool:
    """Tells whether a tendon damps a strand."""
    return _DAMPER in tendon.name


def add_holder(spec: mujoco.MjSpec, name: str, mass_kg: float, inertia_kg_m2: float) -> mujoco.MjsBody:
    """Adds a body of the world that is there for the sake of its joint."""
    return spec.worldbody.add_body(
        name=name,
        mass=mass_kg,
        ipos=[0.0, 0.0, 0.0],
        iquat=[1.0, 0.0, 0.0, 0.0],
        inertia=[inertia_kg_m2] * 3,
        explicitinertial=True,
    )

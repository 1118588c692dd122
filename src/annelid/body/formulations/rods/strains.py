"""The elements of a rod: how it is bent and twisted at its vertices, and the rows by which the engine resists that.

Each edge carries a tangent t and a material director m across it, which turns with the edge as little as it can, and by
the edge's hinge about t. At a vertex between edges 0 and 1 with rest lengths l0 and l1, h is half the angle between the
tangents and b the unit vector across both. Bending is the complex number ``z = 2 tan(h) exp(i a)``, where a is the
direction of b in the material, the mean of what the two edges see; twist f is the angle from the director of edge 0,
turned on to edge 1, to that of edge 1. The rod stores (Bergou et al. 2008, "Discrete elastic rods"; Bergou et al. 2010)

    E I / (l0 + l1) |z - z0|^2  +  G J / (l0 + l1) (f - f0)^2

and dissipates the squares of its rates, times twice the material's time (Kelvin-Voigt). With the rate n of an edge over
its length and that of its hinge w, the rates of bending, of bending sideways and of twist are exactly

    (1 + tan(h)^2) ((b x t1) . n1 - (b x t0) . n0)
    b . (n1 - n0) - tan(h) (w0 + w1)
    w1 - w0 + tan(h) b . (n0 + n1)

They are zero in every rigid rotation. Each is a row of `annelid.body.constraint_rows`: the engine solves bending, twist
and what they do to one another at the end of a step, with the coefficients of one posture. The engine's own rods have
no matrix elements between vertices and hinges, so that their steps are of first order, and damp in the plane of a bend
only.
"""

from __future__ import annotations

from math import pi

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.body.constraint_rows import complete_rows, row_name, row_tendon
from annelid.body.formulations import stiffness_shares
from annelid.body.mesh import Strands
from annelid.morphology import Array, MeshGeometry, cross

MODES = ("bend", "side", "twist")
"""Of a vertex: along its bend, across it, and about the rod."""
STRAIGHT = 1e-9
"""Twice the tangent of half a bend below which its direction means nothing."""
N_COEFFICIENTS = 11
"""Of a row: x, y, z of the vertex in front, of the vertex and of the one behind, and the hinges of both edges."""


def twist_name(rod: str, edge: int, n_edges: int) -> str:
    """Name of the twist hinge of an edge, by which the engine finds it in a model without rows."""
    return f"{rod}_twist" if edge == n_edges - 1 else f"{rod}_twist_{edge}"


def twist_names(rod: str, n_edges: int) -> list[str]:
    """Names of the twist hinges of a rod, edge by edge."""
    return [twist_name(rod, edge, n_edges) for edge in range(n_edges)]


def strain_name(rod: str, vertex: int, mode: str) -> str:
    """Name of the tendon, and of the row, of one mode of a vertex."""
    return f"{rod}_{vertex}_{mode}"


def vertex_stiffness(lengths_m: Array, strands: Strands, shares: Array) -> Array:
    """Returns the stiffness of the modes at a rod's inner vertices, ``2 E I / (l0 + l1)`` and ``2 G J / (l0 + l1)``.

    Args:
        lengths_m: Of its edges at rest, ``(.., n_edges)``.
        strands: Material of one segment.
        shares: What it is multiplied by in bending and in twist, ``(2, .., n_edges - 1)``.

    Returns:
        N m, ``(3, .., n_edges - 1)`` in the order of `MODES`.
    """
    per_length = 2.0 / (lengths_m[..., :-1] + lengths_m[..., 1:])
    torsion = strands.one_number("shear_modulus_Pa") * pi * strands.radius_m**4 / 2
    bend = strands.bending_rigidity_Nm2 * per_length * shares[0]
    return np.stack([bend, bend, torsion * per_length * shares[1]])


def net_stiffness(geometry: MeshGeometry, strands: Strands) -> Array:
    """Returns the stiffness of every mode at the inner vertices of a mesh, N m, ``(3, n_strands, n_vertices - 2)``.

    Curvature is linear from crossing to crossing, as forces at crossings bend a strand. By how much a force at one of
    them moves another is, of a beam, the integral of a product of two bending moments over the rigidity, and of a rod a
    sum over its vertices. Between crossings the product is a quadratic, and the sum is the integral if compliances are
    weighted as in Simpson's rules: with n elements a side by n / (n + 1) at a crossing and by n^2 / (n^2 - 1) between.
    With equal compliances, moments that change their sign from crossing to crossing bend a rod of two elements 1.5
    times too far. The same holds for twist. Free ends, which nothing bends, have the stiffness of the material.
    """
    crossing = geometry.crossing_vertex
    n = int(crossing[1] - crossing[0])
    weights = np.ones(geometry.vertices_m.shape[1])
    if n > 1:
        weights[crossing[0] + 1 : crossing[-1]] = 1.0 - 1.0 / n**2
        weights[crossing[1:-1]] = 1.0 + 1.0 / n
    lengths = np.linalg.norm(np.diff(geometry.vertices_m, axis=1), axis=-1)
    return vertex_stiffness(
        lengths, strands.of_segment(0), stiffness_shares(geometry, strands)[:, np.newaxis] * weights[1:-1]
    )


def add_strains(spec: mujoco.MjSpec, rod: str, bodies: list[str], stiffness_Nm: Array, damping_s: float) -> None:
    """Adds the rows of a rod through bodies on slides, whose edges have hinges, to be completed by `RodStrains`.

    Args:
        spec: The spec that has the bodies and the hinges.
        rod: Name of the rod.
        bodies: Body of each vertex, ``n_vertices`` of them.
        stiffness_Nm: As `vertex_stiffness` returns it, ``(3, n_vertices - 2)``.
        damping_s: Kelvin-Voigt time of the material, s.
    """
    n_edges = len(bodies) - 1
    for vertex in range(1, n_edges):
        for mode, stiffness in zip(MODES, stiffness_Nm[:, vertex - 1].tolist(), strict=True):
            name = strain_name(rod, vertex, mode)
            tendon = row_tendon(spec, name, stiffness, damping_s * stiffness)
            for body in bodies[vertex - 1 : vertex + 2]:
                for axis in "xyz":
                    tendon.wrap_joint(f"{body}_{axis}", 1.0)
            for edge in (vertex - 1, vertex):
                tendon.wrap_joint(twist_name(rod, edge, n_edges), 1.0)


class RodVertices:
    """Where the vertices of a compiled net of rods are, each on three slides along the world's axes.

    All rods have as many edges.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Finds the slides."""
        bodies = model.flex_vertbodyid.reshape(model.nflex, -1)
        slide = model.body_jntadr[bodies] + np.arange(3)[:, None, None]
        # numpy would convert other integers at every step.
        self._slide = model.jnt_qposadr[slide].astype(np.intp)
        self._place = model.body_pos[bodies].transpose(2, 0, 1).copy()

    def edges(self, qpos: Array) -> Array:
        """Returns from each vertex of a posture, ``(nq,)``, to the next, m, ``(3, n_rods, n_edges)``."""
        place = self._place + qpos.take(self._slide)
        return place[..., 1:] - place[..., :-1]


class RodStrains:
    """The strains of all rods of one worm, whose model has the rows of `add_strains`.

    The rows' coefficients live in the compiled model, which no other worm may use. Arrays of edges are ``(3, n_rods,
    n_edges)``, those of modes and vertices ``(n_rods, n_edges - 1, 3)``.

    Attributes:
        director: The edges' material directors, at the posture last followed.
    """

    def __init__(self, model: mujoco.MjModel, stiffness_Nm: Array, damping_s: float) -> None:
        """Finds the rows of a compiled model, which is at rest, and completes them.

        Args:
            model: The compiled model, with rods ``strand_0``, ``strand_1`` and so on.
            stiffness_Nm: As `net_stiffness` returns it, ``(3, n_rods, n_vertices - 2)``.
            damping_s: Kelvin-Voigt time of the material, s.
        """
        self._vertices = RodVertices(model)
        n_edges = int(model.flex_edgenum[0])
        rods = [f"strand_{rod}" for rod in range(model.nflex)]
        hinges = [[model.joint(name).id for name in twist_names(rod, n_edges)] for rod in rods]
        self._hinge = model.jnt_qposadr[np.array(hinges)].astype(np.intp)
        names = [[[strain_name(rod, v, mode) for mode in MODES] for v in range(1, n_edges)] for rod in rods]
        self._stiffness = np.ascontiguousarray(np.moveaxis(stiffness_Nm, 0, -1))
        self._damping = damping_s * self._stiffness
        tendons = np.array([[[model.tendon(row_name(name)).id for name in at] for at in rod] for rod in names])
        complete_rows(model, tendons, self._damping + model.opt.timestep * self._stiffness)
        # The coefficients lie one after another, each row's with that of the held coordinate at its end.
        first, per_row = int(model.tendon_adr[tendons[0, 0, 0]]), N_COEFFICIENTS + 1
        last = first + per_row * tendons.size
        assert np.array_equal(model.tendon_adr[tendons].ravel(), np.arange(first, last, per_row))
        self._rows = model.wrap_prm[first:last].reshape(*tendons.shape, per_row)[..., :N_COEFFICIENTS]
        self._equality = np.array(
            [[[model.equality(row_name(name)).id for name in at] for at in rod] for rod in names]
        ).ravel()
        self._at_rest = self._lie_straight(model.qpos0)
        self.place(model.qpos0, np.eye(3))
        self._bend_at_rest, self._twist_at_rest, _ = self._bent(self._tangent, self.director)

    def _lie_straight(self, qpos: Array) -> tuple[Array, Array]:
        """Tangents of a posture, and directors that do not twist along the rods."""
        edge = self._vertices.edges(qpos)
        tangent = edge / np.sqrt((edge * edge).sum(axis=0))
        director = np.empty_like(tangent)
        director[..., 0] = _across(tangent[..., 0])
        for number in range(1, tangent.shape[-1]):
            director[..., number] = _turned(director[..., number - 1], tangent[..., number - 1], tangent[..., number])
        return tangent, director

    def place(self, qpos: Array, turn: Array) -> None:
        """Lets the rods be in the posture at rest, turned as a whole by a rotation matrix, ``(3, 3)``."""
        self._tangent, self.director = (np.tensordot(turn, axes, axes=1) for axes in self._at_rest)
        self._angle = qpos[self._hinge]

    def restore(self, qpos: Array, director: Array) -> None:
        """Lets the rods be in a posture, ``(nq,)``, with the directors that they had in it."""
        edge = self._vertices.edges(qpos)
        self._tangent = edge / np.sqrt((edge * edge).sum(axis=0))
        self.director, self._angle = director.copy(), qpos[self._hinge]

    def follow(self, qpos: Array) -> None:
        """Takes the directors along to the posture at the end of a step, ``(nq,)``."""
        self._tangent, director, _ = self._carried(qpos)
        self.director, self._angle = director / np.sqrt((director * director).sum(axis=0)), qpos[self._hinge]

    def renew(self, qpos: Array) -> Array:
        """Sets the rows for a posture, ``(nq,)``, and returns the strains there, beyond those at rest."""
        tangent, director, lengths = self._carried(qpos)
        bend, twist, curvature = self._bent(tangent, director)
        size = np.abs(bend)
        tangent_of_half = 0.5 * size
        front, rear = tangent[..., :-1], tangent[..., 1:]
        # Where a rod is straight all directions across it serve alike: the director's is 1 in its own frame.
        straight = size < STRAIGHT
        size = np.where(straight, 1.0, size)
        direction = np.where(straight, np.exp(-0.5j * twist), bend / size)
        b = np.where(straight, director[..., :-1], curvature / size)
        per_front, per_rear = 1.0 / lengths[..., :-1], 1.0 / lengths[..., 1:]
        square = 1.0 + tangent_of_half * tangent_of_half
        rows = self._rows
        zero = np.zeros_like(size)
        for mode, (of_front, of_rear, hinge_front, hinge_rear) in enumerate(
            (
                (cross(b, front) * -square, cross(b, rear) * square, zero, zero),
                (-b, b, -tangent_of_half, -tangent_of_half),
                (tangent_of_half * b, tangent_of_half * b, zero - 1.0, zero + 1.0),
            )
        ):
            of_front, of_rear = of_front * per_front, of_rear * per_rear
            row = rows[..., mode, :]
            row[..., 0:3] = (-of_front).transpose(1, 2, 0)
            row[..., 3:6] = (of_front - of_rear).transpose(1, 2, 0)
            row[..., 6:9] = of_rear.transpose(1, 2, 0)
            row[..., 9], row[..., 10] = hinge_front, hinge_rear
        beyond = (bend - self._bend_at_rest) * direction.conj()
        return np.stack([beyond.real, beyond.imag, twist - self._twist_at_rest], axis=-1)

    def energy_J(self) -> float:
        """What the rods store in the posture last followed, J."""
        bend, twist, _ = self._bent(self._tangent, self.director)
        bend, twist = bend - self._bend_at_rest, twist - self._twist_at_rest
        squares = self._stiffness[..., 0] * (bend.real**2 + bend.imag**2) + self._stiffness[..., 2] * twist**2
        return 0.5 * float(squares.sum())

    def loss_W(self, rate: Array) -> float:
        """Power that the material takes, W, from the rates of the rows in the order of their numbers."""
        return float(self._damping.ravel() @ (rate * rate))

    def rows_of(self, data: mujoco.MjData) -> NDArray[np.intp]:
        """Returns the numbers of the rows among the engine's constraints, which are always the same."""
        number = np.full(self._equality.max() + 1, -1, dtype=np.intp)
        equality = data.efc_id[: data.ne]
        known = equality < len(number)
        number[equality[known]] = np.flatnonzero(known)
        return number[self._equality]

    def _carried(self, qpos: Array) -> tuple[Array, Array, Array]:
        """Tangents and directors in a posture, and lengths of the edges, m, ``(n_rods, n_edges)``."""
        edge = self._vertices.edges(qpos)
        lengths = np.sqrt((edge * edge).sum(axis=0))
        tangent = edge / lengths
        director = _turned(self.director, self._tangent, tangent)
        angle = qpos[self._hinge] - self._angle
        return tangent, director * np.cos(angle) + cross(tangent, director) * np.sin(angle), lengths

    def _bent(self, tangent: Array, director: Array) -> tuple[NDArray[np.complex128], Array, Array]:
        """Bending and twist at the vertices, ``(n_rods, n_edges - 1)``, and the vector of curvature, ``(3, ..)``."""
        front, rear, own, other = tangent[..., :-1], tangent[..., 1:], director[..., :-1], director[..., 1:]
        curvature = cross(front, rear) * (2.0 / (1.0 + (front * rear).sum(axis=0)))
        carried = _turned(own, front, rear)
        twist = np.arctan2((cross(carried, other) * rear).sum(axis=0), (carried * other).sum(axis=0))
        seen = (own * curvature).sum(axis=0) + 1j * (cross(front, own) * curvature).sum(axis=0)
        bend: NDArray[np.complex128] = seen * np.exp(-0.5j * twist)
        return bend, twist, curvature


def _across(tangent: Array) -> Array:
    """A unit vector across each of some unit vectors, ``(3, ..)``."""
    axis = np.where(np.abs(tangent[0]) < 0.9, 1.0, 0.0)
    vector = np.stack([axis, 1.0 - axis, 0.0 * axis])
    vector = vector - tangent * (tangent * vector).sum(axis=0)
    return vector / np.sqrt((vector * vector).sum(axis=0))


def _turned(vector: Array, before: Array, after: Array) -> Array:
    """What is across a unit vector, ``(3, ..)``, after the least turn that takes that to another."""
    return vector - (before + after) * ((vector * after).sum(axis=0) / (1.0 + (before * after).sum(axis=0)))

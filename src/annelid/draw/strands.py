"""The strands of a worm as the curves that they are, whatever the number of their elements.

Between two crossings only the forces there bend a strand. So its curvature is linear, and it is the cubic that passes
through both crossings in the directions of the strand. At a vertex these halve the angle between its edges, as in
`annelid.body.formulations.rods.strains.net_stiffness`. The vertices in between carry more than their share of the bend.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.morphology import Array, MeshGeometry

POINTS_PER_SIDE = 4
"""Of a curve from one crossing to the next: point ``POINTS_PER_SIDE * (p + 1)`` is the crossing of plane ``p``."""
SIDES = 8
"""Of the prism that is drawn as a tube."""


def strand_curves(vertices_m: Array, geometry: MeshGeometry) -> tuple[Array, Array]:
    """Returns points of the strands' curves, m, and unit vectors along them.

    Args:
        vertices_m: The strands' vertices in a posture, ``(n_strands, n_vertices, 3)``.
        geometry: The mesh.

    Returns:
        Both ``(n_strands, n_points, 3)``, from front to rear, with `POINTS_PER_SIDE` points from crossing to crossing.
    """
    edge = np.diff(vertices_m, axis=1)
    length = np.linalg.norm(edge, axis=-1, keepdims=True)
    edge /= length
    along = np.empty_like(vertices_m)
    along[:, 1:-1] = _unit(edge[:, :-1] * length[:, 1:] + edge[:, 1:] * length[:, :-1])
    # Nothing bends a free end: its last edge is the chord of an arc.
    for end, inner in ((0, 1), (-1, -2)):
        along[:, end] = 2.0 * (along[:, inner] * edge[:, end]).sum(-1, keepdims=True) * edge[:, end] - along[:, inner]
    knots = np.concatenate([[0], geometry.crossing_vertex, [vertices_m.shape[1] - 1]])
    run = np.add.reduceat(length, knots[:-1], axis=1)[:, :, None]
    here, there = vertices_m[:, knots[:-1], None], vertices_m[:, knots[1:], None]
    begins, ends = run * along[:, knots[:-1], None], run * along[:, knots[1:], None]
    u = (np.arange(POINTS_PER_SIDE) / POINTS_PER_SIDE)[:, None]
    points = here + (there - here) * u * u * (3.0 - 2.0 * u) + u * (1.0 - u) * (begins * (1.0 - u) - ends * u)
    slopes = (there - here) * 6.0 * u * (1.0 - u)
    slopes += begins * (1.0 - u) * (1.0 - 3.0 * u) + ends * u * (3.0 * u - 2.0)
    return (
        np.concatenate([points.reshape(len(points), -1, 3), vertices_m[:, -1:]], axis=1),
        np.concatenate([_unit(slopes).reshape(len(points), -1, 3), along[:, -1:]], axis=1),
    )


class StrandBodies:
    """The engine's bodies that carry the strands' vertices.

    Attributes:
        ids: Body of each vertex, strand by strand: its own for rods, the element behind it for a chain.
    """

    def __init__(self, model: mujoco.MjModel, geometry: MeshGeometry) -> None:
        self._geometry = geometry
        n_strands, n_vertices, _ = geometry.vertices_m.shape
        names = [f"strand_{strand}" for strand in range(n_strands)]
        if model.nflex:
            flexes = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, name) for name in names]
            vertex = model.flex_vertadr[flexes][:, None] + np.arange(n_vertices)
            self.ids: NDArray[np.int32] = model.flex_vertbodyid[vertex.ravel()]
        else:
            elements = np.minimum(np.arange(n_vertices), n_vertices - 2)
            self.ids = np.array([model.body(f"{name}_{e}").id for name in names for e in elements], dtype=np.int32)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        # At rest the axes of all bodies are the world's.
        self._place = geometry.vertices_m.reshape(-1, 3) - data.xpos[self.ids]

    def curves(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Returns the strands of a located posture, as `strand_curves`."""
        turn = data.xmat[self.ids].reshape(-1, 3, 3)
        vertices = data.xpos[self.ids] + np.einsum("vij,vj->vi", turn, self._place)
        return strand_curves(vertices.reshape(self._geometry.vertices_m.shape), self._geometry)


def tubes(points_m: Array, along: Array, radius_m: float) -> tuple[Array, Array]:
    """Returns vertices, m, and normals of closed tubes about curves, as `tube_faces` joins them.

    Args:
        points_m: As `strand_curves` returns them.
        along: As `strand_curves` returns them.
        radius_m: Of the tubes.

    Returns:
        Both ``(n_strands, n_points + 2, SIDES, 3)``.
    """
    across = np.empty_like(along)
    # Each across direction is the one before it, turned with the curve as little as it can.
    before = np.eye(3)[np.abs(along[:, 0]).argmin(axis=-1)]
    for point in range(along.shape[1]):
        ahead = along[:, point]
        across[:, point] = before = _unit(before - (before * ahead).sum(-1, keepdims=True) * ahead)
    angle = 2.0 * np.pi * np.arange(SIDES)[:, None] / SIDES
    normals = across[:, :, None] * np.cos(angle) + np.cross(along, across)[:, :, None] * np.sin(angle)
    ends = ((0, 0), (1, 1), (0, 0), (0, 0))
    vertices = np.pad(radius_m * normals, ends) + np.pad(points_m[:, :, None], ends, mode="edge")
    return vertices, np.pad(normals, ends, mode="edge")


def tube_faces(n_strands: int, n_points: int) -> NDArray[np.int64]:
    """Returns the triangles of the vertices of `tubes`, seen from outside, ``(n_faces, 3)``."""
    number = np.arange(n_strands * (n_points + 2) * SIDES).reshape(n_strands, n_points + 2, SIDES)
    a, b = number[:, :-1], number[:, 1:]
    c, d = np.roll(b, -1, axis=-1), np.roll(a, -1, axis=-1)
    return np.stack([a, c, b, a, d, c], axis=-1).reshape(-1, 3)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

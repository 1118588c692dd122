"""Where strands and crossings of a 3D worm are in a recorded or present posture."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.morphology import Array
from annelid.simulation.anatomy import Anatomy


class Skeleton:
    """The moving points of one compiled worm, found from generalised positions, with an engine state of its own."""

    def __init__(self, anatomy: Anatomy) -> None:
        """Finds every vertex's body and its place on it, whatever the formulation.

        Args:
            anatomy: The compiled worm, which is only read.
        """
        self.anatomy = anatomy
        self._data = mujoco.MjData(anatomy.model)
        mujoco.mj_kinematics(anatomy.model, self._data)
        vertices = anatomy.geometry.vertices_m
        self._shape = vertices.shape
        points = vertices.reshape(-1, 3)
        self._body = _bodies_of_vertices(anatomy.model, vertices.shape[0], vertices.shape[1])
        # At rest the axes of all bodies are the world's.
        self._place = points - self._data.xpos[self._body]

    def locate(self, qpos: NDArray[np.floating]) -> tuple[Array, Array]:
        """Finds the points of a posture.

        Args:
            qpos: Generalised positions, ``(nq,)``.

        Returns:
            Vertices of the strands from front to rear, m, ``(n_strands, n_vertices, 3)``, and crossings,
            ``(n_crossings, 3)``.
        """
        self._data.qpos[:] = qpos
        crossing, _, _ = self.anatomy.locate(self._data)
        turn = self._data.xmat[self._body].reshape(-1, 3, 3)
        vertices = self._data.xpos[self._body] + np.einsum("vij,vj->vi", turn, self._place)
        return vertices.reshape(self._shape), crossing


def _bodies_of_vertices(model: mujoco.MjModel, n_strands: int, n_vertices: int) -> NDArray[np.int64]:
    """Body that carries each vertex, strand by strand: its own for rods, the element behind it for a chain."""
    if model.nflex:
        of_strand = []
        for strand in range(n_strands):
            flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, f"strand_{strand}")
            first, count = model.flex_vertadr[flex], model.flex_vertnum[flex]
            of_strand.append(model.flex_vertbodyid[first : first + count])
        return np.concatenate(of_strand).astype(np.int64)
    elements = np.minimum(np.arange(n_vertices), n_vertices - 2)
    return np.array([model.body(f"strand_{strand}_{e}").id for strand in range(n_strands) for e in elements])

"""The geoms of a scene as triangles in a viewer, which follow the engine's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from annelid.arena.surface import Shape, grid_faces
from annelid.morphology import Array

if TYPE_CHECKING:
    import viser

GROUPS_SEEN = 3
"""Geoms of a higher group the engine's viewers do not show either."""


class SceneGeoms:
    """The geoms of a compiled scene that are drawn, below a node of the viewer; none where there is no scene."""

    def __init__(
        self, scene: viser.SceneApi, root: str, model: mujoco.MjModel, floor: Shape, look: dict[str, Any], prefix: str
    ) -> None:
        """Adds a node for each whose name has a prefix; a plane, which has no end, is a floor of its own look."""
        own_names = [model.geom(i).name.startswith(prefix) for i in range(model.ngeom)]
        seen = np.array(own_names) & (model.geom_group < GROUPS_SEEN)
        self.geoms = np.flatnonzero(seen & (model.geom_rgba[:, 3] > 0.0))
        plane = int(mujoco.mjtGeom.mjGEOM_PLANE)
        self._nodes: list[Any] = []
        for geom in self.geoms.tolist():
            shape, own = floor, look
            if model.geom_type[geom] != plane:
                material = int(model.geom_matid[geom])
                *color, opacity = (model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]).tolist()
                shape, own = triangles(model, geom), {"color": tuple(color), "side": "double"}
                own |= {} if opacity >= 1.0 else {"opacity": opacity}
            self._nodes.append(scene.add_mesh_simple(f"{root}/{geom}", shape.vertices_m, shape.faces, **own))

    def place(self, places_m: Array, turns: Array) -> None:
        """Places the geoms: centres, m, ``(n_geoms, 3)``, and quaternions, ``(n_geoms, 4)``; those that moved."""
        for node, place, turn in zip(self._nodes, places_m, turns, strict=True):
            if not (np.array_equal(node.position, place) and np.array_equal(node.wxyz, turn)):
                node.position, node.wxyz = place, turn


def triangles(model: mujoco.MjModel, geom: int) -> Shape:
    """Returns the shape of a geom that has an end, in its own axes."""
    from trimesh import creation

    kinds, kind, size = mujoco.mjtGeom, int(model.geom_type[geom]), model.geom_size[geom]
    data = int(model.geom_dataid[geom])
    if kind == int(kinds.mjGEOM_MESH):
        first, count = int(model.mesh_vertadr[data]), int(model.mesh_vertnum[data])
        start, n_faces = int(model.mesh_faceadr[data]), int(model.mesh_facenum[data])
        return Shape(model.mesh_vert[first : first + count].astype(float), model.mesh_face[start : start + n_faces])
    if kind == int(kinds.mjGEOM_HFIELD):
        rows, columns, start = int(model.hfield_nrow[data]), int(model.hfield_ncol[data]), int(model.hfield_adr[data])
        half_x, half_y, high, _ = model.hfield_size[data].tolist()
        x, y = np.meshgrid(np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows))
        z = high * model.hfield_data[start : start + rows * columns].reshape(rows, columns)
        return Shape(np.stack([x, y, z], axis=-1).reshape(-1, 3), grid_faces(rows, columns)[:, ::-1])
    if kind == int(kinds.mjGEOM_BOX):
        made = creation.box(extents=2.0 * size)
    elif kind == int(kinds.mjGEOM_CYLINDER):
        made = creation.cylinder(radius=size[0], height=2.0 * size[1])
    elif kind == int(kinds.mjGEOM_CAPSULE):
        made = creation.capsule(radius=size[0], height=2.0 * size[1])
        made.apply_translation([0.0, 0.0, -float(made.bounds.mean(axis=0)[2])])
    else:
        made = creation.icosphere(subdivisions=3)
        made.apply_scale(size if kind == int(kinds.mjGEOM_ELLIPSOID) else size[0])
    return Shape(np.asarray(made.vertices, dtype=float), np.asarray(made.faces, dtype=np.int32))

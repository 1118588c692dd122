"""The 3D scene of a view: a few nodes that are made once and whose points are then moved."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.arena.geoms import (
    FLOOR_HALF_SIZE_M,
    PIPE_RGBA,
    POST_HALF_HEIGHT_M,
    POST_RGBA,
    RAIL_HALF_HEIGHT_M,
    RAIL_RGBA,
)
from annelid.arena.surface import Shape
from annelid.config import RunConfig
from annelid.config.run import ArenaKind
from annelid.draw.camera import FIELD_OF_VIEW_DEG, fitting_distance, picture_axes, view_angles
from annelid.draw.drawn_worm import upright
from annelid.draw.scene import ROOM
from annelid.live.history import Moment
from annelid.live.lines_and_arrows import CONTACT_COLOR, PlanarPainter
from annelid.live.player import AnyPainter
from annelid.live.scene_geoms import SceneGeoms
from annelid.morphology import Array

if TYPE_CHECKING:
    import viser

ASPECT = 1.0  # of the canvas beside the panel, for which the camera is placed
STRAND_PIXELS, RING_PIXELS, SPRING_PIXELS = 3.0, 6.0, 3.5
"""Widths of lines; lines that grow thinner with distance take twice as long to draw without a graphics card."""
LAYERS = ("strands", "rings", "springs", "contacts", "ground")  # what can be shown or hidden, by the names of the nodes
FLOOR_X_M, FLOOR_HALF_WIDTH_M = (-8.0, 2.0), 3.0
"""What is drawn of the floor, for a worm that leads towards -x; it turns with the heading at the start."""
SQUARE_M = 0.2
SQUARE_COLOR = (0.80, 0.83, 0.86)
STRIP_M = 0.003
RELIEF_LIGHT, RELIEF_CONTRAST = (-0.5, -0.3, 0.8), 1.5
"""Where the light on relief comes from: against it, the risers of steps are dark."""
_GROUND_COLOR = (0.97, 0.98, 1.0)
_ROOT = "/worm"
# The plainest of the viewer's materials.
_FLOOR_LOOK: dict[str, Any] = {
    "color": SQUARE_COLOR,
    "material": "toon3",
    "cast_shadow": False,
    "receive_shadow": False,
}


class Stage:
    """Worm and arena in a viewer.

    Attributes:
        picture: What is seen, in the model's axes.
        turn: Rotation from the model's axes to the page's, ``(3, 3)``.
        shift_m: Where the model's origin is in the page, m, ``(3,)``.
        follow: Whether worm and ground move so that the worm's middle stays on the screen.
    """

    def __init__(self, server: viser.ViserServer, config: RunConfig, painter: AnyPainter, moment: Moment) -> None:
        """Makes all nodes and places the camera so that the whole worm is seen."""
        from viser.transforms import SO3

        self._painter = painter
        self.picture = first = painter.paint(moment)
        self._scene = scene = server.scene
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map(hdri=None)
        scene.add_light_ambient("/sky", intensity=2.0)
        scene.add_light_directional("/lamp", intensity=2.0, position=(-3.0, -2.0, 3.0))
        self.turn = upright(config)
        self.shift_m, self.follow = np.zeros(3), True
        self._root = scene.add_frame(_ROOT, show_axes=False, wxyz=SO3.from_matrix(self.turn).wxyz)
        self._strands, self._rings, self._springs = (
            scene.add_line_segments(f"{_ROOT}/{name}", points, colors, thickness=width, thickness_units="screen")
            for name, points, colors, width in (
                ("strands", first.strands, painter.strand_colors(), STRAND_PIXELS),
                ("rings", first.rings, first.ring_colors, RING_PIXELS),
                ("springs", first.springs, first.spring_colors, SPRING_PIXELS),
            )
        )
        self._contacts = scene.add_arrows(
            f"{_ROOT}/contacts",
            first.contacts,
            CONTACT_COLOR,
            shaft_radius=0.0035,
            head_radius=0.009,
            head_length=0.022,
        )
        scene.add_frame(f"{_ROOT}/ground", show_axes=False)
        if config.arena is not None:
            _add_ground(scene, config.arena, float(np.ptp(first.strands[..., 0])))
        self._geoms: SceneGeoms | None = None
        if not isinstance(painter, PlanarPainter):
            floor = Shape(*_squares(0.0))
            self._geoms = SceneGeoms(scene, f"{_ROOT}/ground", painter.model, floor, _FLOOR_LOOK, painter.prefix)
        self._place_geoms()
        self._first_middle = first.middle
        self._level = config.arena is not None and config.arena.is_plane and config.arena.slope_rad == 0.0
        points = first.strands.reshape(-1, 3) @ self.turn.T
        target = (points.min(axis=0) + points.max(axis=0)) / 2
        angles = view_angles("isometric")
        _, _, sight = picture_axes(*angles)
        distance = ROOM * fitting_distance(points - target, *angles, ASPECT)
        camera = server.initial_camera
        camera.fov = math.radians(FIELD_OF_VIEW_DEG)
        camera.look_at = target
        camera.position = target - distance * sight

    def show(self, moment: Moment) -> None:
        """Shows another moment."""
        self.picture = picture = self._painter.paint(moment)
        self._strands.points = picture.strands
        self._rings.points = picture.rings
        self._rings.colors = picture.ring_colors
        self._springs.points = picture.springs
        self._springs.colors = picture.spring_colors
        self._contacts.points = picture.contacts
        self._place_geoms()
        shift = self.turn @ (self._first_middle - picture.middle) if self.follow else np.zeros(3)
        if self._level:
            # A worm that breathes is not to make the ground bob.
            shift[2] = 0.0
        if np.abs(shift - self.shift_m).max() > 1e-4:
            self.shift_m = shift
            self._root.position = shift

    def _place_geoms(self) -> None:
        if self._geoms is not None and not isinstance(self._painter, PlanarPainter):
            self._geoms.place(*self._painter.places(self._geoms.geoms))

    def set_visible(self, layer: str, visible: bool) -> None:
        """Shows or hides one of `LAYERS`."""
        handle = self._scene.get_handle_by_name(f"{_ROOT}/{layer}")
        assert handle is not None
        handle.visible = visible

    def to_model(self, origin: Array, direction: Array) -> tuple[Array, Array]:
        """Turns a ray of the page into the model's axes."""
        return (origin - self.shift_m) @ self.turn, direction @ self.turn


def _add_ground(scene: viser.SceneApi, arena: ArenaKind, length_m: float) -> None:
    """Adds the arena as it is seen: floor, relief, pipe, rails and posts."""
    shape, pipe = arena.shape(length_m), arena.is_closed
    if shape is not None and pipe:
        look: dict[str, Any] = {"color": PIPE_RGBA[:3], "opacity": PIPE_RGBA[3], "side": "double"}
        scene.add_mesh_simple(f"{_ROOT}/ground/pipe", shape.vertices_m, shape.faces, **look)
    elif shape is not None:
        import trimesh
        from trimesh.visual import ColorVisuals

        relief = trimesh.Trimesh(shape.vertices_m, shape.faces, process=False)
        relief.visual = ColorVisuals(relief, vertex_colors=_shaded(relief.vertex_normals))
        scene.add_mesh_trimesh(f"{_ROOT}/ground/relief", relief, cast_shadow=False, receive_shadow=False)
    if (shape is None or pipe) and not arena.is_scene:
        vertices, faces = _squares(-arena.floor_depth_m)
        scene.add_mesh_simple(f"{_ROOT}/ground/floor", vertices, faces, **_FLOOR_LOOK)
    _add_walls(scene, arena)


def _shaded(normals: Array) -> NDArray[np.uint8]:
    """Colours of a relief by its slopes, which are too gentle for the viewer's own light, ``(n, 4)``."""
    shade = np.clip(1.0 + RELIEF_CONTRAST * (normals - [0.0, 0.0, 1.0]) @ RELIEF_LIGHT, 0.4, 1.1)
    colors = np.minimum(shade[:, np.newaxis] * np.asarray(_GROUND_COLOR), 1.0)
    return np.rint(255.0 * np.column_stack([colors, np.ones(len(colors))])).astype(np.uint8)


def _squares(height_m: float) -> tuple[Array, NDArray[np.int32]]:
    """Vertices and faces of strips that make squares to see the worm move against; a grid takes longer to draw."""
    (ahead, behind), side = FLOOR_X_M, FLOOR_HALF_WIDTH_M
    corners = []
    for first, last in (FLOOR_X_M, (-side, side)):
        for place in np.linspace(first, last, round((last - first) / SQUARE_M) + 1):
            # Wider at every whole metre.
            half_width = STRIP_M / 2 * (2.5 if abs(place - round(place)) < 1e-6 else 1.0)
            strip = (place - half_width, place + half_width)
            (a, b), (c, d) = (strip, (-side, side)) if first == ahead else ((ahead, behind), strip)
            corners += [(a, c, height_m), (b, c, height_m), (b, d, height_m), (a, d, height_m)]
    faces = np.arange(0, len(corners), 4)[:, np.newaxis, np.newaxis] + np.array([[0, 1, 2], [0, 2, 3]])
    return np.array(corners), faces.reshape(-1, 3).astype(np.int32)


def _add_walls(scene: viser.SceneApi, arena: ArenaKind) -> None:
    rail_gap_m, posts = arena.walls
    for number, (x, y, radius) in enumerate(posts):
        scene.add_cylinder(
            f"{_ROOT}/ground/post_{number}",
            radius=radius,
            height=2 * POST_HALF_HEIGHT_M,
            color=POST_RGBA[:3],
            position=(x, y, POST_HALF_HEIGHT_M - arena.floor_depth_m),
        )
    if rail_gap_m is None:
        return
    for side in (-1.0, 1.0):
        scene.add_box(
            f"{_ROOT}/ground/rail_{'left' if side < 0 else 'right'}",
            dimensions=(FLOOR_HALF_SIZE_M, 0.004, 2 * RAIL_HALF_HEIGHT_M),
            color=RAIL_RGBA[:3],
            opacity=RAIL_RGBA[3],
            position=(0.0, side * (rail_gap_m / 2 + 0.002), RAIL_HALF_HEIGHT_M - arena.floor_depth_m),
        )

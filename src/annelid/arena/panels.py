"""The ground as parts that stand still, for models that nobody lays planes in: flat panels, blocks, a height field.

They hold a worm in plain MuJoCo. Panels of a pipe are tangent to it in their middles, so the skin may go a little
deeper between them, and may touch two at once (docs/arenas.md compares them with the planes that annelid moves).
"""

from __future__ import annotations

from math import pi, tan

import mujoco
import numpy as np

from annelid.arena.contact import HIDDEN_GROUP, contact_options
from annelid.arena.shapes import (
    ENTRY_SHOWN_M,
    EXIT_SHOWN_M,
    GROUND_AHEAD_M,
    GROUND_BEHIND_M,
    GROUND_HALF_WIDTH_M,
    frames_along,
    last_change_m,
)
from annelid.arena.surface import Hills, PipeWall, Stairs, ground_of
from annelid.config import Arena
from annelid.protocols import Array

PANELS_AROUND = 32
PANEL_LENGTH_M = 0.05
HALF_THICKNESS_M = 0.01
FIELD_GRAIN_M = 0.02
FIELD_BASE_M = 0.1


def add_panels(spec: mujoco.MjSpec, arena: Arena, length_m: float, panels_around: int = PANELS_AROUND) -> None:
    """Adds what can be touched of a ground that is not one plane; it is not drawn.

    Args:
        spec: The worm's spec.
        arena: The ground and its contact settings.
        length_m: Length of the worm, which the entry of a pipe holds.
        panels_around: Number of panels round a pipe.
    """
    surface = ground_of(arena)
    if isinstance(surface, PipeWall):
        _add_pipe(spec, arena, surface, length_m, panels_around)
    elif isinstance(surface, Stairs):
        _add_blocks(spec, arena, surface)
    elif isinstance(surface, Hills):
        _add_field(spec, arena, surface)


def _add_pipe(spec: mujoco.MjSpec, arena: Arena, wall: PipeWall, length_m: float, around: int) -> None:
    first, last = -(length_m + ENTRY_SHOWN_M), last_change_m(wall.course, wall.bore) + EXIT_SHOWN_M
    n_rings = int((last - first) / PANEL_LENGTH_M) + 1
    arc = first + (np.arange(n_rings) + 0.5) * (last - first) / n_rings
    centre, side, up = frames_along(wall.course, arc)
    foot, radius = wall.course.at(arc), wall.bore.at(arc)[0]
    for angle in 2.0 * pi * np.arange(around) / around:
        outwards = np.cos(angle) * side + np.sin(angle) * up
        # A ring's panels are longer on the outer side of a curve.
        stretch = 1.0 - radius * (outwards * foot.curvature_per_m).sum(axis=-1)
        places = centre + radius[:, np.newaxis] * outwards
        inwards = wall.normal(places)
        half_length = np.maximum(stretch, 0.1) * (last - first) / n_rings / 2
        for place, facing, along, half, own in zip(places, inwards, foot.tangent, half_length, radius, strict=True):
            ahead = along - (along @ facing) * facing
            ahead = ahead / np.linalg.norm(ahead)
            axes = np.stack([ahead, np.cross(facing, ahead), facing], axis=-1)
            size = [half, own * tan(pi / around), HALF_THICKNESS_M]
            _add_box(spec, arena, place - HALF_THICKNESS_M * facing, size, _quaternion(axes))


def _add_blocks(spec: mujoco.MjSpec, arena: Arena, stairs: Stairs) -> None:
    profile = stairs.profile
    front, rear = -GROUND_AHEAD_M, GROUND_BEHIND_M
    bottom = stairs.level_m - FIELD_BASE_M
    n_steps = max(int((GROUND_AHEAD_M - profile.start_m) / profile.length_m), 1)
    edges = [rear, *(-profile.start_m - k * profile.length_m for k in range(n_steps))]
    for step, edge in enumerate(edges):
        top = stairs.level_m + step * profile.height_m
        place = np.array([(edge + front) / 2, 0.0, (top + bottom) / 2])
        _add_box(
            spec, arena, place, [(edge - front) / 2, GROUND_HALF_WIDTH_M, (top - bottom) / 2], [1.0, 0.0, 0.0, 0.0]
        )


def _add_field(spec: mujoco.MjSpec, arena: Arena, hills: Hills) -> None:
    half_length = (GROUND_AHEAD_M + GROUND_BEHIND_M) / 2
    middle = (GROUND_BEHIND_M - GROUND_AHEAD_M) / 2
    columns, rows = (int(2 * half / FIELD_GRAIN_M) + 1 for half in (half_length, GROUND_HALF_WIDTH_M))
    x = middle + np.linspace(-half_length, half_length, columns)
    y = np.linspace(-GROUND_HALF_WIDTH_M, GROUND_HALF_WIDTH_M, rows)
    height, _ = hills.ground.height(np.stack(np.meshgrid(x, y), axis=-1))
    lowest, span = float(height.min()), float(np.ptp(height))
    spec.add_hfield(
        name="relief",
        nrow=rows,
        ncol=columns,
        size=[half_length, GROUND_HALF_WIDTH_M, span, FIELD_BASE_M],
        userdata=((height - lowest) / span).ravel(),
    )
    spec.worldbody.add_geom(
        name="relief",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="relief",
        pos=[middle, 0.0, hills.level_m + lowest],
        group=HIDDEN_GROUP,
        **contact_options(arena),
    )


def _add_box(
    spec: mujoco.MjSpec, arena: Arena, place: Array, size: list[float], quaternion: Array | list[float]
) -> None:
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=place,
        quat=quaternion,
        size=size,
        group=HIDDEN_GROUP,
        **contact_options(arena),
    )


def _quaternion(axes: Array) -> Array:
    """Returns the quaternion of a rotation matrix, whose columns are its axes, ``(3, 3)``."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    return quaternion

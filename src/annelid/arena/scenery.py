"""What is seen of an arena: sky, light, floors, guard rails and posts, the shapes of relief and pipes."""

from __future__ import annotations

from math import sqrt

import mujoco

from annelid.arena.contact import contact_options
from annelid.arena.shapes import Shape
from annelid.config.arena import ArenaKind, Walls

CHECKER = ((0.86, 0.88, 0.90), (0.80, 0.83, 0.86))
FLOOR_HALF_SIZE_M = 40.0
RAIL_HALF_HEIGHT_M = 0.1
POST_HALF_HEIGHT_M = 0.3
"""Posts are about twice as high as the worm."""
POST_RGBA = (0.75, 0.47, 0.30, 1.0)
RAIL_RGBA = (0.55, 0.6, 0.66, 0.45)
PIPE_RGBA = (0.62, 0.72, 0.80, 0.28)


def add_scenery(spec: mujoco.MjSpec, arena: ArenaKind, length_m: float) -> None:
    """Adds the arena to look at, below a sky and a light.

    Floors have a faint checkerboard of 10 cm squares, and walls of pipes are seen through. Floors and guard rails are
    unbounded planes, posts cylinders; relief and pipes are shapes to see, and hidden panels that can be touched.

    Args:
        spec: The worm's spec, its lowest line at z = 0.
        arena: Friction, gap and contact settings.
        length_m: Length of the worm, which the light is placed over.
    """
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[1.0, 1.0, 1.0],
        rgb2=[0.88, 0.92, 0.96],
        width=64,
        height=64,
    )
    spec.add_texture(
        name="floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=CHECKER[0],
        rgb2=CHECKER[1],
        width=128,
        height=128,
    )
    material = spec.add_material(name="floor", texrepeat=[5.0, 5.0], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
    walls = arena.is_closed or arena.walls != Walls()
    spec.worldbody.add_light(
        name="lamp",
        pos=[length_m / 2, -1.0, 2.5],
        dir=[0.0, 0.35, -1.0],
        diffuse=[0.7, 0.7, 0.7],
        # The engine would let walls that are seen through cast the shadow of solid ones.
        castshadow=not walls,
    )
    shape = arena.shape(length_m)
    if shape is not None:
        _add_shape(spec, shape, arena)
        arena.add_panels(spec, length_m)
    if arena.is_closed or shape is None:
        _add_floor(spec, arena, length_m)
    add_walls(spec, arena)


def add_walls(spec: mujoco.MjSpec, arena: ArenaKind) -> None:
    """Adds what stands upright, if anything: guard rails, which are planes drawn 20 cm high, and posts."""
    rail_gap_m, posts = arena.walls
    for number, (x, y, radius) in enumerate(posts):
        spec.worldbody.add_geom(
            name=f"post_{number}",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            pos=[x, y, POST_HALF_HEIGHT_M - arena.floor_depth_m],
            size=[radius, POST_HALF_HEIGHT_M, 0.0],
            rgba=POST_RGBA,
            **contact_options(arena),
        )
    if rail_gap_m is None:
        return
    for name, side, turn in (("rail_left", -1.0, -sqrt(0.5)), ("rail_right", 1.0, sqrt(0.5))):
        spec.worldbody.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            pos=[0.0, side * rail_gap_m / 2, RAIL_HALF_HEIGHT_M - arena.floor_depth_m],
            quat=[sqrt(0.5), turn, 0.0, 0.0],
            size=[FLOOR_HALF_SIZE_M, RAIL_HALF_HEIGHT_M, 1.0],
            rgba=RAIL_RGBA,
            **contact_options(arena),
        )


def _add_floor(spec: mujoco.MjSpec, arena: ArenaKind, length_m: float) -> None:
    """Adds the floor of a flat arena, or one to see below a pipe."""
    flat = arena.is_plane
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=[length_m / 2, 0.0, -arena.floor_depth_m],
        size=[FLOOR_HALF_SIZE_M, FLOOR_HALF_SIZE_M, 1.0],
        material="floor",
        contype=1 if flat else 0,
        conaffinity=1 if flat else 0,
        **contact_options(arena),
    )


def _add_shape(spec: mujoco.MjSpec, shape: Shape, arena: ArenaKind) -> None:
    """Adds a shape that nothing touches; it has no mass, since the world is at rest."""
    spec.add_mesh(
        name="ground",
        uservert=shape.vertices_m.ravel(),
        userface=shape.faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        smoothnormal=True,
    )
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname="ground",
        contype=0,
        conaffinity=0,
        **({"rgba": PIPE_RGBA} if arena.is_closed else {"material": "floor"}),
    )

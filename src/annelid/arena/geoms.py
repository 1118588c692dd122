"""The geoms of an arena: what the skin touches, and what is seen.

A level floor and guard rails are planes of the engine, and posts its cylinders. Any other ground is touched through one
plane for each part of the skin that can touch, tangent to the ground at the nearest point and paired with that part
alone. The planes hang on mocap bodies, which are part of the engine's state, and are laid anew before every step
(`annelid.simulation.ground`): the ground has no seams, one part has one contact, and a step costs the same on any
ground (docs/arenas.md).
"""

from __future__ import annotations

from math import sqrt

import mujoco
import numpy as np

from annelid.arena.friction import contact_options
from annelid.arena.surface import Shape
from annelid.config.answers import Walls
from annelid.config.run import ArenaKind
from annelid.errors import ConfigError, shortened
from annelid.morphology import Array

PLAIN_RGBA, GROUND_RGBA = (0.5, 0.5, 0.5, 1.0), (0.72, 0.75, 0.78, 1.0)
"""Of a geom in MJCF that states no colour, and what a scene shows instead where it is at rest."""
PLANE_HALF_SIZE_M = 0.01
"""Of a moving plane as drawn; the engine's planes have no end."""
HIDDEN_GROUP = 4
SKY = ((1.0, 1.0, 1.0), (0.88, 0.92, 0.96))
CHECKER = ((0.86, 0.88, 0.90), (0.80, 0.83, 0.86))
FLOOR_HALF_SIZE_M = 40.0
RAIL_HALF_HEIGHT_M = 0.1
POST_HALF_HEIGHT_M = 0.3
"""Posts are about twice as high as the worm."""
POST_RGBA = (0.75, 0.47, 0.30, 1.0)
RAIL_RGBA = (0.55, 0.6, 0.66, 0.45)
PIPE_RGBA = (0.62, 0.72, 0.80, 0.28)
SCENE = "scene/"
"""What the names of a scene begin with in a worm's model."""


def skin_geoms(spec: mujoco.MjSpec) -> list[mujoco.MjsGeom]:
    """Returns the geoms of the skin that can touch the ground, in the order of the spec, each with a name."""
    skin = [geom for geom in spec.geoms if geom.conaffinity and not geom.contype]
    for number, geom in enumerate(skin):
        geom.name = geom.name or f"skin_{number}"
    return skin


def add_moving_planes(spec: mujoco.MjSpec, arena: ArenaKind) -> None:
    """Adds to a worm's spec one plane on a mocap body for every geom that can touch the ground, and pairs the two."""
    options = contact_options(arena)
    del options["friction"]
    for geom in skin_geoms(spec):
        name = f"ground_of_{geom.name}"
        holder = spec.worldbody.add_body(name=name, mocap=True)
        holder.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[PLANE_HALF_SIZE_M, PLANE_HALF_SIZE_M, 1.0],
            contype=0,
            conaffinity=0,
            group=HIDDEN_GROUP,
        )
        slide, spin, roll = geom.friction
        friction = [slide, slide, spin, roll, roll]
        spec.add_pair(name=name, geomname1=name, geomname2=geom.name, condim=3, friction=friction, **options)
        geom.conaffinity = int(arena.walls != Walls())


def add_box(spec: mujoco.MjSpec, arena: ArenaKind, place_m: Array, half_size_m: list[float], axes: Array) -> None:
    """Adds a box that can be touched and is not drawn, to support a worm in plain MuJoCo; its axes are columns."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    box = mujoco.mjtGeom.mjGEOM_BOX
    spec.worldbody.add_geom(
        type=box, pos=place_m, quat=quaternion, size=half_size_m, group=HIDDEN_GROUP, **contact_options(arena)
    )


def add_looks(spec: mujoco.MjSpec, length_m: float, *, shadows: bool = True, prefix: str = "") -> None:
    """Adds a sky, a light and the material ``floor``, a faint checkerboard of 10 cm squares, named with a prefix."""
    kinds, looks = mujoco.mjtTexture, mujoco.mjtBuiltin
    for name, kind, look, (first, second), size in (
        (f"{prefix}sky", kinds.mjTEXTURE_SKYBOX, looks.mjBUILTIN_GRADIENT, SKY, 64),
        (f"{prefix}floor", kinds.mjTEXTURE_2D, looks.mjBUILTIN_CHECKER, CHECKER, 128),
    ):
        spec.add_texture(name=name, type=kind, builtin=look, rgb1=first, rgb2=second, width=size, height=size)
    material = spec.add_material(name=f"{prefix}floor", texrepeat=[5.0, 5.0], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = f"{prefix}floor"
    spec.worldbody.add_light(
        name=f"{prefix}lamp",
        pos=[length_m / 2, -1.0, 2.5],
        dir=[0.0, 0.35, -1.0],
        diffuse=[0.7, 0.7, 0.7],
        castshadow=shadows,
    )


def add_scenery(spec: mujoco.MjSpec, arena: ArenaKind, length_m: float) -> None:
    """Adds the arena to look at, below a sky and a light, to the spec of a worm of a length.

    Walls of pipes are seen through. Floors and guard rails are unbounded planes, posts cylinders; relief and pipes are
    shapes to see, and hidden panels that can be touched.
    """
    # The engine would let walls that are seen through cast the shadow of solid ones.
    add_looks(spec, length_m, shadows=not arena.is_closed and arena.walls == Walls())
    if arena.is_scene:
        arena.add_own(spec)
        return
    shape = arena.shape(length_m)
    if shape is not None:
        _add_shape(spec, shape, arena)
        arena.add_panels(spec, length_m)
    if arena.is_closed or shape is None:
        # The floor of a flat arena, or one to see below a pipe.
        spec.worldbody.add_geom(
            name="floor",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            pos=[length_m / 2, 0.0, -arena.floor_depth_m],
            size=[FLOOR_HALF_SIZE_M, FLOOR_HALF_SIZE_M, 1.0],
            material="floor",
            contype=int(arena.is_plane),
            conaffinity=int(arena.is_plane),
            **contact_options(arena),
        )
    add_walls(spec, arena)


def add_scene(spec: mujoco.MjSpec, text: str, depth_m: float) -> None:
    """Adds a checked scene, whose z = 0 is so far below the mesh's lowest line, to a worm's spec.

    Between skin and scene the scene's contact parameters hold. What has no look of its own looks like a floor, or like
    a post where it moves.

    Raises:
        ConfigError: The engine refuses the scene.
    """
    try:
        scene = mujoco.MjSpec.from_string(text)
        # By their names they are known to belong to the scene.
        for number, part in enumerate([*scene.geoms, *scene.bodies[1:]]):
            part.name = part.name or f"part_{number}"
        # Alone, so that what it says of a body is of the scene.
        alone = scene.copy().compile()
    except ValueError as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ")
        raise ConfigError(f"the engine refuses the scene: {shortened(reason, 200)}") from None
    free = alone.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE)
    if alone.jnt_stiffness[free].any():
        raise ConfigError("the scene has a free joint with a stiffness: springs are for slides, hinges and ball joints")
    floors: list[str] = []
    for geom in scene.geoms:
        if geom.material or not np.allclose(geom.rgba, PLAIN_RGBA):
            continue
        if geom.type == mujoco.mjtGeom.mjGEOM_PLANE:
            floors.append(f"{SCENE}{geom.name}")
            continue
        moves = alone.body_weldid[alone.geom_bodyid[alone.geom(geom.name).id]] > 0
        geom.rgba = POST_RGBA if moves else GROUND_RGBA
    for geom in skin_geoms(spec):
        geom.priority = -1
    spec.attach(scene, prefix=SCENE, frame=spec.worldbody.add_frame(pos=[0.0, 0.0, -depth_m]))
    for name in floors:
        spec.geom(name).material = "floor"


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


def _add_shape(spec: mujoco.MjSpec, shape: Shape, arena: ArenaKind) -> None:
    """Adds a shape that nothing touches; it has no mass, since the world is at rest."""
    spec.add_mesh(
        name="ground",
        uservert=shape.vertices_m.ravel(),
        userface=shape.faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        smoothnormal=True,
    )
    look = {"rgba": PIPE_RGBA} if arena.is_closed else {"material": "floor"}
    spec.worldbody.add_geom(
        name="ground", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="ground", contype=0, conaffinity=0, **look
    )

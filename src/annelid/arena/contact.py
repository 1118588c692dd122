"""How skin and ground touch: contact settings, and the planes that move with the skin.

A level floor and guard rails are planes of the engine, and posts its cylinders. Every other ground is felt through one
plane for each part of the skin that can touch, tangent to the ground at the nearest point and paired with that part
alone. The planes hang on mocap bodies, which are part of the engine's state, and are laid anew before every step
(`annelid.simulation.ground`): the ground has no seams, one part has one contact, and a step costs the same on any
ground (docs/arenas.md).
"""

from __future__ import annotations

import mujoco
import numpy as np

from annelid.config.arena import ArenaKind, Walls
from annelid.protocols import Array

PLANE_HALF_SIZE_M = 0.01
"""Of a moving plane as drawn; the engine's planes have no end."""
HIDDEN_GROUP = 4


def contact_options(arena: ArenaKind) -> dict[str, list[float]]:
    """Contact attributes that worm and floor share, so that neither dilutes the other's."""
    return {
        "friction": [arena.friction, 0.005, 0.0001],
        "solref": [arena.contact_time_constant_s, 1.0],
        "solimp": [*arena.contact_impedance, 0.5, 2.0],
    }


def touching(spec: mujoco.MjSpec) -> list[mujoco.MjsGeom]:
    """Returns the geoms of the skin that can touch the ground, in the order of the spec, each with a name."""
    skin = [geom for geom in spec.geoms if geom.conaffinity and not geom.contype]
    for number, geom in enumerate(skin):
        geom.name = geom.name or f"skin_{number}"
    return skin


def plane_name(skin: str) -> str:
    """Name of the moving plane, its body and its pair that belong to a geom of the skin."""
    return f"ground_of_{skin}"


def add_moving_planes(spec: mujoco.MjSpec, arena: ArenaKind) -> None:
    """Adds one plane on a mocap body for every geom that can touch the ground, and pairs the two.

    Args:
        spec: The worm's spec, complete but for the ground.
        arena: Contact settings.
    """
    options = contact_options(arena)
    slide, spin, roll = options.pop("friction")
    walls = arena.walls != Walls()
    for geom in touching(spec):
        name = plane_name(geom.name)
        holder = spec.worldbody.add_body(name=name, mocap=True)
        holder.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[PLANE_HALF_SIZE_M, PLANE_HALF_SIZE_M, 1.0],
            contype=0,
            conaffinity=0,
            group=HIDDEN_GROUP,
        )
        spec.add_pair(
            name=name,
            geomname1=name,
            geomname2=geom.name,
            condim=3,
            friction=[slide, slide, spin, roll, roll],
            **options,
        )
        geom.conaffinity = 1 if walls else 0


def set_friction(model: mujoco.MjModel, friction: float) -> None:
    """Gives skin and ground of a compiled worm another coefficient of sliding friction, from the next step on.

    Args:
        model: The worm; one with setae sets its own before every step.
        friction: The coefficient.
    """
    model.geom_friction[(model.geom_contype != 0) | (model.geom_conaffinity != 0), 0] = friction
    model.pair_friction[:, :2] = friction


def add_box(spec: mujoco.MjSpec, arena: ArenaKind, place_m: Array, half_size_m: list[float], axes: Array) -> None:
    """Adds a box that can be touched and is not drawn, to hold a worm in plain MuJoCo.

    Args:
        spec: The worm's spec.
        arena: Contact settings.
        place_m: Its middle, m, ``(3,)``.
        half_size_m: Half of its three edges, m.
        axes: Its axes as columns, ``(3, 3)``.
    """
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=place_m,
        quat=quaternion,
        size=half_size_m,
        group=HIDDEN_GROUP,
        **contact_options(arena),
    )

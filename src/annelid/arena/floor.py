"""A flat floor."""

from __future__ import annotations

import mujoco

from annelid.config import Arena

CHECKER = ((0.86, 0.88, 0.90), (0.80, 0.83, 0.86))
FLOOR_HALF_SIZE_M = 40.0


def add_floor(spec: mujoco.MjSpec, arena: Arena, length_m: float) -> None:
    """Adds an unbounded floor below the worm, with a faint checkerboard of 10 cm squares, a sky and a light.

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
    spec.worldbody.add_light(name="lamp", pos=[length_m / 2, -1.0, 2.5], dir=[0.0, 0.35, -1.0], diffuse=[0.7, 0.7, 0.7])
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=[length_m / 2, 0.0, -arena.floor_gap_m],
        size=[FLOOR_HALF_SIZE_M, FLOOR_HALF_SIZE_M, 1.0],
        material="floor",
        **contact_options(arena),
    )


def contact_options(arena: Arena) -> dict[str, list[float]]:
    """Contact attributes that worm and floor share, so that neither dilutes the other's."""
    return {
        "friction": [arena.friction, 0.005, 0.0001],
        "solref": [arena.contact_time_constant_s, 1.0],
        "solimp": [*arena.contact_impedance, 0.5, 2.0],
    }

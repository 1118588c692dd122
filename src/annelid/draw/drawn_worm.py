"""A 3D worm as pictures show it: its model with a picture's lens and light, brought into postures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from annelid.config import CourseTurning, Floor, RunConfig, WormBody
from annelid.draw.camera import FIELD_OF_VIEW_DEG
from annelid.draw.style import activation_color

if TYPE_CHECKING:
    import mujoco

AMBIENT = 0.5
HEADLIGHT = 0.25
"""Light from all sides, and from the camera; the lamp adds 0.4."""
CONTRACTED_WIDTH = 1.8
"""A contracted ring muscle is drawn this much thicker than a relaxed one."""
HAZE = (0.94, 0.955, 0.97)
"""What the floor fades into with distance."""
SPRING_RGBA = (0.80, 0.58, 0.16, 1.0)
"""Axial springs, apart from the red of a contracted ring."""
WAYPOINT_RGBA = (0.20, 0.55, 0.42, 0.35)
WAYPOINT_HALF_HEIGHT_M = 1e-3


class DrawnWorm:
    """A 3D worm's compiled model, and the posture that it is drawn in.

    Attributes:
        model: The model, with a picture's lens and light.
        posture: The engine's state of what is drawn.
        rings: Tendons of the ring muscles, ``(n_muscles,)``.
        upright: Rotation from the model's axes, which lie in a slope, to upright ones, ``(3, 3)``.
    """

    def __init__(self, config: RunConfig) -> None:
        """Compiles the model of a 3D worm's configuration."""
        import mujoco

        self.model, self.rings = _model_to_draw(config)
        self.posture = mujoco.MjData(self.model)
        self.upright = upright(config)
        self._widths = self.model.tendon_width[self.rings].copy()

    def light_for(self, elevation_deg: float) -> None:
        """Dims the light from all sides where the floor would be white.

        The floor takes the more of the headlight the steeper it is seen; seen from the top it would be white.
        """
        steepness = abs(math.sin(math.radians(elevation_deg)))
        self.model.vis.headlight.ambient[:] = min(AMBIENT, AMBIENT + 0.1 - HEADLIGHT * steepness)

    def pose(self, qpos: NDArray[np.floating]) -> None:
        """Brings all that is drawn into a posture."""
        import mujoco

        self.posture.qpos[:] = qpos
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex, mujoco.mj_tendon):
            stage(self.model, self.posture)

    def color_rings(self, activation: NDArray[np.floating]) -> None:
        """Gives the ring muscles colours and widths by their activation, in [0, 1], ``(n_muscles,)``."""
        for ring, width, value in zip(self.rings, self._widths, activation, strict=True):
            self.model.tendon_rgba[ring] = (*activation_color(float(value)), 1.0)
            self.model.tendon_width[ring] = width * (1.0 + (CONTRACTED_WIDTH - 1.0) * float(value))

    def part_ends(self, qpos: NDArray[np.floating]) -> NDArray[np.float64]:
        """Both ends of every part of the worm in a posture, m, ``(point, 3)``.

        The strands' free ends reach beyond the crossings, so these would not do.
        """
        import mujoco

        model, posture = self.model, self.posture
        parts = np.flatnonzero(model.geom_bodyid > 0)
        capsules = model.geom_type[parts] == mujoco.mjtGeom.mjGEOM_CAPSULE.value
        half_lengths = np.where(capsules, model.geom_size[parts, 1], 0.0)
        posture.qpos[:] = qpos
        mujoco.mj_kinematics(model, posture)
        middles, axes = posture.geom_xpos[parts], posture.geom_xmat[parts].reshape(-1, 3, 3)[:, :, 2]
        reach = half_lengths[:, None] * axes
        return np.concatenate([middles - reach, middles + reach])


def middle(points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Middle of the box about points, m, ``(point, 3)``."""
    return (points_m.min(axis=0) + points_m.max(axis=0)) / 2


def free_camera(angles_deg: tuple[float, float], distance_m: float) -> mujoco.MjvCamera:
    """Returns a camera by the azimuth and elevation of its line of sight and its distance from what it looks at."""
    import mujoco

    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.azimuth, camera.elevation = angles_deg
    camera.distance = distance_m
    return camera


def options() -> mujoco.MjvOption:
    """Returns what is drawn: all but the actuators, which the rings stand for."""
    import mujoco

    option = mujoco.MjvOption()
    mujoco.mjv_defaultOption(option)
    option.flags[mujoco.mjtVisFlag.mjVIS_ACTUATOR] = False
    return option


def upright(config: RunConfig) -> NDArray[np.float64]:
    """Returns the rotation from the model's axes, which lie in a slope, to upright ones, ``(3, 3)``."""
    slope = math.radians(config.arena.slope_deg) if isinstance(config.arena, Floor) else 0.0
    c, s = math.cos(slope), math.sin(slope)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _model_to_draw(config: RunConfig) -> tuple[mujoco.MjModel, NDArray[np.int64]]:
    """Compiles the run's model with a picture's lens and light; returns it with its ring tendons' ids."""
    import mujoco

    from annelid.body import build_spec
    from annelid.body.actuation import ring_names

    assert isinstance(config.body, WormBody)
    spec = build_spec(config)
    visual = spec.visual
    visual.global_.fovy = FIELD_OF_VIEW_DEG
    visual.headlight.diffuse = [HEADLIGHT] * 3
    visual.headlight.specular = [0.05, 0.05, 0.05]
    visual.quality.shadowsize = 4096
    visual.rgba.fog = [*HAZE, 1.0]
    visual.map.fogstart, visual.map.fogend = 4.0, 12.0
    for light in spec.lights:
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.diffuse = [0.4, 0.4, 0.4]
        light.specular = [0.1, 0.1, 0.1]
    for tendon in spec.tendons:
        tendon.rgba = SPRING_RGBA
    _mark_waypoints(spec, config)
    model = spec.compile()
    names = ring_names(config.body.n_segments, config.body.rings)
    return model, np.array([model.tendon(name).id for name in names])


def _mark_waypoints(spec: mujoco.MjSpec, config: RunConfig) -> None:
    """Lays a disc on the floor where each waypoint of a course counts as reached."""
    import mujoco

    if not (isinstance(config.turning, CourseTurning) and isinstance(config.arena, Floor)):
        return
    for x, y in config.turning.waypoints:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            pos=[x, y, WAYPOINT_HALF_HEIGHT_M - config.arena.floor_gap_m],
            size=[config.turning.reach_m, WAYPOINT_HALF_HEIGHT_M, 0.0],
            rgba=WAYPOINT_RGBA,
            contype=0,
            conaffinity=0,
        )

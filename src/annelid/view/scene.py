"""The 3D worm, posed from a run's recorded postures and drawn by MuJoCo."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.config import CourseTurning, Floor, RunConfig, WormBody
from annelid.view.camera import FIELD_OF_VIEW_DEG, FIXED, fitting_distance, picture_points, view_angles
from annelid.view.gl import Canvas, find_backend
from annelid.view.postures import postures_of
from annelid.view.style import CONTRACTED, activation_color

if TYPE_CHECKING:
    import mujoco

    from annelid.simulation.runfile import Run

AMBIENT = 0.5
HEADLIGHT = 0.25
"""Light from all sides, and from the camera; the lamp adds 0.4."""
CONTRACTED_WIDTH = 1.8
"""A contracted ring muscle is drawn this much thicker than a relaxed one."""
HAZE = (0.94, 0.955, 0.97)
"""What the floor fades into with distance."""
STILL_AMBIENT = 0.7
"""Without a floor that it would bleach, there may be more light from all sides."""
PALE = 3.0
"""On white, what lies this many half worms behind its middle would vanish."""
ROOM = 1.3
"""A camera that cannot know what is to come keeps this many times the distance from which the worm at rest fits."""
SPRING_RGBA = (0.80, 0.58, 0.16, 1.0)
"""Axial springs, apart from the red of a contracted ring."""
WAYPOINT_RGBA = (0.20, 0.55, 0.42, 0.35)
WAYPOINT_HALF_HEIGHT_M = 1e-3


class WormScene:
    """Pictures of a 3D worm's run, used as a context manager."""

    def __init__(self, run: Run, width: int, height: int, camera: str, *, fine: bool) -> None:
        """Builds the model of the run's own configuration.

        Args:
            run: The run.
            width: Pixels.
            height: Pixels.
            camera: Name of a view, see `annelid.view.camera.VIEWS_DEG`.
            fine: Shadows and smooth edges.

        Raises:
            RunFileError: No postures recorded, they do not fit the model, or no such camera.
            RenderingUnavailable: No OpenGL back-end works.
        """
        import mujoco

        self._angles = view_angles(camera)
        data = run.data
        backend = find_backend()
        self._run = run
        self.times_s: NDArray[np.float64] = data["frame_time"].values
        self._model, self._rings = model_to_draw(run.config)
        self._qpos = postures_of(run, self._model.nq)
        # The floor takes the more of the headlight the steeper it is seen; seen from the top it would be white.
        steepness = abs(math.sin(math.radians(self._angles[1])))
        self._model.vis.headlight.ambient[:] = min(AMBIENT, AMBIENT + 0.1 - HEADLIGHT * steepness)
        self._posture = mujoco.MjData(self._model)
        self._ring_width = self._model.tendon_width[self._rings].copy()
        self._aspect = width / height
        self._target = data["crossing_position"].values.mean(axis=1)
        points = self._points_drawn()
        self._target[:, 2] = (points[:, :, 2].min() + points[:, :, 2].max()) / 2
        if camera in FIXED:
            self._target[:] = (points.min(axis=(0, 1)) + points.max(axis=(0, 1))) / 2
        self._upright = _upright(run.config)
        self._offsets = (points - self._target[:, None]).reshape(-1, 3) @ self._upright.T
        if camera in FIXED:
            far = fitting_distance(self._offsets, *self._angles, self._aspect) / self._model.stat.extent
            self._model.vis.map.fogstart, self._model.vis.map.fogend = 2.0 * far, 6.0 * far
        self._canvas = Canvas(self._model, width, height, backend, fine=fine)

    def __enter__(self) -> Self:
        self._canvas.__enter__()
        self._camera, self._option = self._camera_and_option()
        return self

    def __exit__(self, *_: object) -> None:
        self._canvas.close()

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Draws one recorded frame.

        Args:
            frame: Index along the run's ``frame`` dimension.

        Returns:
            Pixels, shape ``(height, width, 3)``.
        """
        pose(self._model, self._posture, self._qpos[frame])
        self._color_rings(float(self.times_s[frame]))
        self._camera.lookat[:] = self._target[frame]
        caption = f"{self.times_s[frame]:.2f} s"
        return self._canvas.draw(self._posture, self._camera, self._option, caption, upright=self._upright)

    def _color_rings(self, time_s: float) -> None:
        activation = self._run.data["activation"].sel(time=time_s, method="nearest").values
        color_rings(self._model, self._rings, self._ring_width, activation)

    def _points_drawn(self) -> NDArray[np.float64]:
        """Both ends of every part of the worm in every recorded posture, m, shape ``(frame, point, 3)``."""
        return np.stack([_part_ends(self._model, self._posture, qpos) for qpos in self._qpos])

    def _camera_and_option(self) -> tuple[mujoco.MjvCamera, mujoco.MjvOption]:
        return _free_camera(self._angles, fitting_distance(self._offsets, *self._angles, self._aspect)), _options()


class PostureScene:
    """Pictures of a 3D worm in postures that are given one by one.

    The camera looks at the worm's middle, from a distance that leaves it room to stretch.
    """

    def __init__(self, config: RunConfig, width: int, height: int, camera: str) -> None:
        """Builds the model and opens a back-end, which `close` frees.

        Args:
            config: Configuration of the 3D worm.
            width: Pixels.
            height: Pixels.
            camera: Name of a view, see `annelid.view.camera.VIEWS_DEG`.

        Raises:
            RunFileError: There is no such camera.
            RenderingUnavailable: No OpenGL back-end works.
        """
        import mujoco

        angles = view_angles(camera)
        backend = find_backend()
        self._model, self._rings = model_to_draw(config)
        steepness = abs(math.sin(math.radians(angles[1])))
        self._model.vis.headlight.ambient[:] = min(AMBIENT, AMBIENT + 0.1 - HEADLIGHT * steepness)
        self._posture = mujoco.MjData(self._model)
        self._ring_width = self._model.tendon_width[self._rings].copy()
        self._upright = _upright(config)
        points = _part_ends(self._model, self._posture, self._model.qpos0)
        offsets = (points - _middle(points)) @ self._upright.T
        self._camera = _free_camera(angles, ROOM * fitting_distance(offsets, *angles, width / height))
        self._option = _options()
        self._canvas = Canvas(self._model, width, height, backend, fine=False)
        self._canvas.__enter__()

    def close(self) -> None:
        """Frees the back-end."""
        self._canvas.close()

    def picture(self, qpos: NDArray[np.float64], activation: NDArray[np.float64], caption: str) -> NDArray[np.uint8]:
        """Draws a posture.

        Args:
            qpos: Generalised positions, as a run records them.
            activation: Of the ring muscles, ``(n_muscles,)``.
            caption: Words in the lower left corner.

        Returns:
            Pixels, shape ``(height, width, 3)``.
        """
        self._camera.lookat[:] = _middle(_part_ends(self._model, self._posture, qpos))
        pose(self._model, self._posture, qpos)
        color_rings(self._model, self._rings, self._ring_width, activation)
        return self._canvas.draw(self._posture, self._camera, self._option, caption, upright=self._upright)


@dataclass(frozen=True)
class Still:
    """A rendered posture that marks can be drawn on.

    Attributes:
        pixels: Shape ``(height, width, 3)``.
        target_m: Point that the camera looks at, shape ``(3,)``.
        angles_deg: Azimuth and elevation of the line of sight.
        distance_m: From the camera to the point that it looks at.
    """

    pixels: NDArray[np.uint8]
    target_m: NDArray[np.float64]
    angles_deg: tuple[float, float]
    distance_m: float

    def places(self, points_m: ArrayLike) -> NDArray[np.float64]:
        """Finds the pixels (column, row) at which points appear.

        Args:
            points_m: Points, m, shape ``(..., 3)``.

        Returns:
            Columns and rows, counted from the picture's upper left corner, shape ``(..., 2)``.
        """
        height, width = self.pixels.shape[:2]
        offsets = np.asarray(points_m, dtype=float) - self.target_m
        shares = picture_points(offsets, *self.angles_deg, self.distance_m, width / height)
        return shares * [width, height] - 0.5


def render_still(
    config: RunConfig,
    angles_deg: tuple[float, float],
    size: tuple[int, int],
    *,
    qpos: NDArray[np.float64] | None = None,
    activation: NDArray[np.float64] | None = None,
) -> Still:
    """Renders one posture on white, without a floor; what lies behind is paler.

    Args:
        config: Configuration of the 3D worm.
        angles_deg: Azimuth and elevation of the line of sight.
        size: Width and height, pixels.
        qpos: The posture as a run records it; by default at rest.
        activation: Colours and widths of the ring muscles; by default all rings and springs are red.

    Returns:
        The picture.

    Raises:
        RenderingUnavailable: No OpenGL back-end works.
    """
    import mujoco

    backend = find_backend()
    model, rings = model_to_draw(config)
    if activation is None:
        model.tendon_rgba[:] = (*CONTRACTED, 1.0)
    else:
        color_rings(model, rings, model.tendon_width[rings].copy(), activation)
    model.geom_rgba[model.geom_bodyid == 0, 3] = 0.0
    model.vis.headlight.ambient[:] = STILL_AMBIENT
    posture = mujoco.MjData(model)
    points = _part_ends(model, posture, model.qpos0 if qpos is None else qpos)
    target = _middle(points)
    distance = fitting_distance(points - target, *angles_deg, size[0] / size[1])
    reach = float(np.linalg.norm(points - target, axis=1).max()) / model.stat.extent
    model.vis.rgba.fog[:] = 1.0
    model.vis.map.fogstart = distance / model.stat.extent - reach
    model.vis.map.fogend = distance / model.stat.extent + PALE * reach
    pose(model, posture, model.qpos0 if qpos is None else qpos)
    camera = _free_camera(angles_deg, distance)
    camera.lookat[:] = target
    with Canvas(model, *size, backend) as canvas:
        return Still(canvas.draw(posture, camera, _options()), target, angles_deg, distance)


def _upright(config: RunConfig) -> NDArray[np.float64]:
    """Returns the rotation from the model's axes, which lie in a slope, to upright ones, ``(3, 3)``."""
    slope = math.radians(config.arena.slope_deg) if isinstance(config.arena, Floor) else 0.0
    c, s = math.cos(slope), math.sin(slope)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _middle(points_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Middle of the box about points, m, ``(point, 3)``."""
    return (points_m.min(axis=0) + points_m.max(axis=0)) / 2


def pose(model: mujoco.MjModel, posture: mujoco.MjData, qpos: NDArray[np.floating]) -> None:
    """Brings all that is drawn into a posture."""
    import mujoco

    posture.qpos[:] = qpos
    for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex, mujoco.mj_tendon):
        stage(model, posture)


def color_rings(
    model: mujoco.MjModel, rings: NDArray[np.int64], widths: NDArray[np.float64], activation: NDArray[np.floating]
) -> None:
    """Gives the ring muscles colours and widths by their activation.

    Args:
        model: The model to draw.
        rings: Their tendons, ``(n_muscles,)``.
        widths: Widths of relaxed ones, m, same shape.
        activation: In [0, 1], same shape.
    """
    for ring, width, value in zip(rings, widths, activation, strict=True):
        model.tendon_rgba[ring] = (*activation_color(float(value)), 1.0)
        model.tendon_width[ring] = width * (1.0 + (CONTRACTED_WIDTH - 1.0) * float(value))


def _part_ends(model: mujoco.MjModel, posture: mujoco.MjData, qpos: NDArray[np.float64]) -> NDArray[np.float64]:
    """Both ends of every part of the worm, m, shape ``(point, 3)``.

    The strands' free ends reach beyond the crossings, so these would not do.
    """
    import mujoco

    parts = np.flatnonzero(model.geom_bodyid > 0)
    capsules = model.geom_type[parts] == mujoco.mjtGeom.mjGEOM_CAPSULE.value
    half_lengths = np.where(capsules, model.geom_size[parts, 1], 0.0)
    posture.qpos[:] = qpos
    mujoco.mj_kinematics(model, posture)
    middles, axes = posture.geom_xpos[parts], posture.geom_xmat[parts].reshape(-1, 3, 3)[:, :, 2]
    reach = half_lengths[:, None] * axes
    return np.concatenate([middles - reach, middles + reach])


def _free_camera(angles_deg: tuple[float, float], distance_m: float) -> mujoco.MjvCamera:
    import mujoco

    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.azimuth, camera.elevation = angles_deg
    camera.distance = distance_m
    return camera


def _options() -> mujoco.MjvOption:
    import mujoco

    option = mujoco.MjvOption()
    mujoco.mjv_defaultOption(option)
    option.flags[mujoco.mjtVisFlag.mjVIS_ACTUATOR] = False
    return option


def model_to_draw(config: RunConfig) -> tuple[mujoco.MjModel, NDArray[np.int64]]:
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

"""A 3D worm drawn by MuJoCo: as a run recorded it, or in postures that are given one by one."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from importlib import import_module
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from annelid.config import RunConfig
from annelid.draw.camera import FIELD_OF_VIEW_DEG, FIXED, fitting_distance, view_angles
from annelid.draw.drawn_worm import DrawnRobot, DrawnWorm, dim
from annelid.draw.gl import find_backend
from annelid.draw.overlay import Overlay, background_of
from annelid.draw.strands import StrandBodies
from annelid.errors import RenderingUnavailable, RunFileError
from annelid.protocols import Array
from annelid.simulation.anatomy import Anatomy
from annelid.simulation.runfile import Run

ROOM = 1.3
"""A camera that cannot know what is to come keeps this many times the distance from which the worm at rest fits."""


class _Scene(AbstractContextManager):
    """Off-screen pictures of a worm from a named view, at the distance from which all of some points are seen.

    The points are offsets from what the camera looks at, m, ``(n, 3)``; it keeps ``room`` times their distance.

    Unlike `mujoco.Renderer`, whose back-end is fixed when `mujoco` is first imported, it takes the back-end that
    `find_backend` chose. Smooth edges (``fine``) cost twice the time where software draws.
    """

    def __init__(
        self,
        worm: DrawnWorm,
        size: tuple[int, int],
        camera: str,
        offsets_m: Array,
        *,
        fine: bool,
        background: str = "floor",
        words: bool = True,
        room: float = 1.0,
    ) -> None:
        angles_deg = view_angles(camera)
        distance_m = room * fitting_distance(offsets_m @ worm.upright.T, *angles_deg, size[0] / size[1])
        backend, model = find_backend(), worm.model
        dim(model, angles_deg[1])
        if camera in FIXED:
            fog = model.vis.map
            fog.fogstart, fog.fogend = 2.0 * distance_m / model.stat.extent, 6.0 * distance_m / model.stat.extent
        model.vis.global_.offwidth, model.vis.global_.offheight = size
        model.vis.quality.offsamples = 4 if fine else 0
        self._worm, self._size = worm, size
        self.legend = worm.legend()
        self.pixels_per_m = size[1] / (2.0 * math.tan(math.radians(FIELD_OF_VIEW_DEG) / 2) * distance_m)
        behind = background_of(background)
        self._overlay = Overlay(size, self.legend, self.pixels_per_m, behind.ink, behind.haze) if words else None
        self.camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, self.camera)
        self.camera.azimuth, self.camera.elevation = angles_deg
        self.camera.distance = distance_m
        # The rings stand for the actuators.
        self._option = mujoco.MjvOption()
        self._option.flags[mujoco.mjtVisFlag.mjVIS_ACTUATOR] = False
        self._context: Any = None
        self._buffers: Any = None
        try:
            module = import_module(f"mujoco.{'glfw' if backend in ('glx', 'wgl') else backend}")
            self._context = module.GLContext(*size)
            self._context.make_current()
            self._buffers = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150.value)
        except (ImportError, AttributeError, RuntimeError, OSError, mujoco.FatalError) as error:
            self.close()
            raise RenderingUnavailable(f"the OpenGL back-end {backend} failed: {error}") from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._buffers)
        self._scene = mujoco.MjvScene(model, maxgeom=50_000)
        for flag, shown in (("SHADOW", True), ("SKYBOX", True), ("REFLECTION", False), ("FOG", True)):
            self._scene.flags[getattr(mujoco.mjtRndFlag, f"mjRND_{flag}")] = shown

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Frees the back-end."""
        for part in (self._buffers, self._context):
            if part is not None:
                part.free()
        self._buffers = self._context = None

    def _draw(
        self, qpos: NDArray[np.floating], activation: NDArray[np.floating] | None, target_m: Array, caption: str = ""
    ) -> NDArray[np.uint8]:
        worm, camera, scene = self._worm, self.camera, self._scene
        worm.pose(qpos, activation)
        camera.lookat[:] = target_m
        # Another scene may have been opened in between.
        self._context.make_current()
        parts = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(worm.model, worm.posture, self._option, None, camera, parts, scene)
        worm.complete(scene)
        for eye in scene.camera:
            eye.pos = camera.lookat + (eye.pos - camera.lookat) @ worm.upright
            eye.forward, eye.up = eye.forward @ worm.upright, eye.up @ worm.upright
        width, height = self._size
        pixels = np.empty((height, width, 3), dtype=np.uint8)
        view = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(view, scene, self._buffers)
        mujoco.mjr_readPixels(pixels, None, view, self._buffers)
        return pixels[::-1] if self._overlay is None else self._overlay.stamped(pixels[::-1], caption)


class WormScene(_Scene):
    """Pictures of a 3D worm's run from a named view, see `annelid.draw.camera.VIEWS_DEG`.

    The background is one of `annelid.draw.overlay.BACKGROUNDS`; ``words`` are the legend, a scale bar and the time.
    """

    def __init__(
        self,
        run: Run,
        width: int,
        height: int,
        camera: str,
        *,
        fine: bool,
        background: str = "floor",
        words: bool = True,
    ) -> None:
        worm = (DrawnWorm if run.config.body.own_model is None else DrawnRobot)(run.config, background)
        self.times_s: Array = run.data["frame_time"].values
        self._qpos = postures_of(run, worm.model.nq)
        self._activation = run.data["activation"]
        points = np.stack([worm.outline(qpos) for qpos in self._qpos])
        box_middle = _middle(points.reshape(-1, 3))
        seen = run.data["crossing_position"].values if "crossing_position" in run.data else points
        self._target = seen.mean(axis=1)
        self._target[:, 2] = box_middle[2]
        if camera in FIXED:
            self._target[:] = box_middle
        offsets = (points - self._target[:, None]).reshape(-1, 3)
        super().__init__(worm, (width, height), camera, offsets, fine=fine, background=background, words=words)

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Draws one recorded frame, as pixels of shape ``(height, width, 3)``."""
        time_s = float(self.times_s[frame])
        activation = self._activation.sel(time=time_s, method="nearest").values
        return self._draw(self._qpos[frame], activation, self._target[frame], f"{time_s:.2f} s")


class PostureScene(_Scene):
    """Pictures of a 3D worm in postures that are given one by one, from a named view.

    The camera looks at the worm's middle, from a distance that leaves it room to stretch.
    """

    def __init__(self, config: RunConfig, width: int, height: int, camera: str) -> None:
        worm = DrawnWorm(config)
        points = worm.outline(worm.model.qpos0)
        super().__init__(worm, (width, height), camera, points - _middle(points), fine=False, room=ROOM)

    def picture(self, qpos: Array, activation: Array, caption: str) -> NDArray[np.uint8]:
        """Draws a posture, with activation ``(n_muscles,)``, as pixels of shape ``(height, width, 3)``."""
        return self._draw(qpos, activation, _middle(self._worm.outline(qpos)), caption)


def postures_of(run: Run, n_coordinates: int) -> NDArray[np.floating]:
    """Returns the generalised positions of every frame of a 3D worm's run, ``(n_frames, n_coordinates)``.

    Args:
        run: The run.
        n_coordinates: Of the body that is built from its configuration.

    Raises:
        RunFileError: No postures were recorded, or those of another body than is built from the configuration.
    """
    data = run.data
    if "qpos" not in data or data.sizes.get("frame", 0) == 0:
        raise RunFileError(f"{run.path} holds no recorded postures to draw")
    if data.sizes["coordinate"] != n_coordinates:
        raise RunFileError(
            f"{run.path} holds postures of {data.sizes['coordinate']} coordinates, but the body built "
            f"from its configuration has {n_coordinates}: it was written by another version"
        )
    return data["qpos"].values


class Skeleton:
    """Where strands and crossings of a compiled worm are in a posture, with an engine state of its own: ``data``."""

    def __init__(self, anatomy: Anatomy) -> None:
        self.anatomy = anatomy
        self.data = mujoco.MjData(anatomy.model)
        self._strands = StrandBodies(anatomy.model, anatomy.geometry)

    def locate(self, qpos: NDArray[np.floating]) -> tuple[Array, Array]:
        """Returns the curves of the strands, m, as `strand_curves`, and the crossings, ``(n_crossings, 3)``."""
        self.data.qpos[:] = self.anatomy.own(qpos)
        crossing, *_ = self.anatomy.locate(self.data)
        return self._strands.curves(self.data)[0], crossing


def geom_places(data: mujoco.MjData, geoms: NDArray[np.int64]) -> tuple[Array, Array]:
    """Returns centres, m, ``(n, 3)``, and quaternions, ``(n, 4)``, of n geoms."""
    turns = np.empty((len(geoms), 4))
    for turn, axes in zip(turns, data.geom_xmat[geoms], strict=True):
        mujoco.mju_mat2Quat(turn, axes)
    return data.geom_xpos[geoms], turns


def _middle(points_m: Array) -> Array:
    """Middle of the box about points, m, ``(point, 3)``."""
    return (points_m.min(axis=0) + points_m.max(axis=0)) / 2

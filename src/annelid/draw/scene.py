"""A 3D worm drawn by MuJoCo: posed from a run's recorded postures, or in postures that are given one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from annelid.config import RunConfig, WormBody
from annelid.draw.camera import FIXED, fitting_distance, view_angles
from annelid.draw.drawn_worm import DrawnWorm, free_camera, middle, options
from annelid.draw.gl import Canvas, find_backend
from annelid.draw.postures import postures_of

if TYPE_CHECKING:
    from annelid.simulation.runfile import Run

ROOM = 1.3
"""A camera that cannot know what is to come keeps this many times the distance from which the worm at rest fits."""


class WormScene:
    """Pictures of a 3D worm's run, used as a context manager."""

    def __init__(self, run: Run, width: int, height: int, camera: str, *, fine: bool) -> None:
        """Builds the model of the run's own configuration.

        Args:
            run: The run.
            width: Pixels.
            height: Pixels.
            camera: Name of a view, see `annelid.draw.camera.VIEWS_DEG`.
            fine: Shadows and smooth edges.

        Raises:
            RunFileError: No postures recorded, they do not fit the model, or no such camera.
            RenderingUnavailable: No OpenGL back-end works.
        """
        assert isinstance(run.config.body, WormBody)
        angles = view_angles(camera, run.config.body.heading_deg)
        data = run.data
        backend = find_backend()
        self._run = run
        self.times_s: NDArray[np.float64] = data["frame_time"].values
        self._worm = DrawnWorm(run.config)
        self._worm.light_for(angles[1])
        model = self._worm.model
        self._qpos = postures_of(run, model.nq)
        self._target = data["crossing_position"].values.mean(axis=1)
        points = np.stack([self._worm.part_ends(qpos) for qpos in self._qpos])
        self._target[:, 2] = (points[:, :, 2].min() + points[:, :, 2].max()) / 2
        if camera in FIXED:
            self._target[:] = (points.min(axis=(0, 1)) + points.max(axis=(0, 1))) / 2
        offsets = (points - self._target[:, None]).reshape(-1, 3) @ self._worm.upright.T
        distance = fitting_distance(offsets, *angles, width / height)
        if camera in FIXED:
            far = distance / model.stat.extent
            model.vis.map.fogstart, model.vis.map.fogend = 2.0 * far, 6.0 * far
        self._camera, self._option = free_camera(angles, distance), options()
        self._canvas = Canvas(model, width, height, backend, fine=fine)

    def __enter__(self) -> Self:
        self._canvas.__enter__()
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
        time_s = float(self.times_s[frame])
        self._worm.pose(self._qpos[frame])
        self._worm.color_rings(self._run.data["activation"].sel(time=time_s, method="nearest").values)
        self._camera.lookat[:] = self._target[frame]
        return self._canvas.draw(
            self._worm.posture, self._camera, self._option, f"{time_s:.2f} s", upright=self._worm.upright
        )


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
            camera: Name of a view, see `annelid.draw.camera.VIEWS_DEG`.

        Raises:
            RunFileError: There is no such camera.
            RenderingUnavailable: No OpenGL back-end works.
        """
        angles = view_angles(camera)
        backend = find_backend()
        self._worm = DrawnWorm(config)
        self._worm.light_for(angles[1])
        points = self._worm.part_ends(self._worm.model.qpos0)
        offsets = (points - middle(points)) @ self._worm.upright.T
        distance = ROOM * fitting_distance(offsets, *angles, width / height)
        # The model's own rest has no heading.
        assert isinstance(config.body, WormBody)
        self._camera = free_camera(view_angles(camera, config.body.heading_deg), distance)
        self._option = options()
        self._canvas = Canvas(self._worm.model, width, height, backend, fine=False)
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
        self._camera.lookat[:] = middle(self._worm.part_ends(qpos))
        self._worm.pose(qpos)
        self._worm.color_rings(activation)
        return self._canvas.draw(self._worm.posture, self._camera, self._option, caption, upright=self._worm.upright)

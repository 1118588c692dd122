"""One posture of a 3D worm on white, which marks can be drawn on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.config import RunConfig
from annelid.draw.camera import fitting_distance, picture_points
from annelid.draw.drawn_worm import DrawnWorm, free_camera, middle, options
from annelid.draw.gl import Canvas, find_backend
from annelid.draw.style import CONTRACTED

STILL_AMBIENT = 0.7
"""Without a floor that it would bleach, there may be more light from all sides."""
PALE = 3.0
"""On white, what lies this many half worms behind its middle would vanish."""


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
    backend = find_backend()
    worm = DrawnWorm(config)
    model = worm.model
    if activation is None:
        model.tendon_rgba[:] = (*CONTRACTED, 1.0)
    else:
        worm.color_rings(activation)
    model.geom_rgba[model.geom_bodyid == 0, 3] = 0.0
    model.vis.headlight.ambient[:] = STILL_AMBIENT
    drawn = model.qpos0 if qpos is None else qpos
    points = worm.part_ends(drawn)
    target = middle(points)
    distance = fitting_distance(points - target, *angles_deg, size[0] / size[1])
    reach = float(np.linalg.norm(points - target, axis=1).max()) / model.stat.extent
    model.vis.rgba.fog[:] = 1.0
    model.vis.map.fogstart = distance / model.stat.extent - reach
    model.vis.map.fogend = distance / model.stat.extent + PALE * reach
    worm.pose(drawn)
    camera = free_camera(angles_deg, distance)
    camera.lookat[:] = target
    with Canvas(model, *size, backend) as canvas:
        return Still(canvas.draw(worm.posture, camera, options()), target, angles_deg, distance)

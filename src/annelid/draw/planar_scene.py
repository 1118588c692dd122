"""The planar worms, drawn with matplotlib from their recorded outlines, or from heights and lengths alone."""

from __future__ import annotations

from contextlib import AbstractContextManager
from itertools import chain
from typing import Any

import numpy as np
from matplotlib.patches import Polygon
from matplotlib.text import Text
from numpy.typing import NDArray

from annelid.draw.canvas import activation_color, canvas
from annelid.errors import RunFileError
from annelid.simulation.runfile import Run

_DPI = 100
_CM = 100.0
_ROOM = 1.08
_WALL = "0.75"


class PlanarScene(AbstractContextManager):
    """Pictures of a planar worm's run, ``width`` and ``height`` in pixels.

    Each segment is a rhombus, from segment 1 on the left, coloured by its activation. A worm that has forces is drawn
    where it is, with its sides bent as they are and the walls of its pipe; a kinematic one has nothing to push
    against, so the pictures keep its middle in place.
    """

    def __init__(self, run: Run, width: int, height: int, *, dark: bool = False) -> None:
        data = run.data
        if data.sizes.get("time", 0) == 0:
            raise RunFileError(f"{run.path} holds no samples to draw")
        self.times_s: NDArray[np.float64] = data["time"].values
        self._lengths = _CM * data["stretch_length"].values[:, :, 0]
        self._heights = _CM * data["ring_length"].values
        self._outline = _CM * data["outline"].values if "outline" in data else None
        self._activation = data["activation"].values
        with canvas(height / _DPI, width / _DPI, dark=dark) as figure:
            figure.set_dpi(_DPI)
            self._canvas: Any = figure.canvas
            self._axes = axes = figure.add_subplot()
            xlabel = "along the body (cm)" if self._outline is None else "x (cm)"
            axes.set(aspect="equal", xlabel=xlabel, ylabel="height (cm)", xlim=self._extent())
            half_height = _ROOM * self._heights.max() / 2
            if (distance_m := run.config.body.wall_distance_m) is not None:
                wall_height = _CM * distance_m / 2
                half_height = max(half_height, 1.25 * wall_height)
                axes.axhspan(wall_height, 2 * half_height, color=_WALL, linewidth=0, zorder=0)
                axes.axhspan(-2 * half_height, -wall_height, color=_WALL, linewidth=0, zorder=0)
            axes.set_ylim(-half_height, half_height)
            self._title = axes.set_title(" ", animated=True)
            look: dict[str, Any] = {"ha": "center", "va": "center", "color": "w", "size": 13, "weight": "bold"}
            self._rhombi: list[tuple[Polygon, Text]] = []
            for i in range(self._lengths.shape[1]):
                patch = Polygon(
                    np.zeros((4, 2)), closed=True, edgecolor="0.9" if dark else "0.15", linewidth=1.2, animated=True
                )
                axes.add_patch(patch)
                self._rhombi.append((patch, axes.text(0, 0, str(i + 1), animated=True, **look)))
            self._canvas.draw()
        # Axes and grid stay as they are, so each picture redraws the worm only: a tenth of the time.
        self._background = self._canvas.copy_from_bbox(figure.bbox)

    def __exit__(self, *_: object) -> None:
        self._canvas.figure.clear()

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Draws one recorded sample, as pixels of shape ``(height, width, 3)``."""
        if self._outline is None:
            corners = rhombi(self._lengths[frame], self._heights[frame])
        else:
            corners = bent_rhombi(self._outline[frame], len(self._rhombi))
        for i, (patch, label) in enumerate(self._rhombi):
            patch.set_xy(corners[i])
            patch.set_facecolor(activation_color(float(self._activation[frame, i])))
            label.set_position(corners[i].mean(axis=0))
        self._title.set_text(f"{self.times_s[frame]:.2f} s   (red: contracted, grey: relaxed)")
        self._canvas.restore_region(self._background)
        for artist in (*chain(*zip(*self._rhombi, strict=True)), self._title):
            self._axes.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _extent(self) -> tuple[float, float]:
        """Left and right limit of all pictures, cm."""
        if self._outline is None:
            half_length = _ROOM * float(self._lengths.sum(axis=1).max()) / 2
            return -half_length, half_length
        x = self._outline[:, :, 0]
        margin = (_ROOM - 1) / 2 * float(np.ptp(x))
        return float(x.min()) - margin, float(x.max()) + margin


def bent_rhombi(outline: NDArray[np.float64], n_segments: int) -> NDArray[np.float64]:
    """Closes each segment's part of the upper outline with its mirror image.

    Args:
        outline: Corners of the upper side, front to back, m, ``(n_segments * n + 1, 2)``.
        n_segments: Segments.

    Returns:
        Corners round each segment, shape ``(n_segments, 2 n, 2)``.
    """
    n = (len(outline) - 1) // n_segments
    upper = outline[n * np.arange(n_segments)[:, np.newaxis] + np.arange(n + 1)]
    return np.concatenate([upper, upper[:, -2:0:-1] * [1.0, -1.0]], axis=1)


def rhombi(lengths: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Puts rhombi in a row with its middle at the origin.

    Args:
        lengths: Horizontal diagonals, m, ``(n_segments,)``.
        heights: Vertical diagonals, m, ``(n_segments,)``.

    Returns:
        Corners (left, top, right, bottom), shape ``(n_segments, 4, 2)``.
    """
    tips = np.concatenate(([0.0], np.cumsum(lengths))) - lengths.sum() / 2
    corners = np.zeros((len(lengths), 4, 2))
    corners[:, 0, 0], corners[:, 2, 0] = tips[:-1], tips[1:]
    corners[:, 1::2, 0] = ((tips[:-1] + tips[1:]) / 2)[:, np.newaxis]
    corners[:, 1, 1], corners[:, 3, 1] = heights / 2, -heights / 2
    return corners

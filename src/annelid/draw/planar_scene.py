"""A planar body, drawn with matplotlib from the outlines that it gives of what it has recorded."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray

from annelid.draw.canvas import activation_color, canvas
from annelid.errors import RunFileError
from annelid.simulation.runfile import Run

_DPI = 100
_CM = 100.0
_ROOM = 1.08
_WALL = "0.75"


class PlanarScene(AbstractContextManager):
    """Pictures of a planar body's run, ``width`` and ``height`` in pixels.

    Each segment is what `BodyKind.outlines` says, coloured by its activation, between the walls of a pipe if there are
    some.
    """

    def __init__(self, run: Run, width: int, height: int, *, dark: bool = False) -> None:
        data = run.data
        if data.sizes.get("time", 0) == 0:
            raise RunFileError(f"{run.path} holds no samples to draw")
        self.times_s: NDArray[np.float64] = data["time"].values
        body, recorded = run.config.body, {str(name): signal.values for name, signal in data.items()}
        self._corners = _CM * body.outlines(recorded)
        self._activation = data["activation"].values
        travels = "center_of_mass" in data and np.isfinite(recorded["center_of_mass"]).all()
        low, high = self._corners.min(axis=(0, 1, 2)), self._corners.max(axis=(0, 1, 2))
        room = (_ROOM - 1) / 2 * (high - low)
        low, high = low - room, high + room
        with canvas(height / _DPI, width / _DPI, dark=dark) as figure:
            figure.set_dpi(_DPI)
            self._canvas: Any = figure.canvas
            self._axes = axes = figure.add_subplot()
            xlabel = "x (cm)" if travels else "along the body (cm)"
            axes.set(aspect="equal", xlabel=xlabel, ylabel="height (cm)", xlim=(low[0], high[0]))
            if (distance_m := body.wall_distance_m) is not None:
                wall = _CM * distance_m / 2
                low[1], high[1] = min(low[1], -1.25 * wall), max(high[1], 1.25 * wall)
                axes.axhspan(wall, 2 * high[1], color=_WALL, linewidth=0, zorder=0)
                axes.axhspan(2 * low[1], -wall, color=_WALL, linewidth=0, zorder=0)
            axes.set_ylim(low[1], high[1])
            self._title = axes.set_title(" ", animated=True)
            look: dict[str, Any] = {"ha": "center", "va": "center", "color": "w", "size": 13, "weight": "bold"}
            self._bodies = PolyCollection([], edgecolor="0.9" if dark else "0.15", linewidth=1.2, animated=True)
            axes.add_collection(self._bodies)
            numbers = range(1, self._corners.shape[1] + 1)
            self._numbers = [axes.text(0, 0, str(number), animated=True, **look) for number in numbers]
            self._canvas.draw()
        # Axes and grid stay as they are, so each picture redraws the worm only: a tenth of the time.
        self._background = self._canvas.copy_from_bbox(figure.bbox)

    def __exit__(self, *_: object) -> None:
        self._canvas.figure.clear()

    def picture(self, frame: int) -> NDArray[np.uint8]:
        """Draws one recorded sample, as pixels of shape ``(height, width, 3)``."""
        corners = self._corners[frame]
        self._bodies.set_verts(list(corners))
        self._bodies.set_facecolor([activation_color(share) for share in self._activation[frame].tolist()])
        for number, middle in zip(self._numbers, corners.mean(axis=1).tolist(), strict=True):
            number.set_position(middle)
        self._title.set_text(f"{self.times_s[frame]:.2f} s   (red: contracted, grey: relaxed)")
        self._canvas.restore_region(self._background)
        for artist in (self._bodies, *self._numbers, self._title):
            self._axes.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

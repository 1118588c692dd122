"""Curvature and radius against modulation, and the tracks of one gait."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.track import Track
from annelid.draw.canvas import canvas, save_both
from annelid.draw.lines import draw_lines
from annelid.draw.style import panel_title, segment_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LARGEST_RADIUS_M = 20.0
"""Where the axis of the radius ends: a worm that turns more weakly than this goes straight."""

Values = NDArray[np.float64]
Line = tuple[Values, Values]
"""Modulations and curvatures (1/m, positive to the left)."""


def turning_figure(lines: Mapping[str, Line], tracks: Mapping[float, Track], title: str, stem: str | Path) -> Path:
    """Draws curvature and radius against modulation, one line a gait, and the tracks of one of them.

    Args:
        lines: By the name of the gait.
        tracks: By modulation.
        title: Name of the gait whose tracks they are.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    with canvas(5.6) as figure:
        grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.25])
        curvature, radius = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[1, 0])
        from_above = figure.add_subplot(grid[:, 1])
        draw_lines(curvature, lines, markersize=4.5)
        panel_title(curvature, "Curvature, positive to the left")
        curvature.set_ylabel("1/m")
        radii = {name: (x, 1.0 / np.maximum(np.abs(bend), 1e-9)) for name, (x, bend) in lines.items()}
        draw_lines(radius, radii, markersize=4.5)
        panel_title(radius, "Radius")
        radius.set_ylabel("m")
        radius.set_xlabel("modulation")
        radius.set_yscale("log")
        radius.set_ylim(top=_LARGEST_RADIUS_M)
        _tracks(from_above, tracks)
        panel_title(from_above, f"Tracks: {title}")
        handles, labels = curvature.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        return save_both(figure, stem)


def _tracks(axes: Axes, tracks: Mapping[float, Track]) -> None:
    """Middles of the body, every one from the same start, with the outline at the end."""
    for (modulation, track), color in zip(sorted(tracks.items()), segment_colors(len(tracks)), strict=True):
        start = track.middle_m[0]
        axes.plot(*(track.middle_m - start).T, color=color, linewidth=1.4)
        axes.plot(*(track.outline_m(-1) - start).T, color=color, linewidth=0.6)
        x, y = track.front_m[-1] - start
        axes.annotate(f"{modulation:g}", (x, y), color=color, fontsize=7, ha="center", va="center")
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")

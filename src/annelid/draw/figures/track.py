"""A worm's track seen from above, in the coordinates of its run: the worm leads towards -x, and its left is -y."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.analysis.track import Track, track_of
from annelid.config import RunConfig
from annelid.config.answers import Goals
from annelid.draw.canvas import WIDTH_IN, canvas, panel_title, save
from annelid.draw.figures import RUN_FIGURES
from annelid.draw.plots import plot_path
from annelid.simulation.runfile import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

N_OUTLINES = 6  # outlines drawn, the first and the last posture among them
FIRST, LAST = "#9bb0c9", "#1b2a6b"
FRONT = "#c2410c"
WALL = "#bf784d"
INK = "0.15"
_EDGE_IN = 1.3  # room that labels take beside the plot, inches
_HEIGHTS_IN = (2.6, 8.5)  # least and largest of the figure


def track_figure(run: Run, path: str | Path) -> Path:
    """Draws where a 3D worm crawled: middle, front, outlines from light to dark, walls and waypoints.

    Both axes have the same scale. The plot is turned so that the worm starts out to the left and its left is below, as
    it is seen from above.

    Args:
        run: The run.
        path: File to write; its suffix chooses the format (``.png``, ``.pdf``, ``.svg``).

    Returns:
        The path written.

    Raises:
        RunFileError: A planar worm, a run of fewer than two postures, or a file that cannot be written.
    """
    path = plot_path(path)
    track = track_of(run)
    with canvas(_HEIGHTS_IN[0]) as figure:
        axes = figure.subplots()
        _draw_track(axes, track)
        _draw_marks(axes, run.config)
        height = (WIDTH_IN - _EDGE_IN) * axes.dataLim.height / axes.dataLim.width + _EDGE_IN
        figure.set_figheight(float(np.clip(height, *_HEIGHTS_IN)))
        panel_title(axes, f"{run.config.name}: track of {track.time_s[-1]:g} s, seen from above")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower right", ncols=4)
        return save(figure, path)


RUN_FIGURES.add("track", track_figure)


def _draw_track(axes: Axes, track: Track) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    shades = LinearSegmentedColormap.from_list("ages", [FIRST, LAST])
    samples = np.linspace(0, len(track.time_s) - 1, N_OUTLINES).round().astype(int)
    for place, sample in enumerate(samples):
        shade = shades(place / (N_OUTLINES - 1))
        axes.fill(*track.outline_m(sample).T, facecolor=(*shade[:3], 0.12), edgecolor=shade, linewidth=0.9)
        x, y = track.middle_m[sample]
        # Below the line that it would hide.
        below: Any = {"xytext": (0, -4), "textcoords": "offset points", "ha": "center", "va": "top"}
        axes.annotate(f"{track.time_s[sample]:.0f} s", (x, y), color=INK, fontsize=7, **below)
    axes.plot(*track.front_m.T, color=FRONT, linewidth=0.7, label="foremost ring")
    axes.plot(*track.middle_m.T, color=LAST, linewidth=1.6, label="middle of the body")
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")


def _draw_marks(axes: Axes, config: RunConfig) -> None:
    """Draws posts and guard rails, and waypoints with the circle within which each counts as reached."""
    from matplotlib.patches import Circle

    if config.arena is not None:
        rail_gap_m, posts = config.arena.walls
        for number, (x, y, radius) in enumerate(posts):
            axes.add_patch(Circle((x, y), radius, facecolor=WALL, edgecolor="none", label="_" * (number > 0) + "post"))
        if rail_gap_m is not None:
            for side in (-0.5, 0.5):
                axes.axhline(side * rail_gap_m, color=WALL, linewidth=2.0)
    goals = _goals(config)
    for number, point in enumerate(goals.points_m, start=1):
        label = "_" * (number > 1) + "waypoint, reached within the circle"
        axes.add_patch(Circle(point, goals.reach_m, fill=False, color="0.6", linestyle=":", label=label))
        axes.annotate(str(number), point, fontsize=8, color="0.3", ha="center", va="center")


def _goals(config: RunConfig) -> Goals:
    return config.turning.goals if config.turning is not None else Goals()

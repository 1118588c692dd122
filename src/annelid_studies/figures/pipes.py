"""Why a wave that adapts is faster in a narrowing pipe, and speed in bends against their radius."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.passage import Passage
from annelid.draw.canvas import canvas, save_both
from annelid.draw.lines import draw_lines
from annelid.draw.style import panel_title, segment_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from annelid.simulation.runfile import Run

Array = NDArray[np.float64]
WINDOW_S = 5.25
"""Speed and drive are means over this time, the undriven wave's cycle."""
CM = 100.0


@dataclass(frozen=True)
class Way:
    """What is drawn of one run in a pipe that narrows, at the times of its postures.

    Attributes:
        front_m: Where the foremost ring is along the centre line, m, ``(n,)``.
        bore_m: Radius of the bore there, m, ``(n,)``.
        speed_m_per_s: Speed of the middle, m/s, ``(n,)``.
        drive: Activity of the descending neuron, ``(n,)``; zeros without one.
        first_ring_m: Length of the foremost ring, m, ``(n,)``.
    """

    front_m: Array
    bore_m: Array
    speed_m_per_s: Array
    drive: Array
    first_ring_m: Array

    @classmethod
    def of(cls, run: Run, passage: Passage) -> Self:
        """Reads it from a run."""
        data, time = run.data, run.data["time"].values
        rings = data["ring_length"].values.reshape(len(time), run.config.body.n_segments, -1).sum(axis=2)
        drive = data["drive"].values if "drive" in data else np.zeros(len(time))
        smooth = np.array([drive[np.abs(time - now) <= WINDOW_S / 2].mean() for now in passage.time_s])
        return cls(
            passage.front_m,
            passage.bore_m[:, 0],
            passage.speed_over_m_per_s(WINDOW_S),
            smooth,
            np.interp(passage.time_s, time, rings[:, 0]),
        )


@dataclass(frozen=True)
class BendLine:
    """Speeds of one controller in bends.

    Attributes:
        radius_m: Radii of the centre line, m.
        speed_m_per_s: Speed along it, m/s.
        passed: Whether the worm came through.
    """

    radius_m: Sequence[float]
    speed_m_per_s: Sequence[float]
    passed: Sequence[bool]


def pipes_figure(ways: Mapping[tuple[str, str], Way], bends: Mapping[str, BendLine], stem: str | Path) -> Path:
    """Draws a column for every narrowing pipe, and the bends below.

    Args:
        ways: By the name of the pipe and of the gait.
        bends: By the name of the controller.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    pipes = list(dict.fromkeys(pipe for pipe, _ in ways))
    gaits = list(dict.fromkeys(gait for _, gait in ways))
    colors = dict(zip(gaits, segment_colors(max(len(gaits), 3)), strict=False))
    with canvas(8.4) as figure:
        grid = figure.add_gridspec(4, max(len(pipes), 1), height_ratios=[1.0, 1.0, 1.0, 1.4])
        for column, pipe in enumerate(pipes):
            rows = [figure.add_subplot(grid[row, column]) for row in range(3)]
            panel_title(rows[0], f"{pipe}: speed of the middle (cm/s)")
            panel_title(rows[1], "drive of the descending neuron")
            panel_title(rows[2], "foremost ring (cm); dashed: the bore")
            for gait in gaits:
                if (pipe, gait) in ways:
                    way, style = ways[pipe, gait], {"color": colors[gait], "linewidth": 1.1, "alpha": 0.85}
                    for axes, values in zip(
                        rows, (CM * way.speed_m_per_s, way.drive, CM * way.first_ring_m), strict=True
                    ):
                        axes.plot(way.front_m, values, label=gait, **style)
            bore = max((ways[key] for key in ways if key[0] == pipe), key=lambda way: way.front_m.max())
            order = np.argsort(bore.front_m)
            # The ring is the hexagon of six crossings that lie in the bore.
            rows[2].plot(bore.front_m[order], CM * 6.0 * bore.bore_m[order], color="0.3", linestyle=(0, (4, 3)))
            rows[2].set_xlabel("foremost ring along the pipe (m)")
            rows[1].set_ylim(-0.05, 1.05)
            if column == 0:
                rows[0].legend(loc="best")
        _bends(figure.add_subplot(grid[3, :]), bends)
        return save_both(figure, stem)


def _bends(axes: Axes, bends: Mapping[str, BendLine]) -> None:
    lines = {name: (line.radius_m, CM * np.array(line.speed_m_per_s)) for name, line in bends.items()}
    draw_lines(axes, lines, markerfacecolor="none")
    for (radius, speed), line, drawn in zip(lines.values(), bends.values(), list(axes.lines), strict=True):
        passed = np.array(line.passed, dtype=bool)
        style = {"color": drawn.get_color(), "marker": drawn.get_marker(), "linestyle": "none"}
        axes.plot(np.array(radius)[passed], speed[passed], **style)
    panel_title(axes, "Bends of 90 degrees: speed along the centre line (cm/s); filled: the worm came through")
    axes.set_xlabel("radius of the centre line (m)")
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="best", ncols=2)

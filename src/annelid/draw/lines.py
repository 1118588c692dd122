"""Numbers over one parameter: lines in a panel, and loops of force over displacement."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.draw.canvas import canvas, save_both
from annelid.draw.style import plain, segment_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKERS = ("o", "s", "^", "D", "v")
_MM = 1e3


def draw_lines(
    axes: Axes, lines: Mapping[str, tuple[ArrayLike, ArrayLike]], *, markers: bool = True, **style: Any
) -> None:
    """Draws lines, each in a colour and with a marker of its own; crosses on the lower edge mark where one is NaN.

    Args:
        axes: Where to draw.
        lines: Values of the parameter and numbers, each ``(n,)``, by the name in the legend.
        markers: Whether the lines have markers.
        **style: Further properties of the lines, as matplotlib takes them.
    """
    shapes = cycle(MARKERS if markers else [""])
    for (name, (x, y)), color, marker in zip(lines.items(), segment_colors(len(lines)), shapes, strict=False):
        place, value = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        axes.plot(place, value, color=color, marker=marker, label=plain(name), **style)
        mark_lost(axes, place[np.isnan(value)], color)


def mark_lost(axes: Axes, places: ArrayLike, color: Any, height: float = 0.04) -> None:
    """Draws crosses near the lower edge, at a share of the panel's height, where there are no numbers."""
    if np.size(places):
        level = np.full(np.shape(places), height)
        axes.plot(places, level, "x", color=color, transform=axes.get_xaxis_transform(), markersize=5.0)


def load_frame_figure(loops: Mapping[str, tuple[ArrayLike, ArrayLike]], stem: str | Path) -> Path:
    """Draws loops of a ring cable's force against its displacement over one another, the first in front.

    Args:
        loops: Displacement (m) and force (N) of the cable, each ``(n,)``, by the name in the legend.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    with canvas(3.6) as figure:
        axes = figure.subplots()
        draw_lines(axes, {name: (_MM * np.asarray(x), y) for name, (x, y) in loops.items()}, markers=False)
        for order, line in enumerate(axes.lines):
            line.set(zorder=3 - order, linewidth=0.9 if order else 1.6)
        axes.set_xlabel("displacement of the cable (mm); a third of it is the change of diameter")
        axes.set_ylabel("force of the cable (N)")
        axes.legend(loc="upper left")
        return save_both(figure, stem)

"""Loops of a ring cable's force against its displacement, simulated and measured."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from annelid.draw.canvas import canvas, save_both
from annelid.draw.style import plain, segment_colors
from annelid.morphology import Array

_MM = 1e3
_LINE_WIDTHS = (1.6, 0.9)


def load_frame_figure(loops: Mapping[str, tuple[Array, Array]], stem: str | Path) -> Path:
    """Draws loops over one another, the first in front.

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
        colors = segment_colors(len(loops))
        for order, ((name, (displacement, force)), color) in enumerate(zip(loops.items(), colors, strict=True)):
            width = _LINE_WIDTHS[order > 0]
            axes.plot(_MM * displacement, force, color=color, label=plain(name), zorder=3 - order, linewidth=width)
        axes.set_xlabel("displacement of the cable (mm); a third of it is the change of diameter")
        axes.set_ylabel("force of the cable (N)")
        axes.legend(loc="upper left")
        return save_both(figure, stem)

"""How fast gaits crawl: speed, cost of transport and slip over friction and number of segments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from annelid.draw.canvas import canvas, save_both
from annelid.draw.lines import draw_lines
from annelid.draw.style import panel_title

_ROWS = {
    "body_lengths_per_s": "speed (body lengths/s)",
    "cost_of_transport": "cost of transport",
    "slip_ratio": "slip ratio",
}


@dataclass(frozen=True)
class Line:
    """One gait over one quantity; None where it does not walk.

    Attributes:
        gait: Its name, for the legend.
        values: Values of the quantity, ``(n,)``.
        body_lengths_per_s: Speeds, ``(n,)``.
        cost_of_transport: ``(n,)``.
        slip_ratio: ``(n,)``.
    """

    gait: str
    values: tuple[float, ...]
    body_lengths_per_s: tuple[float | None, ...]
    cost_of_transport: tuple[float | None, ...]
    slip_ratio: tuple[float | None, ...]


def crawling_figure(lines: Mapping[str, Sequence[Line]], stem: str | Path) -> Path:
    """Draws a column for each quantity, and in it a panel for speed, cost of transport and slip, a line a gait.

    A cross on the lower edge marks where a gait does not walk.

    Args:
        lines: Lines by the quantity's label.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    with canvas(7.0) as figure:
        grid = figure.subplots(len(_ROWS), len(lines), squeeze=False, sharex="col", sharey="row")
        for letter, axes in zip("abcdefgh", grid.flat, strict=False):
            panel_title(axes, f"{letter})")
        for row, (name, label) in zip(grid, _ROWS.items(), strict=True):
            row[0].set_ylabel(label)
            for axes, of_quantity in zip(row, lines.values(), strict=True):
                draw_lines(axes, {one.gait: (one.values, getattr(one, name)) for one in of_quantity}, markersize=4.0)
            row[0].set_ylim(bottom=0.0)
        for axes, label in zip(grid[-1], lines, strict=True):
            axes.set_xlabel(label)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
        return save_both(figure, stem)

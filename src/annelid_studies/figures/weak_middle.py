"""The weak middle: how far interior segments stay below the ends, over body and ground, for every kind of actuator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.draw.canvas import canvas, save_both
from annelid.draw.style import panel_title, segment_colors
from annelid.morphology import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PERCENT = 100.0
_MARKERS = ("o", "o", "^", "s")
_DASHES = ("-", (0, (1.2, 1.2)), (0, (5, 2)), "-")
_FADED = "0.35"
_MARK = (0, (4, 3))


@dataclass(frozen=True)
class Panel:
    """One panel.

    Attributes:
        title: What is varied, in a few words.
        label: The same with its unit, for the axis.
        base: Its value at the worm that all panels share.
        lines: By the name in the legend: values and deficits (fractions, NaN where there is none), each ``(n,)``.
        logarithmic: Whether the axis is.
        names: Words for single values on the axis.
    """

    title: str
    label: str
    base: float
    lines: Mapping[str, tuple[Array, Array]]
    logarithmic: bool = False
    names: Mapping[float, str] = field(default_factory=dict)


def weak_middle_figure(panels: Sequence[Panel], marks: Mapping[str, float], stem: str | Path) -> Path:
    """Draws one panel for every quantity, one line for every kind of actuator.

    Args:
        panels: Panels with the same lines, of four kinds of actuators.
        marks: Deficits to compare with, fractions, by what they are of.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    deficits = [y for panel in panels for _, y in panel.lines.values()]
    top = PERCENT * max([*marks.values(), *(float(np.nanmax(y, initial=0.0)) for y in deficits)])
    with canvas(6.0) as figure:
        grid = figure.subplots((len(panels) + 1) // 2, 2, sharey=True, squeeze=False)
        for letter, axes, panel in zip("abcdefgh", grid.flat, panels, strict=False):
            _draw(axes, panel)
            panel_title(axes, f"{letter}) {panel.title}")
            for value in marks.values():
                axes.axhline(PERCENT * value, color=_FADED, linewidth=0.8, linestyle=_MARK, zorder=1)
            axes.set_ylim(0.0, 1.08 * top)
        for left, right in grid:
            left.set_ylabel("interior below the ends (%)")
            for name, value in marks.items():
                place, at = (1.0, PERCENT * value), {"xycoords": right.get_yaxis_transform(), "xytext": (4, 0)}
                words = {"textcoords": "offset points", "va": "center", "fontsize": 7.5, "color": _FADED}
                right.annotate(f"{name}\n{PERCENT * value:.0f} %", place, **at, **words)
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), handlelength=3.0)
        return save_both(figure, stem)


def _draw(axes: Axes, panel: Panel) -> None:
    styles = zip(segment_colors(4), _MARKERS, _DASHES, strict=True)
    for order, ((name, (x, y)), (color, marker, dashes)) in enumerate(zip(panel.lines.items(), styles, strict=True)):
        # Wherever the servo stalls its line lies on the force-limited one, so it is drawn as rings around that.
        ring = marker == "o" and order > 0
        look = {"markersize": 7.5 if ring else 4.5, "markerfacecolor": "none" if ring else color, "zorder": 6 - order}
        axes.plot(x, PERCENT * y, label=name, color=color, marker=marker, linestyle=dashes, **look)
    axes.axvline(panel.base, color="0.7", linewidth=0.8, zorder=0, label="base worm")
    axes.set_xlabel(panel.label)
    values = next(iter(panel.lines.values()))[0]
    if panel.logarithmic:
        axes.set_xscale("log")
    axes.set_xticks(values, [panel.names.get(value, f"{value:g}") for value in values])
    axes.minorticks_off()

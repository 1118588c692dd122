"""The weak middle: how far interior segments stay below the ends, over body and ground, for every kind of actuator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.morphology import Array
from annelid.view.canvas import canvas, save_both
from annelid.view.style import panel_title, segment_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PERCENT = 100.0
_MARKERS = ("o", "o", "^", "s")
_DASHES = ("-", (0, (1.2, 1.2)), (0, (5, 2)), "-")
_FADED = "0.35"


@dataclass(frozen=True)
class Panel:
    """One panel.

    Attributes:
        label: What is varied, with its unit.
        base: Its value at the worm that all panels share.
        lines: By the name in the legend: values and deficits (fractions, NaN where there is none), each ``(n,)``.
        logarithmic: Whether the axis is.
    """

    label: str
    base: float
    lines: Mapping[str, tuple[Array, Array]]
    logarithmic: bool = False


def weak_middle_figure(panels: Sequence[Panel], marks: Mapping[str, float], stem: str | Path) -> Path:
    """Draws one panel for every quantity, one line for every kind of actuator.

    Args:
        panels: Two or four panels with the same lines.
        marks: Deficits to compare with, fractions, by what they are of.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    names = list(panels[0].lines)
    top = max(
        [*marks.values(), *(float(np.nanmax(y, initial=0.0)) for panel in panels for _, y in panel.lines.values())]
    )
    with canvas(6.4) as figure:
        grid = figure.subplots((len(panels) + 1) // 2, 2, sharey=True, squeeze=False)
        for letter, axes, panel in zip("abcdefgh", grid.flat, panels, strict=False):
            _draw(axes, panel)
            panel_title(axes, f"{letter})")
            for name, value in marks.items():
                axes.axhline(PERCENT * value, color=_FADED, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
                axes.annotate(
                    name,
                    (1.0, PERCENT * value),
                    xycoords=axes.get_yaxis_transform(),
                    xytext=(0, 2.5),
                    textcoords="offset points",
                    ha="right",
                    fontsize=7.5,
                    color=_FADED,
                )
            axes.set_ylim(0.0, PERCENT * top * 1.1)
        for row in grid:
            row[0].set_ylabel("interior below the ends (%)")
        handles = [grid.flat[0].get_lines()[i] for i in range(len(names))]
        figure.legend(handles, names, loc="outside upper center", ncols=len(names), handlelength=3.2)
        return save_both(figure, stem)


def _draw(axes: Axes, panel: Panel) -> None:
    colors = segment_colors(4)
    for i, (name, (x, y)) in enumerate(panel.lines.items()):
        look: dict[str, Any] = {"color": colors[i % 4], "marker": _MARKERS[i % 4], "linestyle": _DASHES[i % 4]}
        axes.plot(x, PERCENT * y, label=name, markersize=4.5 + 3.0 * (i == 1), zorder=5 - i, **look, **_face(i, colors))
    axes.axvline(panel.base, color="0.6", linewidth=0.8, zorder=0)
    axes.set_xlabel(panel.label)
    if panel.logarithmic:
        values = next(iter(panel.lines.values()))[0]
        axes.set_xscale("log")
        axes.set_xticks(values, [f"{value:g}" for value in values])
        axes.minorticks_off()


def _face(i: int, colors: Sequence[Any]) -> dict[str, Any]:
    # The servo's line lies on the force-limited one wherever it stalls, so that it is drawn as a ring around it.
    return {"markerfacecolor": "none" if i == 1 else colors[i % 4]}

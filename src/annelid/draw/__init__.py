"""Pictures of runs: plots, frames and videos; an empty figure in the project's style, and what figures are made of.

All but the empty figure and what is drawn in it is loaded on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from annelid.draw.canvas import (
    CONTRACTED,
    WIDTH_IN,
    activation_color,
    canvas,
    draw_lines,
    line_looks,
    panel_title,
    save_both,
    segment_colors,
)
from annelid.lazy import lazy

if TYPE_CHECKING:
    from annelid.body.actuation import PIN_RGBA
    from annelid.body.formulations.rods.net import STRAND_RGBA
    from annelid.draw.camera import VIEWS_DEG, fitting_distance, picture_axes, picture_points
    from annelid.draw.figures import RUN_FIGURES
    from annelid.draw.figures.network_diagram import network_figure
    from annelid.draw.gl import find_backend
    from annelid.draw.page import html_page
    from annelid.draw.planar_scene import bent_rhombi, rhombi
    from annelid.draw.plots import figure7
    from annelid.draw.scene import CONTRACTED_WIDTH, SPRING_RGBA, Skeleton, postures_of, render_still

__all__ = [
    "CONTRACTED",
    "CONTRACTED_WIDTH",
    "PIN_RGBA",
    "RUN_FIGURES",
    "SPRING_RGBA",
    "STRAND_RGBA",
    "VIEWS_DEG",
    "WIDTH_IN",
    "Skeleton",
    "activation_color",
    "bent_rhombi",
    "canvas",
    "draw_lines",
    "figure7",
    "find_backend",
    "fitting_distance",
    "html_page",
    "line_looks",
    "network_figure",
    "panel_title",
    "picture_axes",
    "picture_points",
    "postures_of",
    "render_still",
    "rhombi",
    "save_both",
    "segment_colors",
]

__getattr__, __dir__ = lazy(__name__)

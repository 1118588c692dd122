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
    from annelid.draw.canvas import plain, save
    from annelid.draw.drawn_worm import CONTRACTED_WIDTH, SPRING_RGBA
    from annelid.draw.figures import RUN_FIGURES
    from annelid.draw.figures.comparison import lengths_figure, travel_figure
    from annelid.draw.figures.experiments import progress_figure, uncertainty_figure
    from annelid.draw.figures.network_diagram import network_figure
    from annelid.draw.gl import find_backend
    from annelid.draw.page import html_page
    from annelid.draw.plots import figure7, plot_path
    from annelid.draw.render import DEFAULT_CAMERA, render_frame, render_video
    from annelid.draw.scene import Skeleton, WormScene, postures_of
    from annelid.draw.strands import POINTS_PER_SIDE, strand_curves
    from annelid.draw.summary_table import UNKNOWN, aligned, comparison_table, fields_table

__all__ = [
    "CONTRACTED",
    "CONTRACTED_WIDTH",
    "DEFAULT_CAMERA",
    "PIN_RGBA",
    "POINTS_PER_SIDE",
    "RUN_FIGURES",
    "SPRING_RGBA",
    "STRAND_RGBA",
    "UNKNOWN",
    "VIEWS_DEG",
    "WIDTH_IN",
    "Skeleton",
    "WormScene",
    "activation_color",
    "aligned",
    "canvas",
    "comparison_table",
    "draw_lines",
    "fields_table",
    "figure7",
    "find_backend",
    "fitting_distance",
    "html_page",
    "lengths_figure",
    "line_looks",
    "network_figure",
    "panel_title",
    "picture_axes",
    "picture_points",
    "plain",
    "plot_path",
    "postures_of",
    "progress_figure",
    "render_frame",
    "render_video",
    "save",
    "save_both",
    "segment_colors",
    "strand_curves",
    "travel_figure",
    "uncertainty_figure",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "render_still": "render_frame draws a run on white",
        "framed_table": "make a rich.table.Table",
        "Mark": "progress_figure takes the values of the trials",
        "load_frame_figure": "annelid_lab.calibration draws loops of a load frame",
        "Panel": "uncertainty_figure takes the rows of uncertainty.csv",
    },
    ("annelid_studies.planar",),
)

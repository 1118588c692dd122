"""The worm in one posture, rendered on a figure's axes, and figure 4: the model at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from annelid.analysis import nearest_frame
from annelid.body import worm_of
from annelid.config import RunConfig
from annelid.draw import (
    CONTRACTED,
    PIN_RGBA,
    POINTS_PER_SIDE,
    STRAND_RGBA,
    VIEWS_DEG,
    Skeleton,
    canvas,
    find_backend,
    panel_title,
    postures_of,
    render_still,
    save_both,
    strand_curves,
)
from annelid.errors import RenderingUnavailable
from annelid.morphology import Array, MeshGeometry
from annelid.simulation import Run, compile_worm
from annelid_studies.riddle2023.words import caption

Place = Callable[[ArrayLike], Array]
"""From points in space, m, shape ``(..., 3)``, to the axes' coordinates, shape ``(..., 2)``."""

AXIAL_DEG = (0.0, 0.0)
ISOMETRIC_DEG = VIEWS_DEG["isometric"]
_PIXELS_PER_INCH = 220


@dataclass(frozen=True)
class Posture:
    """A 3D worm at one moment."""

    config: RunConfig  # Its configuration
    geometry: MeshGeometry  # Its mesh at rest
    time_s: float  # Time of the posture; NaN at rest
    crossings_m: Array  # Positions of the pins, m, shape ``(n_crossings, 3)``
    strands_m: Array  # Points of the strands' curves, m, shape ``(n_strands, n_points, 3)``
    qpos: Array | None = None  # The engine's coordinates; None at rest
    activation: Array | None = None  # Of every ring muscle; None where all are to be shown in red


def rest_posture(config: RunConfig) -> Posture:
    """Returns the worm as its mesh is laid out.

    Raises:
        ConfigError: The worm is planar.
    """
    geometry = _mesh(config)
    return Posture(
        config, geometry, float("nan"), geometry.crossings_m, strand_curves(geometry.vertices_m, geometry)[0]
    )


def recorded_posture(run: Run, time_s: float) -> Posture:
    """Returns the posture that a run recorded nearest to a time.

    Raises:
        ConfigError: The worm is planar.
        RunFileError: No posture was recorded at that time.
    """
    geometry, frame = _mesh(run.config), nearest_frame(run, time_s)
    recorded_s = float(run.data["frame_time"].values[frame])
    anatomy = compile_worm(run.config)
    qpos = postures_of(run, anatomy.model.nq)[frame]
    return Posture(
        config=run.config,
        geometry=geometry,
        time_s=recorded_s,
        crossings_m=run.data["crossing_position"].values[frame],
        strands_m=Skeleton(anatomy).locate(qpos)[0],
        qpos=qpos,
        activation=run.data["activation"].sel(time=recorded_s, method="nearest").values,
    )


def _mesh(config: RunConfig) -> MeshGeometry:
    return worm_of(config).geometry()


def rendering_works() -> bool:
    """Whether pictures of the worm can be rendered on this machine."""
    try:
        find_backend()
    except RenderingUnavailable:
        return False
    return True


def show_worm(axes: Axes, posture: Posture, angles_deg: tuple[float, float], width_in: float) -> Place:
    """Shows a posture on empty axes, rendered with OpenGL.

    The angles are azimuth and elevation of the line of sight; the width of the axes, inches, decides the resolution.
    """
    axes.set_axis_off()
    axes.set_aspect("equal")
    side = int(width_in * _PIXELS_PER_INCH)
    still = render_still(posture.config, angles_deg, (side, side), qpos=posture.qpos, activation=posture.activation)
    axes.imshow(still.pixels)
    rows, columns = np.nonzero((still.pixels < 250).any(axis=-1))
    axes.set_xlim(columns.min() - 4, columns.max() + 4)
    axes.set_ylim(rows.max() + 4, rows.min() - 4)
    return still.places


def rhombus_outline(posture: Posture, rhombus: int) -> Array:
    """Follows the strands round a rhombus from pin to pin: a closed line, m, shape ``(n_points, 3)``."""
    geometry, corners = posture.geometry, posture.geometry.rhombi[rhombus]
    points = []
    for start, end in zip(corners, np.roll(corners, -1), strict=True):
        # The points of the strand that both share, from the one pin to just before the other.
        (strand,) = np.intersect1d(geometry.crossing_strands[start], geometry.crossing_strands[end])
        first, last = (POINTS_PER_SIDE * (int(geometry.crossing_plane[c]) + 1) for c in (start, end))
        step = 1 if last > first else -1
        points += [posture.crossings_m[[start]], posture.strands_m[strand, np.arange(first + step, last, step)]]
    return np.concatenate([*points, points[0]])


def figure_4_model(config: RunConfig, stem: Path) -> str:
    """Shows the model at rest, in the axial and the isometric view; returns the caption.

    Raises:
        ConfigError: The worm is planar.
    """
    posture = rest_posture(config)
    with canvas(3.3) as figure:
        axial, isometric = figure.subplots(1, 2, width_ratios=[1.0, 1.42])
        show_worm(axial, posture, AXIAL_DEG, 2.8)
        show_worm(isometric, posture, ISOMETRIC_DEG, 4.2)
        panel_title(axial, "a) axial view")
        panel_title(isometric, "b) isometric view")
        style: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 5}
        handles = [
            Line2D([], [], color=STRAND_RGBA[0], linewidth=2.0, label="strand"),
            Line2D([], [], color=CONTRACTED, linewidth=3.2, label="ring muscle"),
            Line2D([], [], color=CONTRACTED, linewidth=1.0, label="axial spring"),
            Line2D([], [], color=PIN_RGBA, label="pin", **style),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
        save_both(figure, stem)
    geometry = posture.geometry
    found = {"geometry": geometry, "half": geometry.n_per_plane, "springs": len(geometry.springs)}
    return caption(4, found)

"""The worm in one posture, drawn on a figure's axes, and figure 4: the model at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from annelid.analysis import nearest_frame
from annelid.body import worm_of
from annelid.config import RunConfig
from annelid.draw import (
    CONTRACTED,
    PIN_RGBA,
    POINTS_PER_SIDE,
    SPRING_RGBA,
    STRAND_RGBA,
    VIEWS_DEG,
    Skeleton,
    activation_color,
    canvas,
    fitting_distance,
    panel_title,
    picture_axes,
    picture_points,
    postures_of,
    save_both,
    strand_curves,
)
from annelid.morphology import Array, MeshGeometry
from annelid.simulation import Run, compile_worm
from annelid_studies.riddle2023.figures import caption

Place = Callable[[ArrayLike], Array]
"""From points in space, m, shape ``(..., 3)``, to the axes' coordinates, m, shape ``(..., 2)``."""

AXIAL_DEG = (0.0, 0.0)
ISOMETRIC_DEG = VIEWS_DEG["isometric"]
_DOT_M = 1e-3
"""Half the length of the line whose round ends make a pin."""
_PALEST = 0.6
"""How far the colour of what is farthest away lies towards white."""


@dataclass(frozen=True)
class Posture:
    """A 3D worm at one moment."""

    config: RunConfig  # Its configuration
    geometry: MeshGeometry  # Its mesh at rest
    time_s: float  # Time of the posture; NaN at rest
    crossings_m: Array  # Positions of the pins, m, shape ``(n_crossings, 3)``
    strands_m: Array  # Points of the strands' curves, m, shape ``(n_strands, n_points, 3)``
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
        activation=run.data["activation"].sel(time=recorded_s, method="nearest").values,
    )


def _mesh(config: RunConfig) -> MeshGeometry:
    return worm_of(config).geometry()


def show_worm(axes: Axes, posture: Posture, angles_deg: tuple[float, float]) -> Place:
    """Draws a posture on empty axes, what lies behind paler.

    The angles are azimuth and elevation of the line of sight.
    """
    geometry, crossings, active = posture.geometry, posture.crossings_m, posture.activation
    rings = crossings[np.concatenate([geometry.rings, geometry.rings[:, :1]], axis=1)]
    shares = np.ones(len(rings)) if active is None else active.reshape(len(rings), -1).mean(axis=1)
    right, _, sight = picture_axes(*angles_deg)
    # Lines, ``(n_lines, n_points, 3)``, with their colour and their width in points.
    parts: list[tuple[Array, Any, float]] = [
        (np.stack([crossings - _DOT_M * right, crossings + _DOT_M * right], axis=1), PIN_RGBA[:3], 4.0),
        (crossings[geometry.springs], CONTRACTED if active is None else SPRING_RGBA[:3], 1.0),
    ]
    for strands, rgba in zip(np.split(posture.strands_m, 2), STRAND_RGBA, strict=True):
        parts.append((strands, rgba[:3], 1.7))
    for ring, share in zip(rings, shares.tolist(), strict=True):
        parts.append((ring[None], activation_color(share), 1.6 + 1.4 * share))
    pieces = [np.stack([lines[:, :-1], lines[:, 1:]], axis=2).reshape(-1, 2, 3) for lines, _, _ in parts]
    counts, ends = [len(piece) for piece in pieces], np.concatenate(pieces)
    target = (ends.max(axis=(0, 1)) + ends.min(axis=(0, 1))) / 2
    distance = fitting_distance(ends.reshape(-1, 3) - target, *angles_deg, 1.0)

    def place(points_m: ArrayLike) -> Array:
        return picture_points(points_m - target, *angles_deg, distance, 1.0) * [1.0, -1.0]

    depth = ends.mean(axis=1) @ sight
    order = np.argsort(-depth)
    pale = _PALEST * (depth - depth.min())[:, None] / np.ptp(depth)
    colors = np.repeat([color for _, color, _ in parts], counts, axis=0) * (1.0 - pale) + pale
    widths = np.repeat([width for *_, width in parts], counts)
    axes.add_collection(
        LineCollection(list(place(ends[order])), colors=colors[order], linewidths=widths[order], capstyle="round")
    )
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.autoscale_view()
    return place


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
        show_worm(axial, posture, AXIAL_DEG)
        show_worm(isometric, posture, ISOMETRIC_DEG)
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

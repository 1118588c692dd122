"""The worm in one posture on a figure's axes, rendered or drawn, and figure 4: the model at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from annelid.analysis import nearest_frame
from annelid.body import worm_of
from annelid.config import RunConfig
from annelid.draw import (
    CONTRACTED,
    CONTRACTED_WIDTH,
    PIN_RGBA,
    SPRING_RGBA,
    STRAND_RGBA,
    VIEWS_DEG,
    Skeleton,
    activation_color,
    canvas,
    find_backend,
    fitting_distance,
    panel_title,
    picture_axes,
    picture_points,
    postures_of,
    render_still,
    save_both,
)
from annelid.errors import RenderingUnavailable
from annelid.morphology import Array, MeshGeometry
from annelid.simulation import Run, compile_worm
from annelid_studies.riddle2023.words import caption

Place = Callable[[ArrayLike], Array]
"""From points in space, m, shape ``(..., 3)``, to the axes' coordinates, shape ``(..., 2)``."""

AXIAL_DEG = (0.0, 0.0)
ISOMETRIC_DEG = VIEWS_DEG["isometric"]
_CM = 100.0
_PIXELS_PER_INCH = 220
_LAYERS = 24
_FARTHEST_SHARE = 0.3
"""What lies farthest behind keeps this share of its colour."""
_STRAND_WIDTH, _RING_WIDTH, _SPRING_WIDTH, _PIN_SIZE = 1.3, 2.0, 0.8, 9.0
_HALO = 1.2
_PIECES = 6
"""Rings' and springs' straight lines are cut into this many pieces, each with a depth of its own."""


@dataclass(frozen=True)
class Posture:
    """A 3D worm at one moment."""

    config: RunConfig  # Its configuration
    geometry: MeshGeometry  # Its mesh at rest
    time_s: float  # Time of the posture; NaN at rest
    crossings_m: Array  # Positions of the pins, m, shape ``(n_crossings, 3)``
    strands_m: Array  # Points of the strands, m, shape ``(n_strands, n_vertices, 3)``
    qpos: Array | None = None  # The engine's coordinates; None at rest
    activation: Array | None = None  # Of every ring muscle; None where all are to be shown in red


def rest_posture(config: RunConfig) -> Posture:
    """Returns the worm as its mesh is laid out.

    Raises:
        ConfigError: The worm is planar.
    """
    geometry = _mesh(config)
    return Posture(config, geometry, float("nan"), geometry.crossings_m, geometry.vertices_m)


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
    """Whether pictures of the worm are rendered on this machine; otherwise they are drawn."""
    try:
        find_backend()
    except RenderingUnavailable:
        return False
    return True


def show_worm(axes: Axes, posture: Posture, angles_deg: tuple[float, float], width_in: float) -> Place:
    """Shows a posture on empty axes: rendered with OpenGL, or drawn with lines where there is none.

    The angles are azimuth and elevation of the line of sight; the width of the axes, inches, decides the resolution.
    """
    axes.set_axis_off()
    axes.set_aspect("equal")
    if not rendering_works():
        return draw_worm(axes, posture, angles_deg, perspective=True)
    side = int(width_in * _PIXELS_PER_INCH)
    still = render_still(posture.config, angles_deg, (side, side), qpos=posture.qpos, activation=posture.activation)
    axes.imshow(still.pixels)
    rows, columns = np.nonzero((still.pixels < 250).any(axis=-1))
    axes.set_xlim(columns.min() - 4, columns.max() + 4)
    axes.set_ylim(rows.max() + 4, rows.min() - 4)
    return still.places


def draw_worm(
    axes: Axes, posture: Posture, angles_deg: tuple[float, float], *, perspective: bool = False, strength: float = 1.0
) -> Place:
    """Draws a posture on empty axes with lines; what lies behind is paler and crossed over.

    Args:
        axes: The axes.
        posture: The worm.
        angles_deg: Azimuth and elevation of the line of sight.
        perspective: As the renderer's camera sees it; by default in parallel projection, in cm.
        strength: Share of the colours that the nearest parts keep, in (0, 1].
    """
    right, up, sight = picture_axes(*angles_deg)
    pieces, colors, widths = _lines(posture)
    target = (pieces.min(axis=(0, 1)) + pieces.max(axis=(0, 1))) / 2
    distance = fitting_distance(pieces.reshape(-1, 3) - target, *angles_deg, 1.0)

    def place(points_m: ArrayLike) -> Array:
        points = np.asarray(points_m, dtype=float) - target
        if perspective:
            return _CM * picture_points(points, *angles_deg, distance, 1.0) * [1.0, -1.0]
        return _CM * np.stack([points @ right, points @ up], axis=-1)

    depth = pieces.mean(axis=1) @ sight
    near, far = depth.min(), depth.max()
    bounds = np.linspace(far, near, _LAYERS + 1)[1:-1]

    def faded(colors: Array, depth: Array) -> tuple[Array, NDArray[np.intp]]:
        """Colours mixed with white the more the farther behind, and the layer of each depth."""
        share = strength * (1.0 - (1.0 - _FARTHEST_SHARE) * np.clip((depth - near) / (far - near), 0, 1))
        return 1.0 - share[:, None] * (1.0 - colors), np.searchsorted(-bounds, -depth)

    colors, layers = faded(colors, depth)
    pins, pin_layers = faded(np.array([PIN_RGBA[:3]]), posture.crossings_m @ sight)
    flat, flat_pins = place(pieces), place(posture.crossings_m)
    for layer in range(_LAYERS):
        own, at, height = layers == layer, pin_layers == layer, 2 + layer / _LAYERS
        for color, width, cap in (("white", widths[own] + _HALO, "butt"), (colors[own], widths[own], "round")):
            lines = LineCollection(list(flat[own]), colors=color, linewidths=width, capstyle=cap, zorder=height)
            axes.add_collection(lines)
        # A pin is thicker than the strands that meet in it.
        axes.scatter(*flat_pins[at].T, s=_PIN_SIZE, c=pins[at], linewidths=0, zorder=height + 1.5 / _LAYERS)
    low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    room = 0.015 * float((high - low).max())
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
    return place


def _lines(posture: Posture) -> tuple[Array, Array, Array]:
    """Straight pieces of strands, springs and rings, shape ``(n, 2, 3)``, their colours and their widths."""
    geometry, crossings = posture.geometry, posture.crossings_m
    n_segments = geometry.n_segments
    strands = np.stack([posture.strands_m[:, :-1], posture.strands_m[:, 1:]], axis=2)
    strand_colors = np.repeat([color[:3] for color in STRAND_RGBA], strands[0].shape[0] * geometry.n_per_plane, axis=0)
    springs = _cut(crossings[geometry.springs])
    rings = _cut(np.stack([crossings[geometry.rings], crossings[np.roll(geometry.rings, -1, axis=1)]], axis=2))
    if posture.activation is None:
        contraction = np.zeros(n_segments)
        ring_colors, spring_color = np.tile(CONTRACTED, (n_segments, 1)), CONTRACTED
    else:
        contraction = posture.activation.reshape(n_segments, -1).mean(axis=1)
        ring_colors, spring_color = np.array([activation_color(a) for a in contraction]), SPRING_RGBA[:3]
    n_ring = len(rings) // n_segments
    ring_widths = np.repeat(_RING_WIDTH * (1.0 + (CONTRACTED_WIDTH - 1.0) * contraction), n_ring)
    widths = [np.full(len(strand_colors), _STRAND_WIDTH), np.full(len(springs), _SPRING_WIDTH), ring_widths]
    return (
        np.concatenate([strands.reshape(-1, 2, 3), springs, rings]),
        np.concatenate([strand_colors, np.tile(spring_color, (len(springs), 1)), np.repeat(ring_colors, n_ring, 0)]),
        np.concatenate(widths),
    )


def _cut(lines: Array) -> Array:
    """Cuts straight lines, shape ``(..., 2, 3)``, into pieces one after the other, shape ``(n, 2, 3)``."""
    share = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
    points = lines[..., :1, :] * (1.0 - share) + lines[..., 1:, :] * share
    return np.stack([points[..., :-1, :], points[..., 1:, :]], axis=-2).reshape(-1, 2, 3)


def rhombus_outline(posture: Posture, rhombus: int) -> Array:
    """Follows the strands round a rhombus from pin to pin: a closed line, m, shape ``(n_points, 3)``."""
    geometry, corners = posture.geometry, posture.geometry.rhombi[rhombus]
    points = []
    for start, end in zip(corners, np.roll(corners, -1), strict=True):
        # The points of the strand that both share, from the one pin to just before the other.
        (strand,) = np.intersect1d(geometry.crossing_strands[start], geometry.crossing_strands[end])
        first, last = (int(geometry.crossing_vertex[geometry.crossing_plane[c]]) for c in (start, end))
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
    how = "rendered by MuJoCo" if rendering_works() else "drawn from the mesh's coordinates, not rendered"
    found = {"how": how, "geometry": geometry, "half": geometry.n_per_plane, "springs": len(geometry.springs)}
    return caption(4, found)

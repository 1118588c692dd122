"""The worm in one posture on a figure's axes, rendered or drawn, and figure 4: the model at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.analysis.rhombi import nearest_frame
from annelid.body import mesh_of
from annelid.body.actuation import PIN_RGBA
from annelid.body.formulations.rods.net import STRAND_RGBA
from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid.draw.camera import VIEWS_DEG, fitting_distance, picture_axes, picture_points
from annelid.draw.canvas import CONTRACTED, activation_color, canvas, panel_title, save_both
from annelid.draw.gl import find_backend
from annelid.draw.scene import CONTRACTED_WIDTH, SPRING_RGBA, Skeleton, postures_of, render_still
from annelid.errors import RenderingUnavailable, RunFileError
from annelid.morphology import Array, MeshGeometry
from annelid.simulation.worm import compile_worm

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from annelid.simulation.runfile import Run

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
    """A 3D worm at one moment.

    Attributes:
        config: Its configuration.
        geometry: Its mesh at rest.
        time_s: Time of the posture; NaN at rest.
        crossings_m: Positions of the pins, m, shape ``(n_crossings, 3)``.
        strands_m: Points of the strands, m, shape ``(n_strands, n_vertices, 3)``.
        qpos: The engine's coordinates; None at rest.
        activation: Of every ring muscle; None where all are to be shown in red.
    """

    config: RunConfig
    geometry: MeshGeometry
    time_s: float
    crossings_m: Array
    strands_m: Array
    qpos: Array | None = None
    activation: Array | None = None


def rest_posture(config: RunConfig) -> Posture:
    """Returns the worm as its mesh is laid out.

    Raises:
        RunFileError: The worm is planar.
    """
    geometry = mesh_of(_worm(config).mesh)
    return Posture(config, geometry, float("nan"), geometry.crossings_m, geometry.vertices_m)


def recorded_posture(run: Run, time_s: float) -> Posture:
    """Returns the posture that a run recorded nearest to a time.

    Raises:
        RunFileError: The worm is planar, or no posture was recorded at that time.
    """
    geometry = mesh_of(_worm(run.config).mesh)
    frame = nearest_frame(run, time_s)
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


def rendering_works() -> bool:
    """Tells whether pictures of the worm are rendered on this machine; otherwise they are drawn."""
    try:
        find_backend()
    except RenderingUnavailable:
        return False
    return True


def show_worm(axes: Axes, posture: Posture, angles_deg: tuple[float, float], width_in: float) -> Place:
    """Shows a posture on axes of its own: rendered with OpenGL, or drawn with lines where there is none.

    Args:
        axes: Empty axes.
        posture: The worm.
        angles_deg: Azimuth and elevation of the line of sight.
        width_in: Width of the axes, inches, which decides the resolution.

    Returns:
        Where points in space lie on the axes.
    """
    axes.set_axis_off()
    axes.set_aspect("equal")
    if not rendering_works():
        return draw_worm(axes, posture, angles_deg, perspective=True)
    width = int(width_in * _PIXELS_PER_INCH)
    still = render_still(posture.config, angles_deg, (width, width), qpos=posture.qpos, activation=posture.activation)
    axes.imshow(still.pixels)
    rows, columns = np.nonzero((still.pixels < 250).any(axis=-1))
    axes.set_xlim(columns.min() - 4, columns.max() + 4)
    axes.set_ylim(rows.max() + 4, rows.min() - 4)
    return still.places


def draw_worm(
    axes: Axes,
    posture: Posture,
    angles_deg: tuple[float, float],
    *,
    perspective: bool = False,
    strength: float = 1.0,
) -> Place:
    """Draws a posture with lines; what lies behind is paler and crossed over.

    Args:
        axes: Empty axes.
        posture: The worm.
        angles_deg: Azimuth and elevation of the line of sight.
        perspective: As the renderer's camera sees it; by default in parallel projection, in cm.
        strength: Share of the colours that the nearest parts keep, in (0, 1].

    Returns:
        Where points in space lie on the axes.
    """
    from matplotlib.collections import LineCollection

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
    pin_depth = posture.crossings_m @ sight
    near, far = depth.min(), depth.max()
    share = strength * (1.0 - (1.0 - _FARTHEST_SHARE) * (depth - near) / (far - near))
    pin_share = strength * (1.0 - (1.0 - _FARTHEST_SHARE) * np.clip((pin_depth - near) / (far - near), 0, 1))
    faded, pins = _fade(colors, share), _fade(np.array([PIN_RGBA[:3]]), pin_share)
    flat, flat_pins = place(pieces), place(posture.crossings_m)
    bounds = np.linspace(far, near, _LAYERS + 1)[1:-1]
    layers, pin_layers = np.searchsorted(-bounds, -depth), np.searchsorted(-bounds, -pin_depth)
    for layer in range(_LAYERS):
        own, at, height = layers == layer, pin_layers == layer, 2 + layer / _LAYERS
        halo = LineCollection(list(flat[own]), colors="white", linewidths=widths[own] + _HALO, capstyle="butt")
        lines = LineCollection(list(flat[own]), colors=faded[own], linewidths=widths[own], capstyle="round")
        for collection in (halo, lines):
            collection.set_zorder(height)
            axes.add_collection(collection)
        # A pin is thicker than the strands that meet in it.
        axes.scatter(*flat_pins[at].T, s=_PIN_SIZE, c=pins[at], linewidths=0, zorder=height + 1.5 / _LAYERS)
    low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    room = 0.015 * float((high - low).max())
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room, high[1] + room)
    return place


def rhombus_outline(posture: Posture, rhombus: int) -> Array:
    """Follows the strands round a rhombus, from pin to pin.

    Args:
        posture: The worm.
        rhombus: Its index.

    Returns:
        A closed line, m, shape ``(n_points, 3)``.
    """
    corners = posture.geometry.rhombi[rhombus]
    sides = [_side(posture, int(a), int(b)) for a, b in zip(corners, np.roll(corners, -1), strict=True)]
    return np.concatenate([*sides, sides[0][:1]])


def figure_4_model(config: RunConfig, stem: Path) -> str:
    """Shows the model at rest, in the axial and the isometric view.

    Args:
        config: Configuration of a 3D worm.
        stem: Path of the two files to write, without suffix.

    Returns:
        The caption, with the numbers of the model.

    Raises:
        RunFileError: The worm is planar.
    """
    from matplotlib.lines import Line2D

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
    half = geometry.n_per_plane
    how = "rendered by MuJoCo" if rendering_works() else "drawn from the mesh's coordinates, not rendered"
    return (
        f"The model at rest, {how}, in a) the axial and b) the isometric view; what lies behind is paler. "
        f"{geometry.n_strands} flexible strands (blue), {half} of each handedness, wind round a tube of "
        f"{_CM * geometry.radius_m:.0f} cm radius and {_CM * geometry.length_m:.0f} cm length and are pinned to each "
        f"other at {geometry.n_crossings} crossings (spheres). {geometry.n_segments} ring muscles (thick red) run "
        f"round the body through {half} pins each, so at rest they are polygons, and {len(geometry.springs)} axial "
        "springs (thin red) join pins that are two planes apart."
    )


def _worm(config: RunConfig) -> WormBody:
    if not isinstance(config.body, WormBody):
        raise RunFileError(f"{config.name} is a planar worm: this figure shows the 3D worm")
    return config.body


def _lines(posture: Posture) -> tuple[Array, Array, Array]:
    """Straight pieces of strands, springs and rings, shape ``(n, 2, 3)``, their colours and their widths."""
    geometry, crossings = posture.geometry, posture.crossings_m
    strands = np.stack([posture.strands_m[:, :-1], posture.strands_m[:, 1:]], axis=2)
    strand_colors = np.repeat([color[:3] for color in STRAND_RGBA], strands[0].shape[0] * geometry.n_per_plane, axis=0)
    springs = _cut(crossings[geometry.springs])
    rings = _cut(np.stack([crossings[geometry.rings], crossings[np.roll(geometry.rings, -1, axis=1)]], axis=2))
    if posture.activation is None:
        ring_share = np.zeros(geometry.n_segments)
        ring_colors, spring_color = np.tile(CONTRACTED, (geometry.n_segments, 1)), CONTRACTED
    else:
        ring_share = posture.activation.reshape(geometry.n_segments, -1).mean(axis=1)
        ring_colors, spring_color = np.array([activation_color(a) for a in ring_share]), SPRING_RGBA[:3]
    n_ring = len(rings) // geometry.n_segments
    return (
        np.concatenate([strands.reshape(-1, 2, 3), springs, rings]),
        np.concatenate([strand_colors, np.tile(spring_color, (len(springs), 1)), np.repeat(ring_colors, n_ring, 0)]),
        np.concatenate(
            [
                np.full(len(strand_colors), _STRAND_WIDTH),
                np.full(len(springs), _SPRING_WIDTH),
                np.repeat(_RING_WIDTH * (1.0 + (CONTRACTED_WIDTH - 1.0) * ring_share), n_ring),
            ]
        ),
    )


def _cut(lines: Array) -> Array:
    """Cuts straight lines, shape ``(..., 2, 3)``, into pieces one after the other, shape ``(n, 2, 3)``."""
    share = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
    points = lines[..., :1, :] * (1.0 - share) + lines[..., 1:, :] * share
    return np.stack([points[..., :-1, :], points[..., 1:, :]], axis=-2).reshape(-1, 2, 3)


def _fade(colors: Array, share: Array) -> Array:
    """Mixes colours with white, of which they keep a share each."""
    return 1.0 - share[:, None] * (1.0 - colors)


def _side(posture: Posture, start: int, end: int) -> Array:
    """Points of the strand that two neighbouring crossings share, from the one pin to just before the other."""
    geometry = posture.geometry
    (strand,) = np.intersect1d(geometry.crossing_strands[start], geometry.crossing_strands[end])
    first, last = (int(geometry.crossing_vertex[geometry.crossing_plane[c]]) for c in (start, end))
    step = 1 if last > first else -1
    between = posture.strands_m[strand, np.arange(first + step, last, step)]
    return np.concatenate([posture.crossings_m[[start]], between])

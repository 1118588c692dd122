"""Figure 8: how far a contraction deforms the mesh around it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from annelid.draw import POINTS_PER_SIDE, WIDTH_IN, canvas, panel_title, picture_axes, save_both
from annelid.morphology import Array, MeshGeometry
from annelid.simulation import Run
from annelid_studies.riddle2023.figures import caption
from annelid_studies.riddle2023.figures.renderings import (
    Place,
    Posture,
    recorded_posture,
    rhombus_outline,
    show_worm,
)
from annelid_studies.riddle2023.figures.rhombi import (
    Deformation,
    actuated,
    deformation,
    distance_from_ring_m,
    plane_means,
    rhombus_diagonals,
    rhombus_plane,
)

TIME_S = 1.5
"""The moment of the paper's figure 8, in the middle of the first contraction of segment 2."""
FIGURE_8_DEG = (78.0, -30.0)
GREEN, PINK = "#0f8a3c", "#e0409a"
_CM, _PERCENT = 100.0, 100.0
_GAP_M = 0.002
"""Pins that part from their strands by more than a strand's radius show in the pictures."""


@dataclass(frozen=True)
class Measured:
    """A rhombus at one moment against rest."""

    rhombus: int  # Its index
    distance_m: float  # Along the resting body from the contracted ring, negative towards the front
    length_m: tuple[float, float]  # Axial diagonal, at rest and now
    width_m: tuple[float, float]  # Lateral diagonal, at rest and now

    def __str__(self) -> str:
        return "\n".join(
            f"{name} {_CM * before:.1f} → {_CM * after:.1f} cm ({_change(after / before)})"
            for name, (before, after) in (("length", self.length_m), ("width", self.width_m))
        )

    @property
    def changes(self) -> tuple[str, str]:
        """Changes of length and width in words."""
        return _change(self.length_m[1] / self.length_m[0]), _change(self.width_m[1] / self.width_m[0])


@dataclass(frozen=True)
class Propagation:
    """How far a contraction deforms the mesh."""

    posture: Posture
    segment: int  # The most contracted segment, counted from 0
    near: Measured  # An unactuated rhombus next to the contracted ring, without a corner on it
    far: Measured  # The unactuated rhombus farthest from that ring, at the other side of it where both ends are as far
    plane_distance_m: Array  # Distance of every plane of rhombi from the contracted ring, shape ``(n_planes - 2,)``
    change: Deformation  # Of every rhombus


def measure_propagation(run: Run, time_s: float = TIME_S) -> Propagation:
    """Measures how far a contraction deforms the mesh.

    Of rhombi as near to the contracted ring or as far from it as each other, those that figure 8 shows best are taken.

    Raises:
        ConfigError: The worm is planar.
        RunFileError: No posture was recorded at that time.
    """
    posture = recorded_posture(run, time_s)
    geometry, segment = posture.geometry, _contracted(posture)
    distance = distance_from_ring_m(geometry, segment)
    offset = np.abs(rhombus_plane(geometry) - geometry.ring_planes[segment])
    facing = _outward(posture.crossings_m, geometry) @ -picture_axes(*FIGURE_8_DEG)[2]
    free = np.flatnonzero(offset >= 2)
    own_muscle = actuated(geometry)[free]
    near = int(free[np.lexsort((-facing[free], offset[free], own_muscle))[0]])
    same_side = np.sign(distance[free]) == np.sign(distance[near])
    far = int(free[np.lexsort((-facing[free], same_side, -offset[free], own_muscle))[0]])
    measured = []
    for rhombus in (near, far):
        corners = geometry.rhombi[[rhombus]]
        both = [rhombus_diagonals(crossings, corners) for crossings in (geometry.crossings_m, posture.crossings_m)]
        length, width = ((float(rest[0]), float(now[0])) for rest, now in zip(*both, strict=True))
        measured.append(Measured(rhombus, float(distance[rhombus]), length, width))
    change = deformation(posture.crossings_m, geometry)
    beside, away = measured
    return Propagation(posture, segment, beside, away, plane_means(distance, geometry), change)


def figure_8_propagation(run: Run, stem: Path, time_s: float = TIME_S) -> str:
    """Shows a near and a far rhombus of the worm, and the deformation of all of them; returns the caption.

    Raises:
        ConfigError: The worm is planar.
        RunFileError: No posture was recorded at that time.
    """
    measured = measure_propagation(run, time_s)
    posture = measured.posture
    with canvas(6.7) as figure:
        grid = figure.add_gridspec(2, 1)
        picture, below = figure.add_subfigure(grid[0]).subplots(), figure.add_subfigure(grid[1])
        place = show_worm(picture, posture, FIGURE_8_DEG)
        heights_in = min(_height_over_width(picture) * WIDTH_IN + 0.9, 4.3), 2.5
        grid.set_height_ratios(heights_in)
        figure.set_figheight(sum(heights_in))
        # The first segment is on the left.
        places = (0.24, 0.78) if measured.near.distance_m < measured.far.distance_m else (0.78, 0.24)
        _outline(picture, place, posture, measured.near, "near rhombus", GREEN, "-", places[0])
        _outline(picture, place, posture, measured.far, "far rhombus", PINK, "--", places[1])
        panel_title(picture, f"a) segment {measured.segment + 1} contracted, t = {posture.time_s:.2f} s")
        axial, lateral = below.subplots(1, 2, sharex=True)
        _scatter(axial, measured, measured.change.axial)
        _scatter(lateral, measured, measured.change.lateral)
        panel_title(axial, "b) length of each rhombus")
        panel_title(lateral, "c) width of each rhombus")
        axial.set_ylabel("change against rest (%)")
        for axes in (axial, lateral):
            axes.set_xlabel("distance from the contracted ring at rest (cm)")
        handles, labels = axial.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(handles), columnspacing=1.4)
        save_both(figure, stem)
    near, far = measured.near, measured.far
    distance, axial = np.abs(measured.plane_distance_m), plane_means(measured.change.axial, posture.geometry)
    most, last = int(np.argmax(np.abs(axial))), int(np.argmax(distance))
    found = {
        "segment": measured.segment + 1,
        "time_s": posture.time_s,
        "near_m": abs(near.distance_m),
        "near_muscle": _muscle(posture, near),
        "near": near.changes,
        "far_m": abs(far.distance_m),
        "far_muscle": _muscle(posture, far),
        "far": far.changes,
        "most": _change(1.0 + float(axial[most])),
        "most_m": distance[most],
        "last": _change(1.0 + float(axial[last])),
        "last_m": distance[last],
        "pins": _pin_remark(posture, measured.segment),
    }
    return caption(8, found)


def _muscle(posture: Posture, measured: Measured) -> str:
    return "relaxed" if actuated(posture.geometry)[measured.rhombus] else "without a muscle of its own"


def _pin_remark(posture: Posture, segment: int) -> str:
    """A sentence where the contracted ring's pins part from their strands, as soft crossings do."""
    geometry = posture.geometry
    ring = geometry.rings[segment]
    strands = posture.strands_m[geometry.crossing_strands[ring], POINTS_PER_SIDE * (geometry.ring_planes[segment] + 1)]
    gap_m = float(np.linalg.norm(strands - posture.crossings_m[ring, None], axis=-1).mean())
    if gap_m < _GAP_M:
        return ""
    return f" The contracted ring's pins, which are tied softly, stand {_CM * gap_m:.1f} cm off their strands."


def _height_over_width(axes: Axes) -> float:
    """Shape of what the limits of axes hold, where both axes have one scale."""
    return abs(float(np.diff(axes.get_ylim())[0] / np.diff(axes.get_xlim())[0]))


def _outline(
    axes: Axes, place: Place, posture: Posture, measured: Measured, name: str, color: str, linestyle: str, share: float
) -> None:
    """Follows a rhombus' sides, and writes its measurement below the picture, at a share of its width."""
    line = place(rhombus_outline(posture, measured.rhombus))
    axes.fill(*line.T, facecolor=color, alpha=0.22, linewidth=0, zorder=7)
    axes.plot(*line.T, color="white", linewidth=6.5, zorder=8)
    axes.plot(*line.T, linestyle=linestyle, color=color, linewidth=3.0, zorder=9)
    tip = line[np.argmin(axes.transData.transform(line)[:, 1])]
    arrow = {"arrowstyle": "-", "color": color, "linestyle": linestyle, "shrinkB": 2}
    below: Any = {"textcoords": "axes fraction", "ha": "center", "va": "top", "arrowprops": arrow, "zorder": 10}
    axes.annotate(f"{name}\n{measured}", tuple(tip), (share, -0.04), color=color, **below)


def _scatter(axes: Axes, measured: Propagation, change: Array) -> None:
    """Change of every rhombus over its distance from the contracted ring."""
    geometry = measured.posture.geometry
    distance = _CM * distance_from_ring_m(geometry, measured.segment)
    with_muscle = actuated(geometry)
    for mask, marker, color, face, name in (
        (~with_muscle, "o", "0.35", "white", "unactuated"),
        (with_muscle, "s", "#1b2a6b", "#1b2a6b", "with a ring muscle"),
    ):
        look = {"color": color, "markerfacecolor": face, "markersize": 4, "label": name}
        axes.plot(distance[mask], _PERCENT * change[mask], marker, **look)
    mean = _PERCENT * plane_means(change, geometry)
    axes.plot(_CM * measured.plane_distance_m, mean, "-", color="0.1", linewidth=1.2, label="mean")
    for one, marker, color, name in ((measured.near, "D", GREEN, "near"), (measured.far, "v", PINK, "far")):
        place = _CM * one.distance_m, _PERCENT * change[one.rhombus]
        axes.plot(*place, marker, color=color, markersize=8, markeredgecolor="black", label=name, zorder=5)
    axes.axhline(0.0, color="0.5", linewidth=0.8)


def _contracted(posture: Posture) -> int:
    """The segment whose ring is the shortest."""
    corners = posture.crossings_m[posture.geometry.rings]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).sum(axis=1)
    return int(np.argmin(lengths / posture.geometry.ring_length_m))


def _outward(crossings_m: Array, geometry: MeshGeometry) -> Array:
    """Direction from the body axis to every rhombus, shape ``(n_rhombi, 3)``."""
    middles = crossings_m[geometry.rhombi].mean(axis=1)
    plane = rhombus_plane(geometry)
    axis = np.stack([middles[plane == p].mean(axis=0) for p in np.unique(plane)])
    away = middles - axis[plane - plane.min()]
    return away / np.linalg.norm(away, axis=1, keepdims=True)


def _change(ratio: float) -> str:
    percent = round(_PERCENT * (ratio - 1.0))
    return f"{percent:+d} %".replace("-", "\N{MINUS SIGN}") if percent else "0 %"

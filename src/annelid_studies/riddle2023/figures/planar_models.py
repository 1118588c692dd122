"""Figure 1: three planar models of a worm's segments, drawn to scale in the same posture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch

from annelid.config import RunConfig, load_config
from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid.errors import ConfigError
from annelid.morphology import Array
from annelid.protocols import Records
from annelid.simulation import build_plant
from annelid_studies.riddle2023.words import caption

N_SEGMENTS = 3
_CM = 100.0
_SETTLING_TIME_S = 3.0


def contracted_outline(config: RunConfig, contracted: int) -> Array:
    """Lets a planar plant contract one segment, from 0, until it rests.

    Returns:
        Upper half of each segment from front to rear, shape ``(n_segments, n_corners, 2)``, m; the front tip at x = 0.

    Raises:
        ConfigError: The body is not a planar one.
    """
    if not config.body.is_planar:
        raise ConfigError(f"figure 1 is drawn of planar bodies, and {config.name!r} has a body in 3D")
    plant = build_plant(config)
    activation = np.zeros(plant.n_muscles)
    activation[contracted] = 1.0
    plant.reset(0)
    for _ in range(round(_SETTLING_TIME_S / config.clock.control_timestep_s)):
        plant.step(activation)
    assert isinstance(plant, Records)
    corners = config.body.outlines(plant.read(False))
    return corners[:, : corners.shape[1] // 2 + 1] - [corners[0, 0, 0], 0.0]


def zigzag(start: Array, end: Array, amplitude: float, n_teeth: int = 9, lead: float = 0.2) -> Array:
    """Path of a linear spring's symbol, ``(n_teeth + 4, 2)``; a share ``lead`` at each end stays straight."""
    along = np.concatenate([[0.0], np.linspace(lead, 1.0 - lead, n_teeth + 2), [1.0]])
    across = np.zeros(n_teeth + 4)
    across[2:-2] = amplitude * (-1.0) ** np.arange(n_teeth)
    direction = end - start
    normal = np.array([-direction[1], direction[0]]) / np.hypot(*direction)
    return start + along[:, np.newaxis] * direction + across[:, np.newaxis] * normal


def spiral(center: Array, radius: float, turns: float = 2.25) -> Array:
    """Path of a torsional spring's symbol, an Archimedean spiral from its centre, shape ``(n, 2)``."""
    share = np.linspace(0.0, 1.0, 90)
    angle = 2.0 * np.pi * turns * share
    return center + radius * share[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)])


def figure_1_planar_models(stem: Path) -> str:
    """Draws the three models with the middle segment contracted, each from its own plant; returns the caption."""
    contracted = N_SEGMENTS // 2
    outlines = {
        title: contracted_outline(load_config(preset, {"body.n_segments": N_SEGMENTS}), contracted)
        for title, preset in _PANELS.items()
    }
    rigid, coupled, bent = outlines.values()
    with canvas(3.35) as figure:
        panels = figure.subplots(2, 2).ravel()
        half_width = 1.09 * max(_CM * outline[-1, -1, 0] for outline in outlines.values()) / 2.0
        half_height = 1.29 * _CM * max(outline[..., 1].max() for outline in outlines.values())
        for axes, (title, outline) in zip(panels, outlines.items(), strict=False):
            points = _CM * outline
            _draw_worm(axes, points, contracted)
            middle = points[-1, -1, 0] / 2.0
            axes.set_xlim(middle - half_width, middle + half_width)
            panel_title(axes, title)
        _draw_dimensions(panels[0], _CM * rigid)
        for joint in _CM * coupled[1:, 0]:
            _draw_torsional_spring(panels[1], joint)
        for middle in _CM * bent[:, 1::2].reshape(-1, 2):
            _draw_torsional_spring(panels[2], middle)
            _draw_torsional_spring(panels[2], middle * [1.0, -1.0])
        panels[3].set_xlim(0.0, 2.0 * half_width)
        _draw_key(panels[3], half_height)
        for axes in panels:
            axes.set_ylim(-half_height, half_height)
            axes.set_aspect("equal")
            axes.axis("off")
        save_both(figure, stem)
    return caption(1)


_PANELS = {
    "a) Riddle et al.": "riddle2022-planar",
    "b) Daltorio et al.": "daltorio2013",
    "c) Boxerbaum et al.": "boxerbaum2012",
}
_ACTUATOR, _SPRING = segment_colors(2)
_SIDE = "0.25"


def _draw_worm(axes: Axes, outline: Array, contracted: int) -> None:
    """Draws sides, hinges, actuators and axial springs; lengths in cm."""
    for index, upper in enumerate(outline):
        lower = upper * [1.0, -1.0]
        if index == contracted:
            axes.fill(*np.concatenate([upper, lower[::-1]]).T, color="0.91", linewidth=0.0, zorder=0)
        for half in (upper, lower):
            axes.plot(*half.T, color=_SIDE, linewidth=1.8, solid_joinstyle="round", zorder=2)
        top = upper[len(upper) // 2]
        for end in (top, top * [1.0, -1.0]):
            _draw_hinge(axes, end)
            _draw_actuator(axes, end * [1.0, 0.88], end * [1.0, 0.32], active=index == contracted)
        axes.plot(*zigzag(upper[0], upper[-1], 0.45).T, color=_SPRING, linewidth=1.1, zorder=1)
    for joint in (*outline[:, 0], outline[-1, -1]):
        _draw_hinge(axes, joint)


def _draw_hinge(axes: Axes, place: Array) -> None:
    axes.plot(*place, "o", markersize=3.8, markerfacecolor="w", markeredgecolor=_SIDE, markeredgewidth=1.0, zorder=4)


def _draw_actuator(axes: Axes, start: Array, end: Array, *, active: bool) -> None:
    shape = {"arrowstyle": "simple,head_length=5,head_width=7,tail_width=2.4", "shrinkA": 0.0, "shrinkB": 0.0}
    look = {"facecolor": _ACTUATOR if active else "w", "edgecolor": _ACTUATOR, "linewidth": 0.9, "zorder": 3}
    axes.add_patch(FancyArrowPatch((start[0], start[1]), (end[0], end[1]), **shape, **look))


def _draw_torsional_spring(axes: Axes, place: Array) -> None:
    axes.plot(*spiral(place, 0.85).T, color="w", linewidth=2.6, zorder=5)
    axes.plot(*spiral(place, 0.85).T, color=_SPRING, linewidth=1.3, zorder=6)


def _draw_dimensions(axes: Axes, outline: Array) -> None:
    """Draws height, length and side of the last segment, which is relaxed; lengths in cm."""
    front, top, rear = outline[-1]
    thin = {"color": "0.45", "linewidth": 0.7}
    right, below = rear[0] + 0.9, -top[1] - 0.8
    axes.plot([top[0] + 0.6, right + 0.4], [top[1]] * 2, **thin)
    axes.plot([top[0] + 0.6, right + 0.4], [-top[1]] * 2, **thin)
    axes.plot([front[0]] * 2, [-0.8, below - 0.4], **thin)
    axes.plot([rear[0]] * 2, [-0.8, below - 0.4], **thin)
    ends = {"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0, **thin}
    axes.annotate("", (right, top[1]), (right, -top[1]), arrowprops=ends)
    axes.annotate("", (front[0], below), (rear[0], below), arrowprops=ends)
    axes.text(right + 0.4, 0.0, "$w$", va="center")
    axes.text((front[0] + rear[0]) / 2.0, below - 0.3, "$l$", ha="center", va="top")
    axes.text((top[0] + rear[0]) / 2.0 + 0.4, top[1] / 2.0 + 0.3, "$l_s$", va="bottom")


def _draw_key(axes: Axes, half_height: float) -> None:
    """Explains the symbols and gives the scale; lengths in cm."""
    entries = "rigid side with hinges", "actuator (filled: contracted)", "linear spring", "torsional spring", "5 cm"
    rows = np.linspace(0.78, -0.78, len(entries)) * half_height
    left, right = 1.0, 6.0
    for text, y in zip(entries, rows, strict=True):
        axes.text(right + 1.2, y, text, va="center")
    side, linear, scale = (np.array([[left, rows[row]], [right, rows[row]]]) for row in (0, 2, 4))
    middle = (left + right) / 2.0
    axes.plot(*side.T, color=_SIDE, linewidth=1.8)
    for end in side:
        _draw_hinge(axes, end)
    _draw_actuator(axes, np.array([left, rows[1]]), np.array([middle - 0.5, rows[1]]), active=True)
    _draw_actuator(axes, np.array([middle + 0.5, rows[1]]), np.array([right, rows[1]]), active=False)
    axes.plot(*zigzag(linear[0], linear[1], 0.45, lead=0.1).T, color=_SPRING, linewidth=1.1)
    _draw_torsional_spring(axes, np.array([middle, rows[3]]))
    axes.plot(*scale.T, color="k", linewidth=1.4, marker="|", markersize=6)

"""Symbols of a network's diagram: neurons, connections by what they do, and arrows from and to the outside."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from annelid.draw.figures.network_layout import HEADER, Stub
from annelid.draw.figures.network_paths import RADIUS, arc_length, points_at, with_resistor
from annelid.draw.style import segment_colors
from annelid.nervous import Connection, GapJunction, ModulatorySynapse, Network
from annelid.protocols import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Effect = Literal["excitatory", "inhibitory", "modulatory", "gap junction", "rectified gap junction"]

_TRIANGLE = 0.17
_DOT = 0.065
_INHIBITORY, _EXCITATORY = segment_colors(2)
COLORS: dict[Effect, Any] = {
    "excitatory": _EXCITATORY,
    "inhibitory": _INHIBITORY,
    "modulatory": "0.35",
    "gap junction": "0.35",
    "rectified gap junction": "0.35",
}


def effect(network: Network, link: Connection) -> Effect:
    """Tells what a connection does: a synapse excites if its reversal potential lies above its target's rest."""
    kind = link.kind
    if isinstance(kind, ModulatorySynapse):
        return "modulatory"
    if isinstance(kind, GapJunction):
        return "rectified gap junction" if kind.rectified else "gap junction"
    return "excitatory" if kind.reversal_mV > network.neurons[link.target].rest_mV else "inhibitory"


def draw_column(axes: Axes, segment: int, places: Array) -> None:
    """Draws a segment's background around its neurons, and its name above them."""
    from matplotlib.patches import FancyBboxPatch

    (left, bottom), (right, top) = places.min(axis=0), places.max(axis=0)
    pad = 0.44
    axes.add_patch(
        FancyBboxPatch(
            (left, bottom),
            right - left,
            top - bottom,
            boxstyle=f"round,pad={pad},rounding_size=0.2",
            facecolor="0.945",
            edgecolor="none",
            zorder=0,
        )
    )
    axes.text((left + right) / 2.0, top + HEADER, f"segment {segment}", ha="center", va="center", zorder=7)


def draw_neuron(axes: Axes, place: Array, symbol: str, gated: bool, gid: str | None = None) -> None:
    """Draws a circle with a symbol in it, with a double outline if the neuron has gated channels."""
    from matplotlib.patches import Circle

    center = (float(place[0]), float(place[1]))
    axes.add_patch(Circle(center, RADIUS, facecolor="w", edgecolor="k", linewidth=1.3, zorder=5, gid=gid))
    if gated:
        axes.add_patch(Circle(center, 0.84 * RADIUS, facecolor="none", edgecolor="k", linewidth=0.8, zorder=5))
    size = 9.0 if len(symbol) <= 3 else 7.0
    axes.text(*center, symbol, ha="center", va="center_baseline", fontsize=size, zorder=6)


def draw_connection(axes: Axes, route: Array, what: Effect, gid: str | None = None) -> None:
    """Draws a path with an open triangle, a filled dot, or a resistor in its middle."""
    from matplotlib.patches import Circle, Polygon

    color = COLORS[what]
    gap = "gap" in what
    end_length = 0.0 if gap else _TRIANGLE if what == "excitatory" else 2.0 * _DOT
    tip = route[-1]
    body = route[np.linalg.norm(route - tip, axis=1) >= end_length - 1e-12] if end_length else route
    base = body[-1]
    forward = (tip - base) / np.hypot(*(tip - base)) if end_length else np.zeros(2)
    if gap:
        body = with_resistor(body)
    dashes = "--" if what == "modulatory" else "-"
    axes.plot(*body.T, dashes, color=color, linewidth=1.3, solid_joinstyle="miter", gid=gid, zorder=2)
    if what == "excitatory":
        base = tip - _TRIANGLE * forward
        across = 0.5 * _TRIANGLE * np.array([-forward[1], forward[0]])
        corners = np.array([tip, base + across, base - across])
        axes.add_patch(Polygon(corners, facecolor="w", edgecolor=color, linewidth=1.2, joinstyle="miter", zorder=3))
    elif what == "inhibitory":
        center = tip - _DOT * forward
        axes.add_patch(Circle((center[0], center[1]), _DOT, facecolor=color, edgecolor=color, zorder=3))
    elif what == "modulatory":
        middle, side = tip - _DOT * forward, _DOT * np.array([-forward[1], forward[0]])
        corners = np.array([tip, middle + side, tip - 2.0 * _DOT * forward, middle - side])
        axes.add_patch(Polygon(corners, facecolor="w", edgecolor=color, linewidth=1.2, zorder=3))
    elif what == "rectified gap junction":
        _draw_diode(axes, route, color)


def _draw_diode(axes: Axes, route: Array, color: Any) -> None:
    from matplotlib.patches import Polygon

    along = arc_length(route)[-1]
    tip, back = points_at(route, np.array([0.9 * along, 0.9 * along - 0.1]))
    across = 0.55 * np.array([-(tip - back)[1], (tip - back)[0]])
    axes.add_patch(Polygon([tip, back + across, back - across], facecolor=color, edgecolor=color, zorder=3))
    axes.plot(*np.array([tip + across, tip - across]).T, color=color, linewidth=1.3, zorder=3)


def write_conductance(axes: Axes, route: Array, share: float, conductance_uS: float) -> None:
    """Writes a number on a path, at a share of its length."""
    x, y = points_at(route, np.array([share * arc_length(route)[-1]]))[0]
    paper = {"facecolor": "w", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
    axes.text(x, y, f"{conductance_uS:.2f}", ha="center", va="center", fontsize=7, bbox=paper, zorder=2.5)


def draw_arrow(axes: Axes, path: Array, gid: str | None = None) -> None:
    """Draws an input or an output, from tail to head."""
    from matplotlib.patches import FancyArrowPatch

    (x0, y0), (x1, y1) = path
    style = "-|>,head_length=4.5,head_width=2.2"
    axes.add_patch(
        FancyArrowPatch((x0, y0), (x1, y1), arrowstyle=style, shrinkA=0, shrinkB=0, color="0.3", zorder=3, gid=gid)
    )


def write_beside(axes: Axes, stub: Stub) -> None:
    """Writes a stub's label at its outer end, away from the neuron."""
    x, y = stub.outer + 0.06 * stub.direction
    sideways, upwards = stub.direction
    across = "center" if abs(sideways) < 0.3 else "left" if sideways > 0 else "right"
    along = "center" if abs(upwards) < 0.3 else "bottom" if upwards > 0 else "top"
    axes.text(x, y, stub.label, ha=across, va=along, fontsize=8, zorder=7)

"""The diagram of a network of neurons, drawn from the network itself; figure 6 of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from annelid.draw.canvas import WIDTH_IN, canvas, save_both
from annelid.draw.figures.network_layout import (
    HEADER,
    RADIUS,
    Diagram,
    Stub,
    arc_length,
    bounds,
    lay_out,
    points_at,
    role_of,
    with_resistor,
)
from annelid.draw.style import segment_colors
from annelid.nervous import Connection, GapJunction, ModulatorySynapse, Network
from annelid.protocols import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CAPTION = (
    "The network that controls the worm, drawn from the network object that the simulation steps: one column a "
    "segment. The contraction and the expansion neuron (U1, U2) form a half-centre: they have a persistent sodium "
    "channel (double outline) and inhibit each other. The sensory neuron (U3), which the stretch sensor excites while "
    "its segment is at rest length, holds the segment expanded; the relay (U4) silences the sensory neuron of the next "
    "segment, and that of the last segment closes the ring to the first."
)

PAPER_SYMBOLS = {"contraction": "U1", "expansion": "U2", "sensory": "U3", "relay": "U4"}
"""The paper's symbols of the four neurons of a segment, by the role in a neuron's name."""

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
_SMALLEST_UNIT_IN, _SMALLEST_UNIT_WITH_NUMBERS_IN, _LARGEST_UNIT_IN = 0.5, 0.9, 1.0
_MEANINGS_A_ROW = 5
_ROW_IN, _KEY_COLUMNS_IN, _KEY_UNIT_IN = 0.28, (0.25, 2.8, 5.1), 0.45


def effect(network: Network, link: Connection) -> Effect:
    """Tells what a connection does: a synapse excites if its reversal potential lies above its target's rest."""
    kind = link.kind
    if isinstance(kind, ModulatorySynapse):
        return "modulatory"
    if isinstance(kind, GapJunction):
        return "rectified gap junction" if kind.rectified else "gap junction"
    return "excitatory" if kind.reversal_mV > network.neurons[link.target].rest_mV else "inhibitory"


def network_diagram(
    axes: Axes, network: Network, symbols: Mapping[str, str] | None = None, *, conductances: bool = False
) -> Diagram:
    """Draws any network into axes: each neuron, connection, input and output once.

    The artists carry group ids, which are ids in an SVG file too: ``neuron-<name>``, ``synapse-<i>`` and ``gap-<i>``
    with i the place among the network's connections, ``input-<name>-<neuron>`` and ``output-<name>``.

    Args:
        axes: Where to draw; its limits are set, its frame is removed.
        network: The network.
        symbols: What to write into a neuron, by its name without the segment's number; default: `abbreviations`.
        conductances: Whether to write the largest conductance beside each connection.

    Returns:
        The layout.
    """
    diagram = lay_out(network)
    symbols = abbreviations(network.neurons) | dict(symbols or {})
    left, right, bottom, top = bounds(diagram)
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_aspect("equal")
    axes.axis("off")
    for segment, names in diagram.columns.items():
        _draw_column(axes, segment, np.array([diagram.places[name] for name in names]))
    for index, (link, route) in enumerate(zip(network.connections, diagram.routes, strict=True)):
        what = effect(network, link)
        gid = f"{'gap' if 'gap' in what else 'synapse'}-{index}"
        _draw_connection(axes, route, what, gid)
        if conductances and not isinstance(link.kind, ModulatorySynapse):
            # A gap junction has its resistor in the middle.
            _write_conductance(axes, route, 0.2 if "gap" in what else 0.4, link.kind.conductance_uS)
    for stub in diagram.inputs:
        _draw_stub(axes, stub, f"input-{stub.name}-{stub.neuron}")
    for stub in diagram.outputs:
        _draw_stub(axes, stub, f"output-{stub.name}")
    for name, place in diagram.places.items():
        _draw_neuron(axes, place, symbols[role_of(name)], bool(network.neurons[name].channels), f"neuron-{name}")
    return diagram


def abbreviations(names: Iterable[str]) -> dict[str, str]:
    """Shortens names, without their segments' numbers, to three letters or as many as tell them apart."""
    roles = list(dict.fromkeys(role_of(name) for name in names))
    short: dict[str, str] = {}
    for role in roles:
        others = [other for other in roles if other != role]
        lengths = range(min(3, len(role)), len(role) + 1)
        short[role] = next((role[:n] for n in lengths if not any(o.startswith(role[:n]) for o in others)), role)
    return short


def figure_6_network_diagram(
    network: Network, stem: Path, symbols: Mapping[str, str] = PAPER_SYMBOLS, *, conductances: bool = False
) -> Path:
    """Draws a network with a key to its symbols.

    Args:
        network: The network.
        stem: Path of the two files without their suffixes.
        symbols: What to write into a neuron, by its name without the segment's number.
        conductances: Whether to write the largest conductance beside each connection.

    Returns:
        The path of the PNG file; the SVG file lies beside it.
    """
    left, right, bottom, top = bounds(lay_out(network))
    smallest_in = _SMALLEST_UNIT_WITH_NUMBERS_IN if conductances else _SMALLEST_UNIT_IN
    width_in = max(WIDTH_IN, smallest_in * (right - left))
    unit_in = min(width_in / (right - left), _LARGEST_UNIT_IN)
    diagram_in = unit_in * (top - bottom)
    key = _key(network)
    meanings = _meanings(network, symbols) + ["numbers: largest conductance (μS)"] * conductances
    key_in = _ROW_IN * (-(-len(key) // len(_KEY_COLUMNS_IN)) + len(meanings)) + 0.1
    with canvas(diagram_in + key_in, width_in) as figure:
        figure.set_layout_engine("none")
        share = key_in / (diagram_in + key_in)
        network_diagram(figure.add_axes((0.0, share, 1.0, 1.0 - share)), network, symbols, conductances=conductances)
        legend = figure.add_axes((0.0, 0.0, 1.0, share))
        _draw_key(legend, key, width_in, key_in)
        for row, meaning in enumerate(reversed(meanings)):
            legend.text(_KEY_COLUMNS_IN[0], 0.2 + _ROW_IN * row, meaning, va="center")
        return save_both(figure, stem)


def _key(network: Network) -> list[str]:
    """What the key has to explain: only what the network has."""
    effects = {effect(network, link) for link in network.connections}
    gated = {bool(neuron.channels) for neuron in network.neurons.values()}
    key = ["neuron"] * (False in gated) + ["neuron with gated channels"] * (True in gated)
    key += [what if "gap" in what else f"{what} synapse" for what in COLORS if what in effects]
    return key + ["input current"] * bool(network.inputs) + ["output: potential read"] * bool(network.outputs)


def _meanings(network: Network, symbols: Mapping[str, str]) -> list[str]:
    """Rows that say what is written into the neurons, where that is not their whole name."""
    short = abbreviations(network.neurons)
    pairs = [f"{symbols.get(role, short[role])}  {role}" for role in short if symbols.get(role, short[role]) != role]
    return ["      ".join(pairs[start : start + _MEANINGS_A_ROW]) for start in range(0, len(pairs), _MEANINGS_A_ROW)]


def _draw_key(axes: Axes, entries: Sequence[str], width_in: float, height_in: float) -> None:
    """Draws one example of each symbol beside its name; lengths in inches."""
    axes.set_xlim(0.0, width_in)
    axes.set_ylim(0.0, height_in)
    axes.axis("off")
    n_rows = -(-len(entries) // len(_KEY_COLUMNS_IN))
    # The symbols are drawn in the diagram's unit.
    symbols = axes.inset_axes((0.0, 0.0, 1.0, 1.0))
    symbols.set_xlim(0.0, width_in / _KEY_UNIT_IN)
    symbols.set_ylim(0.0, height_in / _KEY_UNIT_IN)
    symbols.axis("off")
    for index, entry in enumerate(entries):
        x, y = _KEY_COLUMNS_IN[index // n_rows], height_in - _ROW_IN * (index % n_rows + 0.5)
        axes.text(x + 0.55, y, entry, va="center")
        path = np.linspace([x, y], [x + 0.42, y], 121) / _KEY_UNIT_IN
        what = entry.removesuffix(" synapse")
        if what in COLORS:
            _draw_connection(symbols, path, what)
        elif entry.startswith("neuron"):
            _draw_neuron(symbols, path.mean(axis=0), "", "gated" in entry)
        else:
            _draw_arrow(symbols, path[[0, -1]])
            rim = path[-1 if entry.startswith("input") else 0]
            symbols.plot([rim[0]] * 2, [rim[1] - 0.15, rim[1] + 0.15], color="k", linewidth=1.3)


def _draw_column(axes: Axes, segment: int, places: Array) -> None:
    """Draws a segment's background around its neurons, and its name above them."""
    from matplotlib.patches import FancyBboxPatch

    (left, bottom), (right, top) = places.min(axis=0), places.max(axis=0)
    style = "round,pad=0.44,rounding_size=0.2"
    size = right - left, top - bottom
    axes.add_patch(FancyBboxPatch((left, bottom), *size, boxstyle=style, fc="0.945", ec="none", zorder=0))
    axes.text((left + right) / 2.0, top + HEADER, f"segment {segment}", ha="center", va="center", zorder=7)


def _draw_neuron(axes: Axes, place: Array, symbol: str, gated: bool, gid: str | None = None) -> None:
    """Draws a circle with a symbol in it, with a double outline if the neuron has gated channels."""
    from matplotlib.patches import Circle

    center = (float(place[0]), float(place[1]))
    axes.add_patch(Circle(center, RADIUS, fc="w", ec="k", linewidth=1.3, zorder=5, gid=gid))
    if gated:
        axes.add_patch(Circle(center, 0.84 * RADIUS, fc="none", ec="k", linewidth=0.8, zorder=5))
    size = 9.0 if len(symbol) <= 3 else 7.0
    axes.text(*center, symbol, ha="center", va="center_baseline", fontsize=size, zorder=6)


def _draw_connection(axes: Axes, route: Array, what: Effect, gid: str | None = None) -> None:
    """Draws a path with an open triangle, a filled dot, an open square, or a resistor in its middle."""
    from matplotlib.patches import Circle, Polygon

    color = COLORS[what]
    gap = "gap" in what
    length = 0.0 if gap else _TRIANGLE if what == "excitatory" else 2.0 * _DOT
    tip = route[-1]
    body = with_resistor(route) if gap else route[np.linalg.norm(route - tip, axis=1) >= length - 1e-12]
    dashes = "--" if what == "modulatory" else "-"
    axes.plot(*body.T, dashes, color=color, linewidth=1.3, solid_joinstyle="miter", gid=gid, zorder=2)
    if what == "rectified gap junction":
        along = arc_length(route)[-1]
        tip, back = points_at(route, np.array([0.9 * along, 0.9 * along - 0.1]))
        across = 0.55 * np.array([-(tip - back)[1], (tip - back)[0]])
        axes.add_patch(Polygon([tip, back + across, back - across], facecolor=color, edgecolor=color, zorder=3))
        axes.plot(*np.array([tip + across, tip - across]).T, color=color, linewidth=1.3, zorder=3)
    if gap:
        return
    forward = (tip - body[-1]) / np.hypot(*(tip - body[-1]))
    side = np.array([-forward[1], forward[0]])
    back, middle = tip - length * forward, tip - _DOT * forward
    open_symbol: dict[str, Any] = {"facecolor": "w", "edgecolor": color, "linewidth": 1.2, "zorder": 3}
    if what == "excitatory":
        across = 0.5 * length * side
        axes.add_patch(Polygon([tip, back + across, back - across], joinstyle="miter", **open_symbol))
    elif what == "inhibitory":
        axes.add_patch(Circle((middle[0], middle[1]), _DOT, facecolor=color, edgecolor=color, zorder=3))
    else:
        axes.add_patch(Polygon([tip, middle + _DOT * side, back, middle - _DOT * side], **open_symbol))


def _write_conductance(axes: Axes, route: Array, share: float, conductance_uS: float) -> None:
    """Writes a number on a path, at a share of its length."""
    x, y = points_at(route, np.array([share * arc_length(route)[-1]]))[0]
    paper = {"facecolor": "w", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
    axes.text(x, y, f"{conductance_uS:.2f}", ha="center", va="center", fontsize=7, bbox=paper, zorder=2.5)


def _draw_arrow(axes: Axes, path: Array, gid: str | None = None) -> None:
    """Draws an input or an output, from tail to head."""
    from matplotlib.patches import FancyArrowPatch

    style = "-|>,head_length=4.5,head_width=2.2"
    ends = tuple(path[0]), tuple(path[1])
    axes.add_patch(FancyArrowPatch(*ends, arrowstyle=style, shrinkA=0, shrinkB=0, color="0.3", zorder=3, gid=gid))


def _draw_stub(axes: Axes, stub: Stub, gid: str) -> None:
    """Draws an input or an output with its name at the outer end, away from the neuron."""
    _draw_arrow(axes, stub.path, gid)
    x, y = stub.outer + 0.06 * stub.direction
    sideways, upwards = stub.direction
    across = "center" if abs(sideways) < 0.3 else "left" if sideways > 0 else "right"
    along = "center" if abs(upwards) < 0.3 else "bottom" if upwards > 0 else "top"
    axes.text(x, y, stub.label, ha=across, va=along, fontsize=8, zorder=7)

"""The diagram of a network of neurons, drawn from the network itself; figure 6 of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from annelid.draw.canvas import WIDTH_IN, canvas, save_both
from annelid.draw.style import plain, segment_colors
from annelid.nervous import ModulatorySynapse, Network
from annelid.nervous.diagram import (
    Effect,
    Line,
    Shape,
    Words,
    arrow_shapes,
    connection_shapes,
    effect_of,
    frame_of,
    network_shapes,
    neuron_shapes,
)
from annelid.nervous.layout import role_of

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

COLORS: Mapping[Effect, str] = dict.fromkeys(get_args(Effect), "#595959") | dict(
    zip(("inhibitory", "excitatory"), segment_colors(2), strict=True)
)
_PAPER = {"facecolor": "w", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
_SMALLEST_UNIT_IN, _SMALLEST_UNIT_WITH_NUMBERS_IN, _LARGEST_UNIT_IN = 0.5, 0.9, 1.0
_MEANINGS_A_ROW = 5
_ROW_IN, _KEY_COLUMNS_IN, _KEY_UNIT_IN = 0.28, (0.25, 2.8, 5.1), 0.45


def network_diagram(
    axes: Axes, network: Network, symbols: Mapping[str, str] | None = None, *, conductances: bool = False
) -> None:
    """Draws any network into axes: each neuron, connection, input and output once.

    The artists carry the keys of `annelid.nervous.diagram.network_shapes` as group ids, which are ids in an SVG file
    too.

    Args:
        axes: Where to draw; its limits are set, its frame is removed.
        network: The network.
        symbols: What to write into a neuron, by its name without the segment's number; default: `abbreviations`.
        conductances: Whether to write the largest conductance on each connection.
    """
    shapes = _shapes(network, symbols or {}, conductances)
    left, right, bottom, top = frame_of(shapes, _SMALLEST_UNIT_IN)
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_aspect("equal")
    axes.axis("off")
    _paint(axes, shapes)


def _shapes(network: Network, symbols: Mapping[str, str], conductances: bool) -> list[Shape]:
    written = abbreviations(network.neurons) | dict(symbols)
    numbers = [
        f"{link.kind.conductance_uS:.2f}" if conductances and not isinstance(link.kind, ModulatorySynapse) else ""
        for link in network.connections
    ]
    return network_shapes(network, {name: written[role_of(name)] for name in network.neurons}, numbers, COLORS)


def _paint(axes: Axes, shapes: Iterable[Shape]) -> None:
    from matplotlib.patches import Polygon

    for shape in shapes:
        if isinstance(shape, Words):
            place, paper = (float(shape.place[0]), float(shape.place[1])), _PAPER if shape.clears else None
            look: dict[str, Any] = {"fontsize": shape.size_pt, "ha": shape.across, "va": shape.along, "bbox": paper}
            axes.text(*place, plain(shape.text), color=shape.color, zorder=shape.layer, **look)
            continue
        look = {"linewidth": shape.width_pt, "zorder": shape.layer, "gid": shape.key or None}
        if shape.fill:
            look |= {"facecolor": shape.fill, "edgecolor": shape.color, "joinstyle": "miter"}
            axes.add_patch(Polygon(shape.points, **look))
        else:
            look |= {"linestyle": "--" if shape.dashed else "-", "color": shape.color, "solid_joinstyle": "miter"}
            axes.plot(*shape.points.T, **look)


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
    left, right, bottom, top = frame_of(_shapes(network, symbols, conductances), _SMALLEST_UNIT_IN)
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
    effects = {effect_of(network, link) for link in network.connections}
    neurons = network.neurons.values()
    gated, spiking = {bool(neuron.channels) for neuron in neurons}, any(neuron.firing for neuron in neurons)
    key = ["neuron"] * (False in gated) + ["neuron with gated channels"] * (True in gated)
    key += ["spiking neuron"] * spiking
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
            shapes = connection_shapes(path, what, COLORS[what])
        elif "neuron" in entry:
            shapes = neuron_shapes(path.mean(axis=0), "", spiking="spiking" in entry, gated="gated" in entry)
        else:
            shapes = arrow_shapes(path[[0, -1]])
            rim = path[-1 if entry.startswith("input") else 0]
            shapes.append(Line(np.array([np.add(rim, (0.0, -0.15)), np.add(rim, (0.0, 0.15))]), "black"))
        _paint(symbols, shapes)

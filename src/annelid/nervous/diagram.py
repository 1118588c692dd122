"""Networks as shapes in a plane, and these as SVG; further as Graphviz source and Markdown tables.

All of it is text, nothing to install. `annelid.draw.figures.network_diagram` paints the same shapes with matplotlib.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from annelid.errors import ConfigError
from annelid.nervous.layout import RADIUS, STUB, Stub, arc_length, lay_out, points_at, rounded, with_resistor
from annelid.nervous.neurons import Array
from annelid.nervous.synapses import GapJunction, ModulatorySynapse, SpikingSynapse, Synapse
from annelid.text import printable

if TYPE_CHECKING:
    from annelid.nervous.network import Connection, Network
    from annelid.nervous.neurons import Neuron

Effect = Literal["excitatory", "inhibitory", "modulatory", "gap junction", "rectified gap junction"]
COLORS: Mapping[Effect, str] = {
    "excitatory": "#1b7837",
    "inhibitory": "#b2182b",
    "modulatory": "#7b3294",
    "gap junction": "#2166ac",
    "rectified gap junction": "#2166ac",
}
_HEADS = {
    "excitatory": "empty",
    "inhibitory": "dot",
    "modulatory": "box",
    "gap junction": "none",
    "rectified gap junction": "diamond",
}
"""Graphviz's arrowheads."""
_MOST_LABELLED = 40
"""Connections beside which there is room for words in the SVG."""
_HEADER = RADIUS + STUB + 0.16
"""Height of a segment's name above its uppermost neuron."""
_TRIANGLE, _DOT, _ARROW = 0.17, 0.065, (0.0625, 0.03)
_GREY = "#4d4d4d"
_BACK, _PATHS, _MARKS, _RIMS, _FRONT = range(5)
_PIXELS = 96.0
"""Of the SVG, per distance between neighbouring neurons."""
_PT = 96.0 / 72.0
_CIRCLE = 48
"""Corners of what looks round."""


@dataclass(frozen=True, slots=True)
class Line:
    """A line through points; with a fill it is closed.

    Attributes:
        points: In units of the distance between neighbouring neurons, y upwards, ``(n, 2)``.
        color: Of the line.
        width_pt: Its width, points.
        fill: Colour of what it encloses.
        dashed: Whether it is.
        layer: What lies in a higher layer is drawn over it.
        key: Its id in the drawing; empty for parts of something else.
    """

    points: Array
    color: str
    width_pt: float = 1.3
    fill: str = ""
    dashed: bool = False
    layer: int = _PATHS
    key: str = ""


@dataclass(frozen=True, slots=True)
class Words:
    """Plain text at a place, ``(2,)``, which lies on the named sides of it; behind it the ground may be cleared."""

    text: str
    place: Array
    size_pt: float
    across: Literal["left", "center", "right"] = "center"
    along: Literal["bottom", "center", "top"] = "center"
    color: str = "black"
    clears: bool = False
    layer: int = _FRONT


Shape = Line | Words


@dataclass(frozen=True, slots=True)
class Diagram:
    """A network drawn, in two forms; notebooks show the SVG by themselves.

    Attributes:
        graphviz: Source in the DOT language.
        svg: A complete SVG document.
    """

    graphviz: str
    svg: str

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: str | Path) -> Path:
        """Writes the form that the suffix names, ``.svg``, ``.dot`` or ``.gv``, and returns the path.

        Raises:
            ConfigError: Another suffix.
        """
        target = Path(path)
        forms = {".svg": self.svg, ".dot": self.graphviz, ".gv": self.graphviz}
        if target.suffix not in forms:
            raise ConfigError(f"a diagram is saved as .svg, .dot or .gv, not as {target.name!r}")
        target.write_text(forms[target.suffix], encoding="utf-8")
        return target


def draw_diagram(network: Network) -> Diagram:
    """Draws a network.

    Open triangles excite, filled dots inhibit, dashed lines to open squares modulate; gap junctions are resistors,
    rectified ones with a diode. Spiking neurons are octagons, neurons with gated channels have a double rim.

    Args:
        network: Any network.

    Returns:
        Its Graphviz source and its SVG.
    """
    strengths = [
        strength_of(link) if len(network.connections) <= _MOST_LABELLED else "" for link in network.connections
    ]
    shapes = network_shapes(network, {name: name for name in network.neurons}, strengths, COLORS)
    return Diagram("\n".join(_graphviz(network)) + "\n", _svg(network.name, shapes))


def network_shapes(
    network: Network, labels: Mapping[str, str], strengths: Sequence[str], colors: Mapping[Effect, str]
) -> list[Shape]:
    """Draws each neuron, connection, input and output of a network once.

    Their keys are ``neuron-<name>``, ``synapse-<i>`` and ``gap-<i>`` with i the place among the network's connections,
    ``input-<name>-<neuron>`` and ``output-<name>``.

    Args:
        network: The network.
        labels: What stands in each neuron, by its name.
        strengths: What stands on each connection; empty for nothing.
        colors: Colours of the connections.

    Returns:
        The shapes, from back to front.
    """
    layout = lay_out(network)
    shapes: list[Shape] = []
    for segment, names in layout.columns.items():
        shapes += _column(f"segment {segment}", np.array([layout.places[name] for name in names]))
    for index, (link, route, words) in enumerate(zip(network.connections, layout.routes, strengths, strict=True)):
        effect = effect_of(network, link)
        shapes += connection_shapes(route, effect, colors[effect], f"{'gap' if 'gap' in effect else 'synapse'}-{index}")
        if words:
            # A gap junction has its resistor in the middle.
            along = (0.2 if "gap" in effect else 0.4) * arc_length(route)[-1:]
            shapes.append(Words(words, points_at(route, along)[0], 7.0, clears=True, layer=_MARKS))
    for stub in layout.inputs:
        shapes += _stub(stub, f"input-{stub.name}-{stub.neuron}")
    for stub in layout.outputs:
        shapes += _stub(stub, f"output-{stub.name}")
    for name, place in layout.places.items():
        neuron = network.neurons[name]
        spiking, gated = neuron.firing is not None, bool(neuron.channels)
        shapes += neuron_shapes(place, labels[name], spiking=spiking, gated=gated, key=f"neuron-{name}")
    return sorted(shapes, key=lambda shape: shape.layer)


def neuron_shapes(place: Array, label: str, *, spiking: bool, gated: bool, key: str = "") -> list[Shape]:
    """Draws a circle, or an octagon for a neuron that spikes, with a double rim if it has gated channels."""
    size = 9.0 if len(label) <= 3 else min(7.0, max(5.0, 65.0 / len(label)))
    n_corners = 8 if spiking else _CIRCLE
    rims = [Line(_polygon(place, RADIUS, n_corners), "black", 1.3, "white", layer=_RIMS, key=key)]
    if gated:
        rims.append(Line(_polygon(place, 0.84 * RADIUS, n_corners), "black", 0.8, "white", layer=_RIMS))
    return [*rims, Words(label, place, size)]


def _polygon(center: Array, radius: float, n_corners: int) -> Array:
    turn = np.pi * (2 * np.arange(n_corners) + 1) / n_corners
    return center + radius * np.column_stack([np.cos(turn), np.sin(turn)])


def connection_shapes(route: Array, effect: Effect, color: str, key: str = "") -> list[Shape]:
    """Draws a path, ``(n, 2)``, that ends in a triangle, a dot or a square, or has a resistor in its middle."""
    gap = "gap" in effect
    length = 0.0 if gap else _TRIANGLE if effect == "excitatory" else 2.0 * _DOT
    tip = route[-1]
    body = with_resistor(route) if gap else route[np.linalg.norm(route - tip, axis=1) >= length - 1e-12]
    shapes: list[Shape] = [Line(body, color, dashed=effect == "modulatory", key=key)]
    if effect == "rectified gap junction":
        along = 0.9 * arc_length(route)[-1]
        tip, back = points_at(route, np.array([along, along - 0.1]))
        across = 0.55 * np.array([-(tip - back)[1], (tip - back)[0]])
        diode = np.array([tip, back + across, back - across])
        shapes += [
            Line(diode, color, 1.0, color, layer=_MARKS),
            Line(np.array([tip + across, tip - across]), color, layer=_MARKS),
        ]
    if gap:
        return shapes
    forward = (tip - body[-1]) / np.hypot(*(tip - body[-1]))
    side = np.array([-forward[1], forward[0]])
    back, middle = tip - length * forward, tip - _DOT * forward
    if effect == "inhibitory":
        return [*shapes, Line(_polygon(middle, _DOT, _CIRCLE), color, 1.0, color, layer=_MARKS)]
    across = 0.5 * length * side if effect == "excitatory" else _DOT * side
    corners = (
        [tip, back + across, back - across] if effect == "excitatory" else [tip, middle + across, back, middle - across]
    )
    return [*shapes, Line(np.array(corners), color, 1.2, "white", layer=_MARKS)]


def arrow_shapes(path: Array, key: str = "") -> list[Shape]:
    """Draws an input or an output from tail to head, ``(2, 2)``."""
    forward = (path[1] - path[0]) / np.hypot(*(path[1] - path[0]))
    back, across = path[1] - _ARROW[0] * forward, _ARROW[1] * np.array([-forward[1], forward[0]])
    return [
        Line(np.array([path[0], back]), _GREY, 1.0, key=key),
        Line(np.array([path[1], back + across, back - across]), _GREY, 1.0, _GREY, layer=_MARKS),
    ]


def _column(name: str, places: Array) -> list[Shape]:
    """Draws a segment's background around its neurons, and its name above them."""
    (left, bottom), (right, top) = places.min(axis=0) - 0.44, places.max(axis=0) + 0.44
    middle = (left + right) / 2.0
    corners = [(middle, top), (left, top), (left, bottom), (right, bottom), (right, top), (middle, top)]
    return [
        Line(rounded(np.array(corners), 0.2), "none", 0.0, "#f1f1f1", layer=_BACK),
        Words(name, np.array([middle, top - 0.44 + _HEADER]), 9.0),
    ]


def _stub(stub: Stub, key: str) -> list[Shape]:
    """Draws an input or an output with its name, unless that is the neuron's, at the outer end."""
    sideways, upwards = stub.direction
    across = "center" if abs(sideways) < 0.3 else "left" if sideways > 0 else "right"
    along = "center" if abs(upwards) < 0.3 else "bottom" if upwards > 0 else "top"
    label = "" if stub.name == stub.neuron else stub.name.replace("_", " ")
    return [*arrow_shapes(stub.path, key), Words(label, stub.outer + 0.06 * stub.direction, 8.0, across, along)]


def frame_of(shapes: Iterable[Shape], unit_in: float = 1.0) -> tuple[float, float, float, float]:
    """Returns left, right, bottom and top of shapes with a margin, where a unit is so many inches."""
    corners = [np.zeros(2)]
    for shape in shapes:
        if isinstance(shape, Line):
            corners += [shape.points.min(axis=0), shape.points.max(axis=0)]
        else:
            size = shape.size_pt / 72.0 / unit_in
            width = 0.6 * size * len(shape.text)
            left = {"left": 0.0, "center": -0.5, "right": -1.0}[shape.across] * width
            corners += [np.add(shape.place, (left, -size)), np.add(shape.place, (left + width, size))]
    (left, bottom), (right, top) = np.min(corners, axis=0) - 0.15, np.max(corners, axis=0) + 0.15
    return float(left), float(right), float(bottom), float(top)


def effect_of(network: Network, connection: Connection) -> Effect:
    """Returns what a connection does: a reversal potential above its target's rest excites, another inhibits."""
    kind = connection.kind
    if isinstance(kind, GapJunction):
        return "rectified gap junction" if kind.rectified else "gap junction"
    if isinstance(kind, ModulatorySynapse):
        return "modulatory"
    return "excitatory" if kind.reversal_mV > network.neurons[connection.target].rest_mV else "inhibitory"


def strength_of(connection: Connection) -> str:
    """Returns the words beside a connection: conductance, or what is modulated by which factor."""
    kind = connection.kind
    if isinstance(kind, ModulatorySynapse):
        return f"{kind.quantity} × {kind.factor:.3g}"
    return f"{kind.conductance_uS:.3g} uS"


def markdown_tables(network: Network) -> str:
    """Returns neurons, connections, inputs and outputs as Markdown tables.

    Units stand in the headings; the properties that differ from the default are named in the last column.
    """
    neurons = []
    for name, n in network.neurons.items():
        numbers = n.capacitance_nF, n.leak_conductance_uS, n.rest_mV, n.bias_nA, network.initial_mV[name]
        neurons.append((name, *(f"{number:g}" for number in numbers), _specials(n)))
    connections = [(c.source, c.target, effect_of(network, c), *_connection_cells(c.kind)) for c in network.connections]
    parts = [f"# {_cell(network.name)}", "", f"## Neurons ({len(neurons)})", ""]
    parts += _table(("neuron", "C (nF)", "Gm (uS)", "rest (mV)", "bias (nA)", "start (mV)", "also"), neurons)
    parts += ["", f"## Connections ({len(connections)})", ""]
    parts += _table(("source", "target", "effect", "g (uS)", "E (mV)", "also"), connections)
    if network.inputs:
        parts += ["", "## Inputs", ""]
        parts += _table(("input (nA)", "neurons"), [(name, ", ".join(to)) for name, to in network.inputs.items()])
    if network.outputs:
        parts += ["", "## Outputs", "", *_table(("output (mV)", "neuron"), list(network.outputs.items()))]
    return "\n".join(parts) + "\n"


def _specials(neuron: Neuron) -> str:
    words = [
        f"channel {channel.conductance_uS:g} uS to {channel.reversal_mV:g} mV, "
        + (f"{len(channel.gates)} gates" if len(channel.gates) != 1 else "1 gate")
        + "".join(f", tau {gate.time_constant_ms:g} ms" for gate in channel.slow_gates)
        for channel in neuron.channels
    ]
    if neuron.firing is not None:
        words.append(f"fires at {neuron.firing.threshold_mV:g} mV, reset to {neuron.firing.reset_mV:g} mV")
        if neuron.firing.adaptation:
            words[-1] += f", adaptation {neuron.firing.adaptation:g}"
    return "; ".join(words)


def _connection_cells(kind: Synapse | GapJunction | SpikingSynapse | ModulatorySynapse) -> tuple[str, str, str]:
    if isinstance(kind, GapJunction):
        return f"{kind.conductance_uS:.6g}", "", ""
    if isinstance(kind, SpikingSynapse):
        words = f"tau {kind.time_constant_ms:g} ms, increment {kind.increment:g}"
        return f"{kind.conductance_uS:.6g}", f"{kind.reversal_mV:g}", words
    reach = f"{kind.threshold_mV:g} to {kind.saturation_mV:g} mV"
    if isinstance(kind, ModulatorySynapse):
        return "", "", f"{kind.quantity} × {kind.factor:g}, {reach}"
    return f"{kind.conductance_uS:.6g}", f"{kind.reversal_mV:g}", reach


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [heading, tuple("---" for _ in heading), *rows]
    return [f"| {' | '.join(_cell(entry) for entry in line)} |" for line in lines]


def _cell(text: str) -> str:
    return _line(text.replace("|", "\\|"))


def _quoted(text: str) -> str:
    """A DOT string of one line; a control character would end the statement or be unreadable."""
    return json.dumps(_line(text), ensure_ascii=False)


def _graphviz(network: Network) -> Iterator[str]:
    yield f"digraph {_quoted(network.name)} {{"
    yield "  rankdir=LR;"
    yield "  node [shape=circle, fontsize=10];"
    yield "  edge [fontsize=8];"
    keys = {name: f"n{number}" for number, name in enumerate(network.neurons)}
    for name, neuron in network.neurons.items():
        shape = "octagon" if neuron.firing is not None else "circle"
        rims = 2 if neuron.channels else 1
        yield f"  {keys[name]} [label={_quoted(name)}, shape={shape}, peripheries={rims}];"
    for connection in network.connections:
        effect = effect_of(network, connection)
        style = ", style=dashed" if "gap" in effect else ", style=dotted" if effect == "modulatory" else ""
        yield (
            f"  {keys[connection.source]} -> {keys[connection.target]} "
            f'[label="{strength_of(connection)}", color="{COLORS[effect]}", arrowhead={_HEADS[effect]}{style}];'
        )
    for number, (name, targets) in enumerate(network.inputs.items()):
        yield f"  i{number} [label={_quoted(name)}, shape=plaintext];"
        yield from (f"  i{number} -> {keys[target]} [arrowhead=normal];" for target in targets)
    for number, (name, source) in enumerate(network.outputs.items()):
        yield f"  o{number} [label={_quoted(name)}, shape=plaintext];"
        yield f"  {keys[source]} -> o{number} [arrowhead=normal];"
    yield "}"


def _svg(title: str, shapes: Sequence[Shape]) -> str:
    """A document whose frame holds all shapes, drawn from back to front."""
    left, right, bottom, top = (_PIXELS * side for side in frame_of(shapes))
    frame = f'width="{right - left:.1f}" height="{top - bottom:.1f}"'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" {frame} font-family="sans-serif" '
            f'viewBox="{left:.1f} {-top:.1f} {right - left:.1f} {top - bottom:.1f}">',
            f"<title>{escape(_line(title))}</title>",
            f'<rect x="{left:.1f}" y="{-top:.1f}" {frame} fill="white"/>',
            *map(_svg_element, shapes),
            "</svg>\n",
        ]
    )


def _svg_element(shape: Shape) -> str:
    if isinstance(shape, Words):
        x, y = _PIXELS * shape.place * (1.0, -1.0)
        size = _PT * shape.size_pt
        y += {"bottom": 0.0, "center": 0.35, "top": 0.75}[shape.along] * size
        anchor = {"left": "start", "center": "middle", "right": "end"}[shape.across]
        look = f'font-size="{size:.1f}" text-anchor="{anchor}" fill="{shape.color}"'
        if shape.clears:
            look += ' stroke="white" stroke-width="2.5" paint-order="stroke"'
        return f'<text x="{x:.1f}" y="{y:.1f}" {look}>{escape(_line(shape.text))}</text>'
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in _PIXELS * shape.points * (1.0, -1.0))
    look = f'fill="{shape.fill or "none"}" stroke="{shape.color}" stroke-width="{_PT * shape.width_pt:.1f}"'
    if shape.dashed:
        look += ' stroke-dasharray="5 3"'
    if shape.key:
        look += f' id="{escape(_line(shape.key))}"'
    return f'<{"polygon" if shape.fill else "polyline"} points="{points}" {look}/>'


def _line(text: str) -> str:
    return printable(" ".join(text.split()))

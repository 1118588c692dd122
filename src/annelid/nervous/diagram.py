"""Networks as Graphviz source, as a plain SVG, and as Markdown tables: text only, nothing to install.

The SVG is a working drawing. `annelid.draw.figures` draws networks in the style of the papers.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from annelid.errors import ConfigError
from annelid.nervous.synapses import GapJunction, ModulatorySynapse, SpikingSynapse, Synapse
from annelid.text import printable

if TYPE_CHECKING:
    from annelid.nervous.network import Connection, Network
    from annelid.nervous.neurons import Neuron

Point = tuple[float, float]

_RADIUS = 26.0
_PITCH_X, _PITCH_Y = 190.0, 120.0
_STUB = 34.0
_BULGES = (0.12, 0.25, -0.12, -0.25, 0.4, -0.4, 0.6, -0.6)
_COLORS = {
    "excitatory": "#1b7837",
    "inhibitory": "#b2182b",
    "gap junction": "#2166ac",
    "rectified gap junction": "#2166ac",
    "modulatory": "#7b3294",
}
_ARROWHEADS = {
    "excitatory": "empty",
    "inhibitory": "dot",
    "gap junction": "none",
    "rectified gap junction": "diamond",
    "modulatory": "box",
}
_NUMBERED = re.compile(r"(.*?)_?(\d+)")


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

    Open triangles excite, filled dots inhibit, squares modulate; gap junctions are dashed, rectified ones end in a
    diamond. Spiking neurons are octagons, neurons with gated channels have a double rim.

    Args:
        network: Any network.

    Returns:
        Its Graphviz source and its SVG.
    """
    return Diagram("\n".join(_graphviz(network)) + "\n", "\n".join(_svg(network)) + "\n")


def effect_of(network: Network, connection: Connection) -> str:
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
    neurons = [
        (
            name,
            f"{n.capacitance_nF:g}",
            f"{n.leak_conductance_uS:g}",
            f"{n.rest_mV:g}",
            f"{n.bias_nA:g}",
            f"{network.initial_mV[name]:g}",
            _specials(n),
        )
        for name, n in network.neurons.items()
    ]
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
            f'[label="{strength_of(connection)}", color="{_COLORS[effect]}", arrowhead={_ARROWHEADS[effect]}{style}];'
        )
    for number, (name, targets) in enumerate(network.inputs.items()):
        yield f"  i{number} [label={_quoted(name)}, shape=plaintext];"
        yield from (f"  i{number} -> {keys[target]} [arrowhead=normal];" for target in targets)
    for number, (name, source) in enumerate(network.outputs.items()):
        yield f"  o{number} [label={_quoted(name)}, shape=plaintext];"
        yield f"  {keys[source]} -> o{number} [arrowhead=normal];"
    yield "}"


def _places(names: Sequence[str]) -> dict[str, Point]:
    """Columns where all names end in a number that several share, else a circle."""
    matches = {name: _NUMBERED.fullmatch(name) for name in names}
    columns: dict[int, list[str]] = {}
    for name, match in matches.items():
        if match is not None:
            columns.setdefault(int(match[2]), []).append(name)
    if all(matches.values()) and 1 < len(columns) < len(names):
        # Every other one is set aside, so that a line to the next but one does not run through it.
        return {
            name: (1.4 * _PITCH_X * column + 0.45 * _PITCH_X * (row % 2), 0.8 * _PITCH_Y * row)
            for column, number in enumerate(sorted(columns))
            for row, name in enumerate(columns[number])
        }
    n = len(names)
    if n == 1:
        return {names[0]: (0.0, 0.0)}
    radius = max(120.0, 1.1 * _PITCH_Y * n / (2.0 * math.pi))
    angles = [math.pi - 2.0 * math.pi * i / n for i in range(n)]
    return {name: (radius * math.cos(a), -radius * math.sin(a)) for name, a in zip(names, angles, strict=True)}


def _svg(network: Network) -> Iterator[str]:
    places = _places(list(network.neurons))
    shapes = list(_shapes(network, places))
    inside = [point for _, points in shapes for point in points]
    xs, ys = [x for x, _ in inside] or [0.0], [y for _, y in inside] or [0.0]
    left, top, pad = min(xs), min(ys), 14.0
    width, height = max(xs) - left + 2 * pad, max(ys) - top + 2 * pad
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="{left - pad:.1f} {top - pad:.1f} {width:.1f} {height:.1f}" '
        'font-family="sans-serif" text-anchor="middle">'
    )
    yield f"<title>{_text(network.name)}</title>"
    yield f'<rect x="{left - pad:.1f}" y="{top - pad:.1f}" width="{width:.1f}" height="{height:.1f}" fill="white"/>'
    yield from (shape for shape, _ in shapes)
    yield "</svg>"


def _shapes(network: Network, places: Mapping[str, Point]) -> Iterator[tuple[str, list[Point]]]:
    """All elements from back to front, each with the points that it must have room for."""
    many = len(network.connections) > 40
    pairs: dict[frozenset[str], int] = {}
    for connection in network.connections:
        pair = frozenset((connection.source, connection.target))
        number = pairs[pair] = pairs.get(pair, 0) + 1
        yield from _edge(network, connection, places, number, with_label=not many)
    down = dict.fromkeys(places, 0)
    up = dict(down)
    for name, targets in network.inputs.items():
        for target in targets:
            yield from _lead(name, places[target], -1.0, down[target])
            down[target] += 1
    for name, source in network.outputs.items():
        yield from _lead(name, places[source], 1.0, up[source])
        up[source] += 1
    size = min(11.0, max(6.5, 80.0 / max((len(name) for name in places if name), default=1)))
    for name, neuron in network.neurons.items():
        yield from _node(name, neuron, places[name], size)


def _node(name: str, neuron: Neuron, place: Point, size: float) -> Iterator[tuple[str, list[Point]]]:
    x, y = place
    room = [(x - _RADIUS - 20, y - _RADIUS), (x + _RADIUS + 20, y + _RADIUS)]
    for radius in (_RADIUS, _RADIUS - 4.0) if neuron.channels else (_RADIUS,):
        if neuron.firing is not None:
            corners = [math.pi / 8 + math.pi / 4 * i for i in range(8)]
            points = " ".join(f"{x + radius * math.cos(a):.1f},{y + radius * math.sin(a):.1f}" for a in corners)
            yield f'<polygon points="{points}" fill="white" stroke="black"/>', room
        else:
            yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="white" stroke="black"/>', room
    width = 0.6 * size * len(name) / 2
    label = f'<text x="{x:.1f}" y="{y + 0.35 * size:.1f}" font-size="{size:.1f}">{_text(name)}</text>'
    yield label, [(x - width, y), (x + width, y)]


def _lead(name: str, place: Point, side: float, number: int) -> Iterator[tuple[str, list[Point]]]:
    """An input from the left or an output to the right."""
    x, y = place[0] + side * _RADIUS, place[1] + 9.0 * number
    outer = x + side * _STUB
    tip, tail = (x, outer) if side < 0 else (outer, x)
    anchor = "end" if side < 0 else "start"
    yield f'<line x1="{tail:.1f}" y1="{y:.1f}" x2="{tip:.1f}" y2="{y:.1f}" stroke="#555"/>', [(outer, y)]
    head = f"{tip:.1f},{y:.1f} {tip - 7:.1f},{y - 3:.1f} {tip - 7:.1f},{y + 3:.1f}"
    yield f'<polygon points="{head}" fill="#555"/>', []
    end = outer + side * 4
    label = f'<text x="{end:.1f}" y="{y + 3:.1f}" font-size="9" text-anchor="{anchor}">{_text(name)}</text>'
    yield label, [(end + side * 5.4 * len(name), y)]


def _edge(
    network: Network, connection: Connection, places: Mapping[str, Point], number: int, *, with_label: bool
) -> Iterator[tuple[str, list[Point]]]:
    """A parabola to the right-hand side of its direction, so that both directions of a pair stay apart.

    Where that would run through another neuron it bends further, or to the other side.
    """
    effect = effect_of(network, connection)
    color = _COLORS[effect]
    (x0, y0), (x1, y1) = places[connection.source], places[connection.target]
    if connection.source == connection.target:
        start, end = (x0 - 0.6 * _RADIUS, y0 - 0.8 * _RADIUS), (x0 + 0.6 * _RADIUS, y0 - 0.8 * _RADIUS)
        bend = (x0, y0 - 3.2 * _RADIUS - 8.0 * number)
    else:
        others = [place for name, place in places.items() if name not in (connection.source, connection.target)]
        bends = [_bend((x0, y0), (x1, y1), bulge, 14.0 * (number - 1)) for bulge in _BULGES]
        bend = next((b for b in bends if not _runs_into((x0, y0), b, (x1, y1), others)), bends[0])
        start, end = _towards((x0, y0), bend, _RADIUS), _towards((x1, y1), bend, _RADIUS)
    dash = ' stroke-dasharray="5 3"' if "gap" in effect else ' stroke-dasharray="2 3"' if effect == "modulatory" else ""
    path = f"M{start[0]:.1f} {start[1]:.1f} Q{bend[0]:.1f} {bend[1]:.1f} {end[0]:.1f} {end[1]:.1f}"
    middle = _on_parabola(start, bend, end, 0.42)
    yield f'<path d="{path}" fill="none" stroke="{color}" stroke-width="1.3"{dash}/>', [start, middle]
    yield _tip(effect, end, bend, color), [end]
    if with_label:
        words = strength_of(connection)
        label = f'<text x="{middle[0]:.1f}" y="{middle[1]:.1f}" font-size="8" fill="{color}" stroke="white" '
        label += f'stroke-width="2.5" paint-order="stroke">{_text(words)}</text>'
        yield label, [(middle[0] - 2.3 * len(words), middle[1] - 8), (middle[0] + 2.3 * len(words), middle[1])]


def _bend(start: Point, end: Point, bulge: float, more: float) -> Point:
    """The control point of a parabola whose middle is off the straight line by half of bulge times its length."""
    (x0, y0), (x1, y1) = start, end
    length = math.hypot(x1 - x0, y1 - y0)
    aside = bulge + math.copysign(more / length, bulge)
    return (x0 + x1) / 2 - aside * (y1 - y0), (y0 + y1) / 2 + aside * (x1 - x0)


def _on_parabola(start: Point, bend: Point, end: Point, share: float) -> Point:
    weights = (1 - share) ** 2, 2 * share * (1 - share), share**2
    x, y = (sum(w * p[axis] for w, p in zip(weights, (start, bend, end), strict=True)) for axis in (0, 1))
    return x, y


def _runs_into(start: Point, bend: Point, end: Point, others: Sequence[Point]) -> bool:
    path = [_on_parabola(start, bend, end, i / 24) for i in range(25)]
    return any(math.hypot(x - a, y - b) < 1.25 * _RADIUS for x, y in path for a, b in others)


def _tip(effect: str, end: Point, bend: Point, color: str) -> str:
    """The mark at the target's rim, drawn from the rim outwards."""
    if effect == "gap junction":
        return f'<circle cx="{end[0]:.1f}" cy="{end[1]:.1f}" r="2" fill="{color}"/>'
    if effect == "inhibitory":
        x, y = _towards(end, bend, 4.0)
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{color}"/>'
    base = _towards(end, bend, 9.0)
    across = (-(base[1] - end[1]) / 9.0, (base[0] - end[0]) / 9.0)
    wings = [(base[0] + w * across[0], base[1] + w * across[1]) for w in (4.5, -4.5)]
    corners = [end, wings[0], wings[1]]
    if effect == "rectified gap junction":
        far, half = _towards(end, bend, 11.0), _towards(end, bend, 5.5)
        sides = [(half[0] + w * across[0], half[1] + w * across[1]) for w in (4.5, -4.5)]
        corners = [end, sides[0], far, sides[1]]
    elif effect == "modulatory":
        corners = [(end[0] + w * across[0], end[1] + w * across[1]) for w in (4.5, -4.5)] + wings[::-1]
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
    fill = "white" if effect == "excitatory" else color
    return f'<polygon points="{points}" fill="{fill}" stroke="{color}"/>'


def _towards(start: Point, end: Point, distance: float) -> Point:
    length = math.hypot(end[0] - start[0], end[1] - start[1])
    share = distance / length if length else 0.0
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


def _text(words: str) -> str:
    return escape(_line(words))


def _line(text: str) -> str:
    return printable(" ".join(text.split()))

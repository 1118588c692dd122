"""Networks as Graphviz source, as a plain SVG, and as Markdown tables: text only, nothing to install.

The SVG is a working drawing. `annelid.draw.figures` draws networks in the style of the papers.
"""

from __future__ import annotations

import cmath
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
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

_RADIUS = 26.0
_PITCH_X, _PITCH_Y = 190.0, 120.0
_STUB = 34.0
_BULGES = (0.12, 0.25, -0.12, -0.25, 0.4, -0.4, 0.6, -0.6)
_STYLES = {
    # Colour, Graphviz's arrowhead, the mark at the target's rim as a path of SVG, and the dashes.
    "excitatory": ("#1b7837", "empty", "M-9 -4.5 L0 0 L-9 4.5 Z", ""),
    "inhibitory": ("#b2182b", "dot", "M0 0 a4 4 0 1 0 -8 0 a4 4 0 1 0 8 0", ""),
    "gap junction": ("#2166ac", "none", "M0 0 a2 2 0 1 0 -4 0 a2 2 0 1 0 4 0", "5 3"),
    "rectified gap junction": ("#2166ac", "diamond", "M0 0 L-5.5 4.5 L-11 0 L-5.5 -4.5 Z", "5 3"),
    "modulatory": ("#7b3294", "box", "M0 -4.5 V4.5 H-9 V-4.5 Z", "2 3"),
}
_LEAD = "M-7 -3 L0 0 L-7 3 Z"
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
    return Diagram("\n".join(_graphviz(network)) + "\n", _svg(network))


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
        color, head, *_ = _STYLES[effect]
        style = ", style=dashed" if "gap" in effect else ", style=dotted" if effect == "modulatory" else ""
        yield (
            f"  {keys[connection.source]} -> {keys[connection.target]} "
            f'[label="{strength_of(connection)}", color="{color}", arrowhead={head}{style}];'
        )
    for number, (name, targets) in enumerate(network.inputs.items()):
        yield f"  i{number} [label={_quoted(name)}, shape=plaintext];"
        yield from (f"  i{number} -> {keys[target]} [arrowhead=normal];" for target in targets)
    for number, (name, source) in enumerate(network.outputs.items()):
        yield f"  o{number} [label={_quoted(name)}, shape=plaintext];"
        yield f"  {keys[source]} -> o{number} [arrowhead=normal];"
    yield "}"


def _places(names: Sequence[str]) -> dict[str, complex]:
    """Columns where all names end in a number that several share, else a circle; x + i y, y downwards."""
    matches = {name: _NUMBERED.fullmatch(name) for name in names}
    columns: dict[int, list[str]] = {}
    for name, match in matches.items():
        if match is not None:
            columns.setdefault(int(match[2]), []).append(name)
    if all(matches.values()) and 1 < len(columns) < len(names):
        # Every other one is set aside, so that a line to the next but one does not run through it.
        return {
            name: complex(_PITCH_X * (1.4 * column + 0.45 * (row % 2)), 0.8 * _PITCH_Y * row)
            for column, number in enumerate(sorted(columns))
            for row, name in enumerate(columns[number])
        }
    n = len(names)
    radius = max(120.0, 1.1 * _PITCH_Y * n / (2.0 * math.pi)) if n > 1 else 0.0
    return {name: cmath.rect(radius, math.pi + 2.0 * math.pi * i / n) for i, name in enumerate(names)}


def _svg(network: Network) -> str:
    """A document whose frame holds all shapes, drawn from back to front."""
    places = _places(list(network.neurons))
    shapes, inside = [], [0j]

    def write(words: str, at: complex, size: float, anchor: str = "middle", more: str = "") -> None:
        shapes.append(
            f'<text {_xy(at)} font-size="{size:.1f}" text-anchor="{anchor}"{more}>{escape(_line(words))}</text>'
        )
        left = at - 0.6 * size * len(words) * {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor]
        inside.extend((left - 1j * size, left + 0.6 * size * len(words)))

    pairs = Counter[frozenset[str]]()
    for connection in network.connections:
        ends = connection.source, connection.target
        pairs[frozenset(ends)] += 1
        others = [place for name, place in places.items() if name not in ends]
        path = _parabola(places[ends[0]], places[ends[1]], others, pairs[frozenset(ends)])
        effect = effect_of(network, connection)
        color, _, _, dashes = _STYLES[effect]
        start, bend, end = (f"{point.real:.1f} {point.imag:.1f}" for point in path)
        shapes.append(
            f'<path d="M{start} Q{bend} {end}" fill="none" stroke="{color}" stroke-width="1.3" '
            f'stroke-dasharray="{dashes or "none"}" marker-end="url(#{effect.replace(" ", "-")})"/>'
        )
        middle = _along(path, 0.42)
        inside.extend((path[0], middle, path[2]))
        if len(network.connections) <= 40:
            outline = f' fill="{color}" stroke="white" stroke-width="2.5" paint-order="stroke"'
            write(strength_of(connection), middle, 8.0, more=outline)
    leads = [(name, target, -1.0) for name, targets in network.inputs.items() for target in targets]
    leads += [(name, source, 1.0) for name, source in network.outputs.items()]
    taken = Counter[tuple[str, float]]()
    for name, neuron, side in leads:
        # Inputs come from the left, outputs leave to the right, several of a neuron one below the other.
        rim = places[neuron] + complex(side * _RADIUS, 9.0 * taken[neuron, side])
        taken[neuron, side] += 1
        tail, tip = (rim, rim + _STUB) if side > 0 else (rim - _STUB, rim)
        shapes.append(
            f'<line x1="{tail.real:.1f}" y1="{tail.imag:.1f}" x2="{tip.real:.1f}" y2="{tip.imag:.1f}" stroke="#555" '
            'marker-end="url(#lead)"/>'
        )
        write(name, rim + complex(side * (_STUB + 4.0), 3.0), 9.0, "start" if side > 0 else "end")
    size = min(11.0, max(6.5, 80.0 / max((len(name) for name in places if name), default=1)))
    octagon = [cmath.rect(1.0, math.pi / 8 + math.pi / 4 * i) for i in range(8)]
    for name, neuron in network.neurons.items():
        place = places[name]
        for radius in (_RADIUS, _RADIUS - 4.0) if neuron.channels else (_RADIUS,):
            corners = (place + radius * corner for corner in octagon)
            points = " ".join(f"{corner.real:.1f},{corner.imag:.1f}" for corner in corners)
            rim = f'polygon points="{points}"' if neuron.firing else f'circle {_xy(place, "c")} r="{radius:.1f}"'
            shapes.append(f'<{rim} fill="white" stroke="black"/>')
        write(name, place + 0.35j * size, size)
        inside.extend((place - (1 + 1j) * _RADIUS, place + (1 + 1j) * _RADIUS))

    left, top = (min(getattr(point, axis) for point in inside) - 14.0 for axis in ("real", "imag"))
    right, bottom = (max(getattr(point, axis) for point in inside) + 14.0 for axis in ("real", "imag"))
    frame = f'width="{right - left:.1f}" height="{bottom - top:.1f}"'
    marks = {name: (mark, color) for name, (color, _, mark, _) in _STYLES.items()} | {"lead": (_LEAD, "#555")}
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" {frame} font-family="sans-serif" '
            f'viewBox="{left:.1f} {top:.1f} {right - left:.1f} {bottom - top:.1f}">',
            f"<title>{escape(_line(network.name))}</title>",
            f'<rect x="{left:.1f}" y="{top:.1f}" {frame} fill="white"/>',
            "<defs>",
            *(
                f'<marker id="{name.replace(" ", "-")}" markerUnits="userSpaceOnUse" orient="auto" overflow="visible">'
                f'<path d="{mark}" stroke="{color}" fill="{"white" if name == "excitatory" else color}"/></marker>'
                for name, (mark, color) in marks.items()
            ),
            "</defs>",
            *shapes,
            "</svg>\n",
        ]
    )


def _parabola(start: complex, end: complex, others: Sequence[complex], number: int) -> tuple[complex, complex, complex]:
    """Rim, control point and rim of the ``number``-th connection of two neurons.

    It bends to the right-hand side of its direction, so that both directions of a pair stay apart; where it would run
    through another neuron it bends further, or to the other side.
    """
    if start == end:
        aside = 0.6 * _RADIUS - 0.8j * _RADIUS
        return start - aside.conjugate(), start - 1j * (3.2 * _RADIUS + 8.0 * number), start + aside
    more = 14.0 * (number - 1) / abs(end - start)
    bends = [(start + end) / 2 + (bulge + math.copysign(more, bulge)) * 1j * (end - start) for bulge in _BULGES]

    def is_free(bend: complex) -> bool:
        path = [_along((start, bend, end), i / 24) for i in range(25)]
        return all(abs(point - other) >= 1.25 * _RADIUS for point in path for other in others)

    bend = next(filter(is_free, bends), bends[0])
    first, last = (end_ + _RADIUS * (bend - end_) / abs(bend - end_) for end_ in (start, end))
    return first, bend, last


def _along(path: tuple[complex, complex, complex], share: float) -> complex:
    start, bend, end = path
    return (1 - share) ** 2 * start + 2 * share * (1 - share) * bend + share**2 * end


def _xy(point: complex, prefix: str = "") -> str:
    return f'{prefix}x="{point.real:.1f}" {prefix}y="{point.imag:.1f}"'


def _line(text: str) -> str:
    return printable(" ".join(text.split()))

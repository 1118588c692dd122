"""Networks as text: Graphviz source, a plain SVG, and Markdown tables, with nothing to install."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from annelid.errors import ConfigError
from annelid.nervous.drawing import COLORS, Shape, Words, effect_of, frame_of, network_shapes, strength_of
from annelid.nervous.key import key_shapes
from annelid.nervous.neurons import GapJunction, Neuron, Synapse
from annelid.nervous.wiring import Wiring
from annelid.text import printable

# What Graphviz draws for each effect.
_EDGES = {
    "excitatory": "arrowhead=empty",
    "inhibitory": "arrowhead=dot",
    "gap junction": "arrowhead=none, style=dashed",
    "rectified gap junction": "arrowhead=diamond, style=dashed",
}
# Connections beside which there is room for words.
_MOST_LABELLED = 40
# Pixels from a neuron to the next.
_PX = 130.0
_PX_PER_PT = 96.0 / 72.0


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
            raise ConfigError(
                f"a diagram is saved as .svg, .dot or .gv, not as {target.name!r}: "
                "annelid.draw.network_figure writes .png and .pdf"
            )
        target.write_text(forms[target.suffix], encoding="utf-8")
        return target


def draw_diagram(network: Wiring, *, details: bool = True) -> Diagram:
    """Draws a network.

    Open triangles excite, filled dots inhibit; gap junctions are resistors, rectified ones end in a diode. Neurons with
    gated channels have a double rim. A key below the network says so, and what abbreviated names stand for.
    `annelid.draw.network_figure` draws the same as PNG, PDF or SVG.

    Args:
        network: The network.
        details: Whether the picture has the key, and strengths where there are few connections.
    """
    shapes = network_shapes(network, strengths=details and len(network.connections) <= _MOST_LABELLED)
    if details:
        shapes += key_shapes(network, shapes, _PX / 96.0)
    return Diagram("\n".join(_graphviz(network)) + "\n", _svg(network.name, shapes))


def markdown_tables(network: Wiring) -> str:
    """Returns neurons, connections, inputs and outputs as Markdown tables."""
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
    return "; ".join(words)


def _connection_cells(kind: Synapse | GapJunction) -> tuple[str, str, str]:
    if isinstance(kind, GapJunction):
        return f"{kind.conductance_uS:.6g}", "", ""
    reach = f"{kind.threshold_mV:g} to {kind.saturation_mV:g} mV"
    return f"{kind.conductance_uS:.6g}", f"{kind.reversal_mV:g}", reach


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [heading, tuple("---" for _ in heading), *rows]
    return [f"| {' | '.join(_cell(entry) for entry in line)} |" for line in lines]


def _cell(text: str) -> str:
    return _line(text.replace("|", "\\|"))


def _quoted(text: str) -> str:
    return json.dumps(_line(text), ensure_ascii=False)


def _graphviz(network: Wiring) -> Iterator[str]:
    yield f"digraph {_quoted(network.name)} {{"
    yield "  rankdir=LR;"
    yield "  node [shape=circle, fontsize=10];"
    yield "  edge [fontsize=8];"
    keys = {name: f"n{number}" for number, name in enumerate(network.neurons)}
    for name, neuron in network.neurons.items():
        rims = 2 if neuron.channels else 1
        yield f"  {keys[name]} [label={_quoted(name)}, peripheries={rims}];"
    for connection in network.connections:
        effect = effect_of(network, connection)
        yield (
            f"  {keys[connection.source]} -> {keys[connection.target]} "
            f'[label="{strength_of(connection)}", color="{COLORS[effect]}", {_EDGES[effect]}];'
        )
    for number, (name, targets) in enumerate(network.inputs.items()):
        yield f"  i{number} [label={_quoted(name)}, shape=plaintext];"
        yield from (f"  i{number} -> {keys[target]} [arrowhead=normal];" for target in targets)
    for number, (name, source) in enumerate(network.outputs.items()):
        yield f"  o{number} [label={_quoted(name)}, shape=plaintext];"
        yield f"  {keys[source]} -> o{number} [arrowhead=normal];"
    yield "}"


def _svg(title: str, shapes: Sequence[Shape]) -> str:
    left, right, bottom, top = (_PX * side for side in frame_of(shapes, _PX / 96.0))
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
        x, y = _PX * shape.place.real, -_PX * shape.place.imag
        size = _PX_PER_PT * shape.size_pt
        y += {"bottom": 0.0, "center": 0.35, "top": 0.75}[shape.along] * size
        anchor = {"left": "start", "center": "middle", "right": "end"}[shape.across]
        halo = ' stroke="white" stroke-width="2.5" paint-order="stroke"' if shape.halo else ""
        words = escape(_line(shape.text))
        return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:.1f}" text-anchor="{anchor}"{halo}>{words}</text>'
    points = " ".join(f"{point.real:.1f},{point.imag:.1f}" for point in _PX * shape.points.conj())
    look = f'fill="{shape.fill or "none"}" stroke="{shape.color}" stroke-width="{_PX_PER_PT * shape.width_pt:.1f}"'
    key = f' id="{escape(_line(shape.key))}"' if shape.key else ""
    dashes = ' stroke-dasharray="5 3"' if shape.dashed else ""
    return f'<{"polygon" if shape.fill else "polyline"} points="{points}" {look}{dashes}{key}/>'


def _line(text: str) -> str:
    return printable(" ".join(text.split()))

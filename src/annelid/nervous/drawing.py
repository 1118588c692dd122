"""The drawing of a network as lines and words in a plane, which `annelid.nervous.diagram` and the figures show."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from annelid.nervous.layout import RADIUS, STUB, Points, Stub, arc_length, lay_out, points_at, rounded, with_resistor
from annelid.nervous.synapses import GapJunction, ModulatorySynapse

if TYPE_CHECKING:
    from annelid.nervous.network import Connection, Network

Effect = Literal["excitatory", "inhibitory", "modulatory", "gap junction", "rectified gap junction"]
_GREY = "#595959"
# Dark and light in grey, hues far apart for colour-blind eyes.
COLORS: dict[Effect, str] = {
    "excitatory": "#c2410c",
    "inhibitory": "#1b2a6b",
    "modulatory": _GREY,
    "gap junction": _GREY,
    "rectified gap junction": _GREY,
}
_TRIANGLE, _DOT = 0.17, 0.065
_ROUND = 48
"""Corners of what looks round."""
_ARROW = "#4d4d4d"


@dataclass(frozen=True, slots=True)
class Line:
    """A line through points of the layout; with a ``fill`` it is closed. The ``key`` names a part of the network."""

    points: Points
    color: str
    width_pt: float = 1.3
    fill: str = ""
    dashed: bool = False
    key: str = ""


@dataclass(frozen=True, slots=True)
class Words:
    """Plain text at a point of the layout, with that end or the middle there; a ``halo`` clears what lies under it."""

    text: str
    place: complex
    size_pt: float
    across: Literal["left", "center", "right"] = "center"
    along: Literal["bottom", "center", "top"] = "center"
    halo: bool = False


Shape = Line | Words


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


def network_shapes(network: Network, labels: Mapping[str, str], *, strengths: bool) -> list[Shape]:
    """Draws each neuron, connection, input and output of a network once.

    The shapes are in order from back to front. Their keys are ``neuron-<name>``, ``synapse-<i>`` and ``gap-<i>`` with i
    the place among the network's connections, ``input-<name>-<neuron>`` and ``output-<name>``. In each neuron stands
    its label, and on each connection how strong it is if ``strengths``.
    """
    layout = lay_out(network)
    columns, paths, marks, numbers, front = [], [], [], [], []
    for segment, names in layout.columns.items():
        columns += _column(f"segment {segment}", np.array([layout.places[name] for name in names]))
    for index, (link, route) in enumerate(zip(network.connections, layout.routes, strict=True)):
        effect = effect_of(network, link)
        path, *mark = connection_shapes(route, effect, f"{'gap' if 'gap' in effect else 'synapse'}-{index}")
        paths.append(path)
        marks += mark
        if strengths:
            # A gap junction has its resistor in the middle.
            share = 0.2 if "gap" in effect else 0.4
            place = points_at(route, share * arc_length(route)[-1:])[0]
            numbers.append(Words(strength_of(link), place, 7.0, halo=True))
    for stub in layout.inputs:
        front += [*arrow_shapes(stub.outer, stub.rim, f"input-{stub.name}-{stub.neuron}"), *_name_of(stub)]
    for stub in layout.outputs:
        front += [*arrow_shapes(stub.rim, stub.outer, f"output-{stub.name}"), *_name_of(stub)]
    for name, place in layout.places.items():
        neuron = network.neurons[name]
        spiking, gated = neuron.firing is not None, bool(neuron.channels)
        front += neuron_shapes(place, labels[name], spiking=spiking, gated=gated, key=f"neuron-{name}")
    return [*columns, *paths, *marks, *numbers, *front]


def neuron_shapes(place: complex, label: str, *, spiking: bool, gated: bool, key: str = "") -> list[Shape]:
    """Draws a circle, or an octagon for a neuron that spikes, with a double rim if it has gated channels."""
    size_pt = 9.0 if len(label) <= 3 else min(7.0, max(5.0, 65.0 / len(label)))
    n_corners = 8 if spiking else _ROUND
    rims: list[Shape] = [Line(_polygon(place, RADIUS, n_corners), "black", 1.3, "white", key=key)]
    if gated:
        rims.append(Line(_polygon(place, 0.84 * RADIUS, n_corners), "black", 0.8, "white"))
    return [*rims, Words(label, place, size_pt)]


def connection_shapes(route: Points, effect: Effect, key: str = "") -> list[Shape]:
    """Draws a path that ends in a triangle, a dot or a square, or has a resistor in its middle."""
    color, along = COLORS[effect], arc_length(route)
    if "gap" in effect:
        path = Line(with_resistor(route), color, key=key)
        if effect == "gap junction":
            return [path]
        tip, back = points_at(route, 0.9 * along[-1] - np.array([0.0, 0.1]))
        across = 0.55j * (tip - back)
        return [
            path,
            _triangle(tip, back, across, color, 1.0, color),
            Line(np.array([tip + across, tip - across]), color),
        ]
    length = _TRIANGLE if effect == "excitatory" else 2.0 * _DOT
    end = along[-1] - length
    body = points_at(route, np.append(along[along < end], end))
    tip, forward = route[-1], (route[-1] - body[-1]) / abs(route[-1] - body[-1])
    back, middle = tip - length * forward, tip - _DOT * forward
    if effect == "inhibitory":
        mark = Line(_polygon(middle, _DOT, _ROUND), color, 1.0, color)
    elif effect == "excitatory":
        mark = _triangle(tip, back, 0.5j * length * forward, color, 1.2, "white")
    else:
        across = 1j * _DOT * forward
        mark = Line(np.array([tip, middle + across, back, middle - across]), color, 1.2, "white")
    return [Line(body, color, dashed=effect == "modulatory", key=key), mark]


def arrow_shapes(tail: complex, head: complex, key: str = "") -> list[Shape]:
    """Draws an input or an output."""
    forward = (head - tail) / abs(head - tail)
    back = head - 0.08 * forward
    return [
        Line(np.array([tail, back]), _ARROW, 1.0, key=key),
        _triangle(head, back, 0.04j * forward, _ARROW, 1.0, _ARROW),
    ]


def frame_of(shapes: Iterable[Shape], unit_in: float) -> tuple[float, float, float, float]:
    """Returns left, right, bottom and top of all shapes with a margin, if a unit is drawn ``unit_in`` inches long."""
    corners = [np.zeros(1, dtype=complex)]
    for shape in shapes:
        if isinstance(shape, Line):
            corners.append(shape.points)
        else:
            height = shape.size_pt / 72.0 / unit_in
            width = 0.6 * height * len(shape.text)
            left = shape.place + {"left": 0.0, "center": -0.5, "right": -1.0}[shape.across] * width
            corners.append(np.array([left - 1j * height, left + width + 1j * height]))
    points = np.concatenate(corners)
    x, y = points.real, points.imag
    return float(x.min()) - 0.15, float(x.max()) + 0.15, float(y.min()) - 0.15, float(y.max()) + 0.15


def _triangle(tip: complex, back: complex, across: complex, color: str, width_pt: float, fill: str) -> Line:
    return Line(np.array([tip, back + across, back - across]), color, width_pt, fill)


def _column(name: str, places: Points) -> list[Shape]:
    """Draws a segment's background around its neurons, and its name above them."""
    x, y = places.real, places.imag
    left, right, bottom, top = x.min() - 0.44, x.max() + 0.44, y.min() - 0.44, y.max() + 0.44
    middle = (left + right) / 2.0
    corners = [(middle, top), (left, top), (left, bottom), (right, bottom), (right, top), (middle, top)]
    header = Words(name, complex(middle, y.max() + RADIUS + STUB + 0.16), 9.0)
    return [Line(rounded(np.array([complex(*corner) for corner in corners]), 0.2), "none", 0.0, "#f1f1f1"), header]


def _name_of(stub: Stub) -> list[Shape]:
    """Writes an input's or output's name, unless that is the neuron's, beyond its outer end."""
    if stub.name == stub.neuron:
        return []
    direction = (stub.outer - stub.rim) / STUB
    across = "center" if abs(direction.real) < 0.3 else "left" if direction.real > 0 else "right"
    along = "center" if abs(direction.imag) < 0.3 else "bottom" if direction.imag > 0 else "top"
    return [Words(stub.name.replace("_", " "), stub.outer + 0.06 * direction, 8.0, across, along)]


def _polygon(center: complex, radius: float, n_corners: int) -> Points:
    """Returns the corners of a polygon around a circle, which its sides touch."""
    turn = np.pi * (2 * np.arange(n_corners) + 1) / n_corners
    return center + radius / np.cos(np.pi / n_corners) * np.exp(1j * turn)

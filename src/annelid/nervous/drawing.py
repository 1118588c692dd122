"""The drawing of a network: where its neurons lie, how its connections are led around them, and the lines and words.

Points of the plane are complex numbers, x to the right and y upwards, in units of the distance between neighbouring
neurons. `annelid.nervous.diagram` and the figures show the drawing.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.nervous.neurons import GapJunction
from annelid.nervous.wiring import Connection, Wiring

Points = NDArray[np.complexfloating]
RADIUS = 0.27
"""Radius of a neuron."""
STUB = 0.42
"""Length of the line of an input or an output."""
_COLUMN_GAP = 1.35
_CROWDED = 0.4
_BENDS = (0.0, 0.2, -0.2, 0.35, -0.35, 0.55, -0.55, 0.8, -0.8)
_NUMBERED = re.compile(r"(.+)_(\d{1,9})")
Effect = Literal["excitatory", "inhibitory", "gap junction", "rectified gap junction"]
_GREY = "#595959"
# Dark and light in grey, hues far apart for colour-blind eyes.
COLORS: dict[Effect, str] = {
    "excitatory": "#c2410c",
    "inhibitory": "#1b2a6b",
    "gap junction": _GREY,
    "rectified gap junction": _GREY,
}
_TRIANGLE, _DOT = 0.17, 0.065
PAPER_SYMBOLS = {"contraction": "U1", "expansion": "U2", "sensory": "U3", "relay": "U4"}
"""The paper's symbols of the four neurons of a segment, by the role in a neuron's name."""
_LONGEST_NAME = 9  # letters of a name that can be read in a neuron
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


def effect_of(network: Wiring, connection: Connection) -> Effect:
    """Returns what a connection does: a reversal potential above its target's rest excites, another inhibits."""
    kind = connection.kind
    if isinstance(kind, GapJunction):
        return "rectified gap junction" if kind.rectified else "gap junction"
    return "excitatory" if kind.reversal_mV > network.neurons[connection.target].rest_mV else "inhibitory"


def strength_of(connection: Connection) -> str:
    """Returns the words beside a connection, its conductance."""
    return f"{connection.kind.conductance_uS:.3g} uS"


def network_shapes(network: Wiring, *, strengths: bool) -> list[Shape]:
    """Draws each neuron, connection, input and output of a network once.

    The shapes are in order from back to front. Their keys are ``neuron-<name>``, ``synapse-<i>`` and ``gap-<i>`` with i
    the place among the network's connections, ``input-<name>-<neuron>`` and ``output-<name>``. In each neuron stands
    its label, and beside each connection how strong it is if ``strengths``.
    """
    layout, labels = lay_out(network), labels_of(network)
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
            share = 0.2 if "gap" in effect else 0.5
            numbers.append(_beside(route, share, strength_of(link)))
    for stub in layout.inputs:
        front += [*arrow_shapes(stub.outer, stub.rim, f"input-{stub.name}-{stub.neuron}"), *_name_of(stub)]
    for stub in layout.outputs:
        front += [*arrow_shapes(stub.rim, stub.outer, f"output-{stub.name}"), *_name_of(stub)]
    for name, place in layout.places.items():
        gated = bool(network.neurons[name].channels)
        front += neuron_shapes(place, labels[name], gated=gated, key=f"neuron-{name}")
    return [*columns, *paths, *marks, *numbers, *front]


def _beside(route: Points, share: float, text: str) -> Words:
    """Writes beside a path, at a share of its length."""
    place, ahead = points_at(route, arc_length(route)[-1] * np.array([share, share + 0.02]))
    normal = 1j * (ahead - place) / abs(ahead - place)
    if abs(normal.real) < 0.5:
        return Words(text, place + 0.09 * normal, 7.0, halo=True)
    return Words(text, place + 0.05 * normal, 7.0, "left" if normal.real > 0.0 else "right", halo=True)


def neuron_shapes(place: complex, label: str, *, gated: bool, key: str = "") -> list[Shape]:
    """Draws a circle, with a double rim for a neuron that has gated channels."""
    size_pt = 9.0 if len(label) <= 3 else min(7.0, max(5.0, 65.0 / len(label)))
    rims: list[Shape] = [Line(_polygon(place, RADIUS, _ROUND), "black", 1.3, "white", key=key)]
    if gated:
        rims.append(Line(_polygon(place, 0.84 * RADIUS, _ROUND), "black", 0.8, "white"))
    return [*rims, Words(label, place, size_pt)]


def connection_shapes(route: Points, effect: Effect, key: str = "") -> list[Shape]:
    """Draws a path that ends in a triangle or a dot, or has a resistor in its middle."""
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
    else:
        mark = _triangle(tip, back, 0.5j * length * forward, color, 1.2, "white")
    return [Line(body, color, key=key), mark]


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
    corners: list[Points] = [np.zeros(1, dtype=complex)]
    for shape in shapes:
        if isinstance(shape, Line):
            corners.append(shape.points)
        else:
            height = shape.size_pt / 72.0 / unit_in
            width = 0.6 * height * len(shape.text)
            left = shape.place + {"left": 0.0, "center": -0.5, "right": -1.0}[shape.across] * width
            corners.append(np.array([left - 1j * height, left + width + 1j * height]))
    points: Points = np.concatenate(corners)
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


class Stub(NamedTuple):
    """The short line of the input or output ``name`` from the rim of a neuron to the outside."""

    name: str
    neuron: str
    rim: complex
    outer: complex


class Layout(NamedTuple):
    """Centres of the neurons, paths of the connections in the network's order, and stubs of the inputs and outputs.

    ``columns`` has the names of the neurons of each segment; it is empty in a circular layout.
    """

    places: dict[str, complex]
    routes: list[Points]
    inputs: list[Stub]
    outputs: list[Stub]
    columns: dict[int, list[str]]


def lay_out(network: Wiring) -> Layout:
    """Places neurons and leads connections around them.

    Names that all end in ``_<n>`` make one column for each n, its neurons row by row from the top in their order; other
    networks are placed on a circle. A connection is straight where no neuron lies on it, and bent otherwise; one from
    the last column back to the first passes below.
    """
    segments, others = by_segment(network.neurons)
    columns = {} if others else segments
    places = _in_columns(columns) if columns else _on_circle(list(network.neurons))
    routes = list(_routes(network, places, columns))
    # Angles, seen from each neuron, at which there is a connection or a close neighbour.
    busy: dict[str, list[float]] = {name: [] for name in places}
    for link, route in zip(network.connections, routes, strict=True):
        for name, end in ((link.source, route[0]), (link.target, route[-1])):
            busy[name].append(_angle_of(end - places[name]))
    for name, place in places.items():
        gaps = [other - place for key, other in places.items() if key != name]
        busy[name] += [_angle_of(gap) for gap in gaps if abs(gap) < 1.2]

    def stub(name: str, neuron: str, upwards: float) -> Stub:
        """Leads a line away where there is room, near to down (up) or out of the circle."""
        place, taken = places[neuron], busy[neuron]
        wanted = _angle_of(place) if place and not columns else 0.5 * upwards * np.pi

        def merit(angle: float) -> float:
            room = min((_angle_between(angle, other) for other in taken), default=np.pi)
            return min(room, 0.9) + 0.25 * np.cos(angle - wanted)

        angle = max(np.pi / 8.0 * np.arange(16), key=merit)
        taken.append(float(angle))
        direction = np.exp(1j * angle)
        return Stub(name, neuron, place + RADIUS * direction, place + (RADIUS + STUB) * direction)

    outputs = [stub(name, neuron, 1.0) for name, neuron in network.outputs.items()]
    inputs = [stub(name, neuron, -1.0) for name, neurons in network.inputs.items() for neuron in neurons]
    return Layout(places, routes, inputs, outputs, columns)


def role_of(name: str) -> str:
    """A neuron's name without its segment's number."""
    match = _NUMBERED.fullmatch(name)
    return match[1] if match else name


def by_segment(names: Iterable[str]) -> tuple[dict[int, list[str]], list[str]]:
    """Names by the segment's number they end in, in ascending order, and those that end in none."""
    segments: dict[int, list[str]] = {}
    others = []
    for name in names:
        match = _NUMBERED.fullmatch(name)
        if match is None:
            others.append(name)
        else:
            segments.setdefault(int(match[2]), []).append(name)
    return dict(sorted(segments.items())), others


def _in_columns(columns: Mapping[int, list[str]]) -> dict[str, complex]:
    n_wide = int(np.ceil(np.sqrt(max(len(names) for names in columns.values()))))
    pitch = n_wide - 1 + _COLUMN_GAP
    return {
        name: complex(rank * pitch + index % n_wide, -(index // n_wide))
        for rank, names in enumerate(columns.values())
        for index, name in enumerate(names)
    }


def _on_circle(names: list[str]) -> dict[str, complex]:
    """Neighbours on the circle lie 1.3 apart, the first on the left and the others clockwise."""
    n = len(names)
    radius = 0.65 / np.sin(np.pi / n) if n > 1 else 0.0
    return {name: radius * np.exp(1j * (np.pi - 2.0 * np.pi * i / n)) for i, name in enumerate(names)}


def _routes(network: Wiring, places: Mapping[str, complex], columns: Mapping[int, list[str]]) -> Iterator[Points]:
    shared = Counter(frozenset((link.source, link.target)) for link in network.connections)
    taken: dict[frozenset[str], list[float]] = {pair: [] for pair in shared}
    arrived: dict[str, list[float]] = {name: [] for name in places}
    n_returns = 0
    for link in network.connections:
        start, end = places[link.source], places[link.target]
        pair = frozenset((link.source, link.target))
        if link.source == link.target:
            taken[pair].append(0.0)
            yield _self_loop(start, np.pi / 4.0 if columns else _angle_of(start), len(taken[pair]))
        elif _closes_the_ring(link, places, columns):
            yield _return_path(start, end, min(place.imag for place in places.values()), n_returns)
            n_returns += 1
        else:
            others = np.array([place for name, place in places.items() if name not in pair])
            # A bend counts from the same side for both directions, so that two paths never coincide.
            side = 1.0 if link.source < link.target else -1.0
            bends = _BENDS if shared[pair] == 1 else _BENDS[3:]
            free = [bend for bend in bends if side * bend not in taken[pair]] or [1.1 + 0.3 * len(taken[pair])]
            paths = [_bow(start, end, bend) for bend in free]
            costs = [10 * _n_hit(path, others) + _n_crowded(path[-1] - end, arrived[link.target]) for path in paths]
            chosen = int(np.argmin(costs))
            arrived[link.target].append(_angle_of(paths[chosen][-1] - end))
            taken[pair].append(side * free[chosen])
            yield paths[chosen]


def _closes_the_ring(link: Connection, places: Mapping[str, complex], columns: Mapping[int, list[str]]) -> bool:
    """Whether a connection leads from the right end of a row in the last column to the left end of one in the first."""
    if len(columns) < 2:
        return False
    first, *_, last = columns.values()

    def at_the_end(name: str, names: list[str], sign: float) -> bool:
        row = [places[other].real for other in names if places[other].imag == places[name].imag]
        return name in names and all(sign * x <= sign * places[name].real for x in row)

    return at_the_end(link.source, last, 1.0) and at_the_end(link.target, first, -1.0)


def _n_hit(path: Points, others: Points) -> int:
    """Number of neurons that a path runs over."""
    return int(np.sum(abs(path[:, np.newaxis] - others).min(axis=0) < 1.25 * RADIUS))


def _n_crowded(arrival: complex, others: list[float]) -> int:
    return sum(_angle_between(_angle_of(arrival), other) < _CROWDED for other in others)


def _bow(start: complex, end: complex, bend: float) -> Points:
    """A parabola from rim to rim, whose middle is off the straight line by ``bend / 2`` of its length."""
    share = np.linspace(0.0, 1.0, 121)
    path = (1 - share) * start + share * end + 2.0 * share * (1 - share) * bend * 1j * (end - start)
    return path[(abs(path - start) >= RADIUS) & (abs(path - end) >= RADIUS)]


def _self_loop(place: complex, outwards: float, number: int) -> Points:
    """Of a circle beside the neuron, the arc outside it."""
    radius = 0.2 + 0.08 * (number - 1)
    turn = outwards + np.linspace(-np.pi, np.pi, 121)
    loop = place + (RADIUS + 0.6 * radius) * np.exp(1j * outwards) + radius * np.exp(1j * turn)
    return loop[abs(loop - place) >= RADIUS]


def _return_path(start: complex, end: complex, bottom: float, lane: int) -> Points:
    """A path with rounded corners that passes below all neurons, one lane further out for each before it."""
    aside, below = 0.62 + 0.22 * lane, bottom - 1.1 - 0.22 * lane
    right, left = start + aside, end - aside
    under = complex(right.real, below), complex(left.real, below)
    return rounded(np.array([start + RADIUS, right, *under, left, end - RADIUS]), 0.18)


def rounded(corners: Points, radius: float) -> Points:
    """Replaces the corners of a path by parabolas that begin and end ``radius`` away from them."""
    share = np.linspace(0.0, 1.0, 9)
    pieces = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        enter, leave = (corner + radius * (p - corner) / abs(p - corner) for p in (before, after))
        pieces.append((1 - share) ** 2 * enter + 2 * share * (1 - share) * corner + share**2 * leave)
    return np.concatenate([*pieces, corners[-1:]])


def with_resistor(path: Points) -> Points:
    """Turns the middle of a path into a zigzag."""
    along = arc_length(path)
    teeth = 0.5 * along[-1] + 0.3 * np.linspace(-0.5, 0.5, 13) * min(1.0, 2.0 * along[-1])
    direction = np.gradient(points_at(path, teeth))
    direction /= abs(direction)
    zigzag = points_at(path, teeth) + 0.08j * np.array([0, *([1, 0, -1, 0] * 3)]) * direction
    return np.concatenate([path[along < teeth[0]], zigzag[[0, *range(1, 12, 2), 12]], path[along > teeth[-1]]])


def arc_length(path: Points) -> NDArray[np.float64]:
    """Distance of every point from the beginning, along the path."""
    return np.append(0.0, np.cumsum(abs(np.diff(path))))


def points_at(path: Points, along: NDArray[np.float64]) -> Points:
    """Points at given distances along a path."""
    return np.interp(along, arc_length(path), path)


def _angle_of(vector: complex) -> float:
    return float(np.angle(vector))


def _angle_between(one: float, other: float) -> float:
    """The smaller angle from one direction to another, rad, 0 .. π."""
    return abs((one - other + np.pi) % (2.0 * np.pi) - np.pi)


def abbreviations(names: Iterable[str]) -> dict[str, str]:
    """Shortens names, without their segments' numbers, to three letters, or more where these are not distinct."""
    roles = list(dict.fromkeys(role_of(name) for name in names))
    short: dict[str, str] = {}
    for role in roles:
        others = [other for other in roles if other != role]
        lengths = range(min(3, len(role)), len(role) + 1)
        short[role] = next((role[:n] for n in lengths if not any(o.startswith(role[:n]) for o in others)), role)
    return short


def labels_of(network: Wiring) -> dict[str, str]:
    """Returns what stands in each neuron: the symbol of its role in a column, else its name, if long shortened."""
    written = abbreviations(network.neurons) | PAPER_SYMBOLS
    if not by_segment(network.neurons)[1]:
        return {name: written[role_of(name)] for name in network.neurons}
    return {n: n if len(n) <= _LONGEST_NAME else n.replace(role_of(n), written[role_of(n)], 1) for n in network.neurons}


def meanings_of(network: Wiring) -> list[str]:
    """Returns what labels stand for, ``"U1: contraction"``, of those that are not the names themselves."""
    labels = {role_of(name): label for name, label in labels_of(network).items() if label != name}
    return [f"{label}: {role}" for role, label in labels.items() if label != role]

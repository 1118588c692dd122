"""Where the neurons of a network lie, and how its connections, inputs and outputs are led around them.

Points of the plane are complex numbers, x to the right and y upwards, in units of the distance between neighbouring
neurons.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from annelid.nervous.network import Connection, Network

Points = NDArray[np.complex128]
RADIUS = 0.27
"""Radius of a neuron."""
STUB = 0.42
"""Length of the line of an input or an output."""
_COLUMN_GAP = 1.35
_CROWDED = 0.4
_BENDS = (0.0, 0.2, -0.2, 0.35, -0.35, 0.55, -0.55, 0.8, -0.8)
_NUMBERED = re.compile(r"(.+)_(\d{1,9})")


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


def lay_out(network: Network) -> Layout:
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


def _routes(network: Network, places: Mapping[str, complex], columns: Mapping[int, list[str]]) -> Iterator[Points]:
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

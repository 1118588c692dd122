"""Where the neurons of a network lie, and how its connections, inputs and outputs are led around them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from annelid.nervous.neurons import Array

if TYPE_CHECKING:
    from annelid.nervous.network import Connection, Network

RADIUS = 0.27
"""Radius of a neuron, in units of the distance between neighbours."""
STUB = 0.42
"""Length of the line of an input or an output."""

_COLUMN_GAP = 1.35
_CROWDED = 0.4
_BENDS = (0.0, 0.2, -0.2, 0.35, -0.35, 0.55, -0.55, 0.8, -0.8)
_NUMBERED = re.compile(r"(.+)_(\d{1,9})")


@dataclass(frozen=True)
class Stub:
    """An input's or output's short line to the outside.

    Attributes:
        name: Name of the input or output.
        neuron: Name of the neuron.
        rim: Its end at the neuron, shape ``(2,)``.
        outer: Its other end, shape ``(2,)``.
    """

    name: str
    neuron: str
    rim: Array
    outer: Array


@dataclass(frozen=True)
class Layout:
    """Where everything of a network is drawn, in units of the distance between neighbouring neurons.

    Attributes:
        places: Centre of every neuron, shape ``(2,)``.
        routes: Path of every connection from neuron to neuron, each of shape ``(n, 2)``, in the network's order.
        inputs: One stub for each neuron that an input drives.
        outputs: One stub an output.
        columns: Names of the neurons of each segment, by its number; empty in a circular layout.
    """

    places: dict[str, Array]
    routes: tuple[Array, ...]
    inputs: tuple[Stub, ...]
    outputs: tuple[Stub, ...]
    columns: dict[int, list[str]]


def lay_out(network: Network) -> Layout:
    """Places neurons and leads connections around them.

    Names that all end in ``_<n>`` make one column for each n, its neurons row by row from the top in their order; other
    networks are laid out on a circle. A connection is straight where no neuron is in its way, and bent otherwise;
    one from the last column back to the first passes below.
    """
    segments, others = by_segment(network.neurons)
    columns = {} if others else segments
    places = _in_columns(columns) if columns else _on_circle(list(network.neurons))
    routes = tuple(_routes(network, places, columns))
    busy = _busy_directions(network, places, routes)
    outputs = [_stub(name, neuron, places, busy, columns, up=True) for name, neuron in network.outputs.items()]
    inputs = [
        _stub(name, neuron, places, busy, columns, up=False)
        for name, neurons in network.inputs.items()
        for neuron in neurons
    ]
    return Layout(places, routes, tuple(inputs), tuple(outputs), columns)


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


def _in_columns(columns: Mapping[int, list[str]]) -> dict[str, Array]:
    n_wide = int(np.ceil(np.sqrt(max(len(names) for names in columns.values()))))
    pitch = n_wide - 1 + _COLUMN_GAP
    return {
        name: np.array([rank * pitch + index % n_wide, -float(index // n_wide)])
        for rank, names in enumerate(columns.values())
        for index, name in enumerate(names)
    }


def _on_circle(names: list[str]) -> dict[str, Array]:
    """Neighbours on the circle lie 1.3 apart, the first on the left and the others clockwise."""
    n = len(names)
    radius = 0.65 / np.sin(np.pi / n) if n > 1 else 0.0
    angles = np.pi - 2.0 * np.pi * np.arange(n) / max(n, 1)
    return {name: radius * np.array([np.cos(a), np.sin(a)]) for name, a in zip(names, angles, strict=True)}


def _routes(network: Network, places: Mapping[str, Array], columns: Mapping[int, list[str]]) -> Iterable[Array]:
    shared = Counter(frozenset((link.source, link.target)) for link in network.connections)
    taken: dict[frozenset[str], list[float]] = {}
    arrived: dict[str, list[float]] = {}
    n_returns = 0
    for link in network.connections:
        start, end = places[link.source], places[link.target]
        if link.source == link.target:
            pair = taken.setdefault(frozenset((link.source,)), [])
            pair.append(0.0)
            yield _self_loop(start, np.pi / 4.0 if columns else _angle_of(start), len(pair))
        elif _closes_the_ring(link, places, columns):
            yield _return_path(start, end, min(place[1] for place in places.values()), n_returns)
            n_returns += 1
        else:
            pair = frozenset((link.source, link.target))
            others = np.array([place for name, place in places.items() if name not in pair]).reshape(-1, 2)
            # A bend counts from the same side for both directions, so that two paths never coincide.
            side = 1.0 if link.source < link.target else -1.0
            bends = _BENDS if shared[pair] == 1 else _BENDS[3:]
            free = [bend for bend in bends if side * bend not in taken.get(pair, [])] or [1.1 + 0.3 * len(taken[pair])]
            paths = [_between_rims(_bow(start, end, bend), start, end) for bend in free]
            arrivals = arrived.setdefault(link.target, [])
            costs = [10 * _n_hit(path, others) + _n_crowded(path[-1] - end, arrivals) for path in paths]
            chosen = int(np.argmin(costs))
            arrivals.append(_angle_of(paths[chosen][-1] - end))
            taken.setdefault(pair, []).append(side * free[chosen])
            yield paths[chosen]


def _closes_the_ring(link: Connection, places: Mapping[str, Array], columns: Mapping[int, list[str]]) -> bool:
    """Whether a connection leads from the right end of a row in the last column to the left end of one in the first."""
    if len(columns) < 2:
        return False
    first, *_, last = columns.values()

    def at_the_end(name: str, names: list[str], sign: float) -> bool:
        row = [places[other] for other in names if places[other][1] == places[name][1]]
        return name in names and all(sign * place[0] <= sign * places[name][0] for place in row)

    return at_the_end(link.source, last, 1.0) and at_the_end(link.target, first, -1.0)


def _n_hit(path: Array, others: Array) -> int:
    distance = np.linalg.norm(path[:, np.newaxis] - others, axis=2)
    return int(np.sum(distance.min(axis=0) < 1.25 * RADIUS)) if len(others) else 0


def _n_crowded(arrival: Array, others: Sequence[float]) -> int:
    return sum(_angle_between(_angle_of(arrival), other) < _CROWDED for other in others)


def _busy_directions(network: Network, places: Mapping[str, Array], routes: Sequence[Array]) -> dict[str, list[float]]:
    """Angles, seen from each neuron, at which there is a connection or a close neighbour."""
    busy: dict[str, list[float]] = {name: [] for name in places}
    for link, route in zip(network.connections, routes, strict=True):
        for name, end in ((link.source, route[0]), (link.target, route[-1])):
            busy[name].append(_angle_of(end - places[name]))
    for name, place in places.items():
        gaps = [other - place for key, other in places.items() if key != name]
        busy[name] += [_angle_of(gap) for gap in gaps if np.hypot(*gap) < 1.2]
    return busy


def _stub(
    name: str,
    neuron: str,
    places: Mapping[str, Array],
    busy: dict[str, list[float]],
    columns: Mapping[int, list[str]],
    *,
    up: bool,
) -> Stub:
    """Leads an input (or ``up``, an output) away where there is room, near to down (up) or out of the circle."""
    place = places[neuron]
    wanted = _angle_of(place) if not columns and np.any(place) else (0.5 if up else -0.5) * np.pi

    def merit(angle: float) -> float:
        room = min((_angle_between(angle, other) for other in busy[neuron]), default=np.pi)
        return min(room, 0.9) + 0.25 * np.cos(angle - wanted)

    angle = max(np.pi / 8.0 * np.arange(16), key=merit)
    busy[neuron].append(float(angle))
    direction = np.array([np.cos(angle), np.sin(angle)])
    return Stub(name, neuron, place + RADIUS * direction, place + (RADIUS + STUB) * direction)


def _bow(start: Array, end: Array, bend: float) -> Array:
    """A parabola between two points whose middle is off the straight line by ``bend / 2`` of its length."""
    share = np.linspace(0.0, 1.0, 121)[:, np.newaxis]
    across = np.array([-(end - start)[1], (end - start)[0]])
    return (1 - share) * start + share * end + 2.0 * share * (1 - share) * bend * across


def _between_rims(path: Array, start: Array, end: Array) -> Array:
    """The part of a path outside the neurons at its two ends."""
    outside = (np.linalg.norm(path - start, axis=1) >= RADIUS) & (np.linalg.norm(path - end, axis=1) >= RADIUS)
    return path[outside]


def _self_loop(place: Array, outwards: float, number: int) -> Array:
    """Of a circle beside the neuron, the arc outside it."""
    radius = 0.2 + 0.08 * (number - 1)
    turn = outwards + np.linspace(-np.pi, np.pi, 121)
    center = place + (RADIUS + 0.6 * radius) * np.array([np.cos(outwards), np.sin(outwards)])
    loop = center + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return loop[np.linalg.norm(loop - place, axis=1) >= RADIUS]


def _return_path(start: Array, end: Array, bottom: float, lane: int) -> Array:
    """A path with rounded corners that passes below all neurons, one lane further out for each before it."""
    aside, below = 0.62 + 0.22 * lane, bottom - 1.1 - 0.22 * lane
    corners = np.array(
        [
            (start[0] + RADIUS, start[1]),
            (start[0] + aside, start[1]),
            (start[0] + aside, below),
            (end[0] - aside, below),
            (end[0] - aside, end[1]),
            (end[0] - RADIUS, end[1]),
        ]
    )
    return rounded(corners, 0.18)


def rounded(corners: Array, radius: float) -> Array:
    """Replaces the corners of a path by parabolas that begin and end ``radius`` away from them."""
    share = np.linspace(0.0, 1.0, 9)[:, np.newaxis]
    pieces = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        enter, leave = (corner + radius * (p - corner) / np.hypot(*(p - corner)) for p in (before, after))
        pieces.append((1 - share) ** 2 * enter + 2 * share * (1 - share) * corner + share**2 * leave)
    return np.concatenate([*pieces, corners[-1:]])


def with_resistor(path: Array) -> Array:
    """Turns the middle of a path into a zigzag."""
    along = arc_length(path)
    teeth = 0.5 * along[-1] + 0.3 * np.linspace(-0.5, 0.5, 13) * min(1.0, 2.0 * along[-1])
    direction = np.gradient(points_at(path, teeth), axis=0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    height = 0.08 * np.array([0, *([1, 0, -1, 0] * 3)])[:, np.newaxis]
    zigzag = points_at(path, teeth) + height * np.column_stack([-direction[:, 1], direction[:, 0]])
    return np.concatenate([path[along < teeth[0]], zigzag[[0, *range(1, 12, 2), 12]], path[along > teeth[-1]]])


def arc_length(path: Array) -> Array:
    """Distance of every point from the beginning, along the path."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])


def points_at(path: Array, along: Array) -> Array:
    """Points at given distances along a path."""
    distance = arc_length(path)
    return np.column_stack([np.interp(along, distance, path[:, axis]) for axis in (0, 1)])


def _angle_of(vector: Array) -> float:
    """Direction of a vector, rad."""
    return float(np.arctan2(vector[1], vector[0]))


def _angle_between(one: float, other: float) -> float:
    """Angle from one direction to another the shorter way round, rad, 0 .. π."""
    return abs((one - other + np.pi) % (2.0 * np.pi) - np.pi)

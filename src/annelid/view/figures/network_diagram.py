"""Figure 6: the diagram of a network of neurons, drawn from the network itself."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from annelid.nervous import Connection, GapJunction, ModulatorySynapse, Network
from annelid.view.canvas import WIDTH_IN, canvas, save_both
from annelid.view.style import segment_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
Effect = Literal["excitatory", "inhibitory", "modulatory", "gap junction", "rectified gap junction"]

CAPTION = (
    "The network that controls the worm, drawn from the network object that the simulation steps: one column a "
    "segment. The contraction and the expansion neuron (U1, U2) form a half-centre: they have a persistent sodium "
    "channel (double outline) and inhibit each other. The sensory neuron (U3), which the stretch sensor excites while "
    "its segment is at rest length, holds the segment expanded; the relay (U4) silences the sensory neuron of the next "
    "segment, and that of the last segment closes the ring to the first."
)

PAPER_SYMBOLS = {"contraction": "U1", "expansion": "U2", "sensory": "U3", "relay": "U4"}
"""The paper's symbols of the four neurons of a segment, by the role in a neuron's name."""


@dataclass(frozen=True)
class Stub:
    """An input's or output's short line to the outside.

    Attributes:
        name: Name of the input or output.
        neuron: Name of the neuron.
        path: From tail to head of the arrow, shape ``(2, 2)``.
        outer: Its end away from the neuron, shape ``(2,)``.
        direction: Unit vector from the neuron outwards, shape ``(2,)``.
    """

    name: str
    neuron: str
    path: Array
    outer: Array
    direction: Array

    @property
    def label(self) -> str:
        """Its name, unless that is the neuron's."""
        return "" if self.name == self.neuron else self.name.replace("_", " ")


@dataclass(frozen=True)
class Diagram:
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


def effect(network: Network, link: Connection) -> Effect:
    """Tells what a connection does: a synapse excites if its reversal potential lies above its target's rest."""
    kind = link.kind
    if isinstance(kind, ModulatorySynapse):
        return "modulatory"
    if isinstance(kind, GapJunction):
        return "rectified gap junction" if kind.rectified else "gap junction"
    return "excitatory" if kind.reversal_mV > network.neurons[link.target].rest_mV else "inhibitory"


def lay_out(network: Network) -> Diagram:
    """Places neurons and leads connections around them.

    Names that all end in ``_<n>`` make one column for each n, its neurons row by row from the top in their order; other
    networks are laid out on a circle. A connection is straight where no neuron is in its way, and bent otherwise;
    one from the last column back to the first passes below.
    """
    columns = _columns(network.neurons)
    places = _in_columns(columns) if columns else _on_circle(list(network.neurons))
    routes = tuple(_routes(network, places, columns))
    busy = _busy_directions(network, places, routes)
    outputs = [_stub(name, neuron, places, busy, columns, up=True) for name, neuron in network.outputs.items()]
    inputs = [
        _stub(name, neuron, places, busy, columns, up=False)
        for name, neurons in network.inputs.items()
        for neuron in neurons
    ]
    return Diagram(places, routes, tuple(inputs), tuple(outputs), columns)


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
    left, right, bottom, top = _bounds(diagram)
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
        _draw_arrow(axes, stub.path, f"input-{stub.name}-{stub.neuron}")
        _write_beside(axes, stub)
    for stub in diagram.outputs:
        _draw_arrow(axes, stub.path, f"output-{stub.name}")
        _write_beside(axes, stub)
    for name, place in diagram.places.items():
        _draw_neuron(axes, place, symbols[_role(name)], bool(network.neurons[name].channels), f"neuron-{name}")
    return diagram


def abbreviations(names: Iterable[str]) -> dict[str, str]:
    """Shortens names, without their segments' numbers, to three letters or as many as tell them apart."""
    roles = list(dict.fromkeys(_role(name) for name in names))
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
    left, right, bottom, top = _bounds(lay_out(network))
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


_RADIUS = 0.27
_STUB = 0.42
_HEADER = _RADIUS + _STUB + 0.16
_TRIANGLE = 0.17
_DOT = 0.065
_COLUMN_GAP = 1.35
_CROWDED = 0.4
_BENDS = (0.0, 0.2, -0.2, 0.35, -0.35, 0.55, -0.55, 0.8, -0.8)
_SMALLEST_UNIT_IN, _SMALLEST_UNIT_WITH_NUMBERS_IN, _LARGEST_UNIT_IN = 0.5, 0.9, 1.0
_MEANINGS_A_ROW = 5
_ROW_IN, _KEY_COLUMNS_IN, _KEY_UNIT_IN = 0.28, (0.25, 2.8, 5.1), 0.45
_INHIBITORY, _EXCITATORY = segment_colors(2)
_COLORS: dict[Effect, Any] = {
    "excitatory": _EXCITATORY,
    "inhibitory": _INHIBITORY,
    "modulatory": "0.35",
    "gap junction": "0.35",
    "rectified gap junction": "0.35",
}
_NUMBERED = re.compile(r"(.+)_(\d+)")


def _role(name: str) -> str:
    match = _NUMBERED.fullmatch(name)
    return match[1] if match else name


def _columns(names: Iterable[str]) -> dict[int, list[str]]:
    """Names by the number they end in, in ascending order; empty if one of them has none."""
    columns: dict[int, list[str]] = {}
    for name in names:
        match = _NUMBERED.fullmatch(name)
        if match is None:
            return {}
        columns.setdefault(int(match[2]), []).append(name)
    return dict(sorted(columns.items()))


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
            yield _self_loop(start, np.pi / 4.0 if columns else _angle(start), len(pair))
        elif _closes_the_ring(link, places, columns):
            yield _return_path(start, end, min(place[1] for place in places.values()), n_returns)
            n_returns += 1
        else:
            pair = frozenset((link.source, link.target))
            others = np.array([place for name, place in places.items() if name not in pair]).reshape(-1, 2)
            # A bend counts from the same side for both directions, so that two paths never coincide.
            side = 1.0 if link.source < link.target else -1.0
            bends = _BENDS if shared[pair] == 1 else _BENDS[3:]
            free = [bend for bend in bends if side * bend not in taken.get(pair, [])] or [1.1 + 0.3 * shared[pair]]
            paths = [_between_rims(_bow(start, end, bend), start, end) for bend in free]
            arrivals = arrived.setdefault(link.target, [])
            costs = [10 * _n_hit(path, others) + _n_crowded(path[-1] - end, arrivals) for path in paths]
            chosen = int(np.argmin(costs))
            arrivals.append(_angle(paths[chosen][-1] - end))
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


def _return_path(start: Array, end: Array, bottom: float, lane: int) -> Array:
    aside, below = 0.62 + 0.22 * lane, bottom - 1.1 - 0.22 * lane
    corners = np.array(
        [
            (start[0] + _RADIUS, start[1]),
            (start[0] + aside, start[1]),
            (start[0] + aside, below),
            (end[0] - aside, below),
            (end[0] - aside, end[1]),
            (end[0] - _RADIUS, end[1]),
        ]
    )
    return _rounded(corners, 0.18)


def _rounded(corners: Array, radius: float) -> Array:
    """Replaces the corners of a path by parabolas that begin and end ``radius`` away from them."""
    share = np.linspace(0.0, 1.0, 9)[:, np.newaxis]
    pieces = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        enter, leave = (corner + radius * (p - corner) / np.hypot(*(p - corner)) for p in (before, after))
        pieces.append((1 - share) ** 2 * enter + 2 * share * (1 - share) * corner + share**2 * leave)
    return np.concatenate([*pieces, corners[-1:]])


def _bow(start: Array, end: Array, bend: float) -> Array:
    """A parabola between two points whose middle is off the straight line by ``bend / 2`` of its length."""
    share = np.linspace(0.0, 1.0, 121)[:, np.newaxis]
    across = np.array([-(end - start)[1], (end - start)[0]])
    return (1 - share) * start + share * end + 2.0 * share * (1 - share) * bend * across


def _n_hit(path: Array, others: Array) -> int:
    distance = np.linalg.norm(path[:, np.newaxis] - others, axis=2)
    return int(np.sum(distance.min(axis=0) < 1.25 * _RADIUS)) if len(others) else 0


def _n_crowded(arrival: Array, others: Sequence[float]) -> int:
    return sum(_between(_angle(arrival), other) < _CROWDED for other in others)


def _between_rims(path: Array, start: Array, end: Array) -> Array:
    outside = (np.linalg.norm(path - start, axis=1) >= _RADIUS) & (np.linalg.norm(path - end, axis=1) >= _RADIUS)
    return path[outside]


def _self_loop(place: Array, outwards: float, number: int) -> Array:
    """Of a circle beside the neuron, the arc outside it."""
    radius = 0.2 + 0.08 * (number - 1)
    turn = outwards + np.linspace(-np.pi, np.pi, 121)
    center = place + (_RADIUS + 0.6 * radius) * np.array([np.cos(outwards), np.sin(outwards)])
    loop = center + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return loop[np.linalg.norm(loop - place, axis=1) >= _RADIUS]


def _busy_directions(network: Network, places: Mapping[str, Array], routes: Sequence[Array]) -> dict[str, list[float]]:
    """Angles, seen from each neuron, at which there is a connection or a close neighbour."""
    busy: dict[str, list[float]] = {name: [] for name in places}
    for link, route in zip(network.connections, routes, strict=True):
        for name, end in ((link.source, route[0]), (link.target, route[-1])):
            busy[name].append(_angle(end - places[name]))
    for name, place in places.items():
        gaps = [other - place for key, other in places.items() if key != name]
        busy[name] += [_angle(gap) for gap in gaps if np.hypot(*gap) < 1.2]
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
    wanted = _angle(place) if not columns and np.any(place) else (0.5 if up else -0.5) * np.pi

    def merit(angle: float) -> float:
        room = min((_between(angle, other) for other in busy[neuron]), default=np.pi)
        return min(room, 0.9) + 0.25 * np.cos(angle - wanted)

    angle = max(np.pi / 8.0 * np.arange(16), key=merit)
    busy[neuron].append(float(angle))
    direction = np.array([np.cos(angle), np.sin(angle)])
    rim, outer = place + _RADIUS * direction, place + (_RADIUS + _STUB) * direction
    return Stub(name, neuron, np.array([rim, outer] if up else [outer, rim]), outer, direction)


def _angle(vector: Array) -> float:
    return float(np.arctan2(vector[1], vector[0]))


def _between(one: float, other: float) -> float:
    return abs((one - other + np.pi) % (2.0 * np.pi) - np.pi)


def _bounds(diagram: Diagram) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of all there is, with room for the labels."""
    label = 0.13
    rim = _RADIUS + 0.2
    points = [place + sign * rim for place in diagram.places.values() for sign in (-1.0, 1.0)]
    points += [*np.concatenate(diagram.routes)] if diagram.routes else []
    for stub in (*diagram.inputs, *diagram.outputs):
        width = label * len(stub.label)
        sideways = stub.direction[0]
        left = -width if sideways < -0.3 else -width / 2.0 if sideways < 0.3 else 0.0
        points += [np.add(stub.outer, (left, -0.25)), np.add(stub.outer, (left + width, 0.25))]
    corner = np.array(points).reshape(-1, 2)
    (left, bottom), (right, top) = corner.min(axis=0) - 0.12, corner.max(axis=0) + 0.12
    header = _HEADER + 0.25 if diagram.columns else 0.0
    return float(left), float(right), float(bottom), max(float(top), header)


def _draw_column(axes: Axes, segment: int, places: Array) -> None:
    from matplotlib.patches import FancyBboxPatch

    (left, bottom), (right, top) = places.min(axis=0), places.max(axis=0)
    pad = 0.44
    axes.add_patch(
        FancyBboxPatch(
            (left, bottom),
            right - left,
            top - bottom,
            boxstyle=f"round,pad={pad},rounding_size=0.2",
            facecolor="0.945",
            edgecolor="none",
            zorder=0,
        )
    )
    axes.text((left + right) / 2.0, top + _HEADER, f"segment {segment}", ha="center", va="center", zorder=7)


def _draw_neuron(axes: Axes, place: Array, symbol: str, gated: bool, gid: str | None = None) -> None:
    from matplotlib.patches import Circle

    center = (float(place[0]), float(place[1]))
    axes.add_patch(Circle(center, _RADIUS, facecolor="w", edgecolor="k", linewidth=1.3, zorder=5, gid=gid))
    if gated:
        axes.add_patch(Circle(center, 0.84 * _RADIUS, facecolor="none", edgecolor="k", linewidth=0.8, zorder=5))
    size = 9.0 if len(symbol) <= 3 else 7.0
    axes.text(*center, symbol, ha="center", va="center_baseline", fontsize=size, zorder=6)


def _draw_connection(axes: Axes, route: Array, what: Effect, gid: str | None = None) -> None:
    """Draws a path with an open triangle, a filled dot, or a resistor in its middle."""
    from matplotlib.patches import Circle, Polygon

    color = _COLORS[what]
    gap = "gap" in what
    end_length = 0.0 if gap else _TRIANGLE if what == "excitatory" else 2.0 * _DOT
    tip = route[-1]
    body = route[np.linalg.norm(route - tip, axis=1) >= end_length - 1e-12] if end_length else route
    base = body[-1]
    forward = (tip - base) / np.hypot(*(tip - base)) if end_length else np.zeros(2)
    if gap:
        body = _with_resistor(body)
    dashes = "--" if what == "modulatory" else "-"
    axes.plot(*body.T, dashes, color=color, linewidth=1.3, solid_joinstyle="miter", gid=gid, zorder=2)
    if what == "excitatory":
        base = tip - _TRIANGLE * forward
        across = 0.5 * _TRIANGLE * np.array([-forward[1], forward[0]])
        corners = np.array([tip, base + across, base - across])
        axes.add_patch(Polygon(corners, facecolor="w", edgecolor=color, linewidth=1.2, joinstyle="miter", zorder=3))
    elif what == "inhibitory":
        center = tip - _DOT * forward
        axes.add_patch(Circle((center[0], center[1]), _DOT, facecolor=color, edgecolor=color, zorder=3))
    elif what == "modulatory":
        middle, side = tip - _DOT * forward, _DOT * np.array([-forward[1], forward[0]])
        corners = np.array([tip, middle + side, tip - 2.0 * _DOT * forward, middle - side])
        axes.add_patch(Polygon(corners, facecolor="w", edgecolor=color, linewidth=1.2, zorder=3))
    elif what == "rectified gap junction":
        _draw_diode(axes, route, color)


def _with_resistor(path: Array) -> Array:
    """Turns the middle of a path into a zigzag."""
    along = _arc_length(path)
    teeth = 0.5 * along[-1] + 0.3 * np.linspace(-0.5, 0.5, 13) * min(1.0, 2.0 * along[-1])
    direction = np.gradient(_at(path, teeth), axis=0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    height = 0.08 * np.array([0, *([1, 0, -1, 0] * 3)])[:, np.newaxis]
    zigzag = _at(path, teeth) + height * np.column_stack([-direction[:, 1], direction[:, 0]])
    return np.concatenate([path[along < teeth[0]], zigzag[[0, *range(1, 12, 2), 12]], path[along > teeth[-1]]])


def _draw_diode(axes: Axes, route: Array, color: Any) -> None:
    from matplotlib.patches import Polygon

    along = _arc_length(route)[-1]
    tip, back = _at(route, np.array([0.9 * along, 0.9 * along - 0.1]))
    across = 0.55 * np.array([-(tip - back)[1], (tip - back)[0]])
    axes.add_patch(Polygon([tip, back + across, back - across], facecolor=color, edgecolor=color, zorder=3))
    axes.plot(*np.array([tip + across, tip - across]).T, color=color, linewidth=1.3, zorder=3)


def _arc_length(path: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])


def _at(path: Array, along: Array) -> Array:
    """Points at given distances along a path."""
    distance = _arc_length(path)
    return np.column_stack([np.interp(along, distance, path[:, axis]) for axis in (0, 1)])


def _write_conductance(axes: Axes, route: Array, share: float, conductance_uS: float) -> None:
    x, y = _at(route, np.array([share * _arc_length(route)[-1]]))[0]
    paper = {"facecolor": "w", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
    axes.text(x, y, f"{conductance_uS:.2f}", ha="center", va="center", fontsize=7, bbox=paper, zorder=2.5)


def _draw_arrow(axes: Axes, path: Array, gid: str | None = None) -> None:
    from matplotlib.patches import FancyArrowPatch

    (x0, y0), (x1, y1) = path
    style = "-|>,head_length=4.5,head_width=2.2"
    axes.add_patch(
        FancyArrowPatch((x0, y0), (x1, y1), arrowstyle=style, shrinkA=0, shrinkB=0, color="0.3", zorder=3, gid=gid)
    )


def _write_beside(axes: Axes, stub: Stub) -> None:
    x, y = stub.outer + 0.06 * stub.direction
    sideways, upwards = stub.direction
    across = "center" if abs(sideways) < 0.3 else "left" if sideways > 0 else "right"
    along = "center" if abs(upwards) < 0.3 else "bottom" if upwards > 0 else "top"
    axes.text(x, y, stub.label, ha=across, va=along, fontsize=8, zorder=7)


def _key(network: Network) -> list[str]:
    """What the key has to explain: only what the network has."""
    effects = {effect(network, link) for link in network.connections}
    gated = {bool(neuron.channels) for neuron in network.neurons.values()}
    present = {
        "neuron": False in gated,
        "neuron with gated channels": True in gated,
        **{f"{what} synapse": what in effects for what in ("excitatory", "inhibitory", "modulatory")},
        **{what: what in effects for what in ("gap junction", "rectified gap junction")},
        "input current": bool(network.inputs),
        "output: potential read": bool(network.outputs),
    }
    return [entry for entry, there in present.items() if there]


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
        if what in _COLORS:
            _draw_connection(symbols, path, what)
        elif entry.startswith("neuron"):
            _draw_neuron(symbols, path.mean(axis=0), "", "gated" in entry)
        else:
            _draw_arrow(symbols, path[[0, -1]])
            rim = path[-1 if entry.startswith("input") else 0]
            symbols.plot([rim[0]] * 2, [rim[1] - 0.15, rim[1] + 0.15], color="k", linewidth=1.3)

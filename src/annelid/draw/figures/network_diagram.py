"""The diagram of a network of neurons, drawn from the network itself; figure 6 of the paper.

Points of the plane are complex numbers, x to the right and y upwards, in units of the distance between neighbouring
neurons.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from annelid.config import RunConfig
from annelid.draw.canvas import MOST_ROWS, WIDTH_IN, canvas, evenly, line_looks, panel_title, plain, save
from annelid.draw.figures import RUN_FIGURES
from annelid.draw.plots import plot_path
from annelid.errors import RunFileError
from annelid.nervous import Connection, GapJunction, Network
from annelid.simulation import Run, build_plant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Path2D = NDArray[np.complexfloating]
Effect = Literal["excitatory", "inhibitory", "gap junction", "rectified gap junction"]

SYMBOLS = {"contraction": "U1", "expansion": "U2", "sensory": "U3", "relay": "U4"}
"""The paper's symbols of the neurons of a segment, by the part of a neuron's name before its segment's number."""
_INK = "#404040"
# Dashes, corners of the mark at the end (0 for none), whether it is filled, and its marker in the key. Colours are for
# the neurons.
_LOOKS: dict[Effect, tuple[Any, int, bool, Any]] = {
    "excitatory": ("-", 3, False, ">"),
    "inhibitory": ("-", 40, True, "o"),
    "gap junction": ((0, (1, 1)), 0, False, None),
    "rectified gap junction": ((0, (1, 1)), 3, True, ">"),
}
_RADIUS = 0.27  # of a neuron
_MARK = 0.075  # radius of the mark at the end of a connection
_STUB = 0.42  # length of the arrow of an input or an output
_COLUMN_GAP = 1.35
_IN_A_ROW = 2  # neurons of a segment that stand beside each other
_LONGEST_LABEL = 7  # letters that can be read in a neuron
_CROWDED, _ROOMY = 0.92, 0.6  # cosines of angles between lines at a neuron: they overlap, they have room
_BENDS = (0.0, 0.25, -0.25, 0.4, -0.4, 0.6, -0.6, 0.8, -0.8, 1.1, -1.1)
_UNIT_IN = (0.55, 1.0)  # least and largest length of a unit, inches
_PANEL_IN = 0.95  # height of a panel of potentials
_PAPER: Any = {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8}, "zorder": 3}
_NUMBERED = re.compile(r"(.+)_(\d{1,9})")


def network_figure(network: Network, path: str | Path) -> Path:
    """Draws any network, each neuron, connection, input and output once, with a key to its symbols.

    In an SVG file neurons have the ids ``neuron-<i>`` and connections ``connection-<i>``, in the network's order.

    Args:
        network: The network.
        path: File to write; its suffix chooses the format (``.png``, ``.pdf``, ``.svg``); a name without
            one becomes a ``.png``.

    Returns:
        The path written.

    Raises:
        RunFileError: The file has another suffix or cannot be written.
    """
    path = plot_path(path)
    with _drawn(network) as (figure, _):
        _draw_key(figure, network, ())
        return save(figure, path, bbox_inches="tight", pad_inches=0.1)


def network_svg(network: Network) -> str:
    """Returns the drawing of `network_figure`, without its key, as the SVG element of a web page."""
    import matplotlib

    text = StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with _drawn(network) as (figure, _), matplotlib.rc_context({"svg.fonttype": "none"}):
        figure.savefig(text, format="svg", bbox_inches="tight", transparent=True, metadata=nothing)
    return text.getvalue()[text.getvalue().index("<svg") :]


def network_of(config: RunConfig, neurons: Sequence[str]) -> Network | None:
    """Returns the network of these neurons that the controller of a configuration steps, or None without one."""
    network = getattr(config.controller.build(config, build_plant(config)), "network", None)
    return network if isinstance(network, Network) and list(network.neurons) == list(neurons) else None


def run_network_figure(run: Run, path: str | Path) -> Path:
    """Draws the network that a run's controller stepped, as `network_figure`, and below it what its neurons did.

    There is a panel for each segment, of many for evenly spaced ones, and one for neurons of no segment. A trace has
    the colour of its neuron in the network.

    Raises:
        RunFileError: As of `network_figure`, or the run holds the potentials of no network.
    """
    neurons = [str(name) for name in run.data["neuron"].values] if "potential" in run.data else []
    # A network of a user's own, which the configuration does not describe, is in the file itself.
    text = run.data.attrs.get("network")
    network = Network.from_toml(text) if isinstance(text, str) else network_of(run.config, neurons) if neurons else None
    if network is None:
        raise RunFileError(f"{run.path} holds no network to draw: its controller is {run.config.controller.kind}")
    segments, others = by_segment(neurons)
    numbers = [list(segments)[i] for i in evenly(len(segments), MOST_ROWS)]
    rows = {f"segment {number}": segments[number] for number in numbers} | (
        {"others" * bool(segments): others} if others else {}
    )
    path = plot_path(path)
    with _drawn(network, len(rows)) as (figure, panels):
        looks, labels = looks_of(network), labels_of(network)
        for axes, (name, row) in zip(panels, rows.items(), strict=True):
            for neuron in row:
                trace = run.data["potential"].values[:, neurons.index(neuron)]
                gid = f"trace-{neurons.index(neuron)}"
                axes.plot(run.data["time"].values, trace, **looks[labels[neuron]], gid=gid)
            axes.set(ylabel=name, xlim=run.data["time"].values[[0, -1]])
        if rows:
            panel_title(panels[0], "Potentials above rest (mV)")
            panels[-1].set_xlabel("time (s)")
        _draw_key(figure, network, [labels[neuron] for row in rows.values() for neuron in row])
        return save(figure, path, bbox_inches="tight", pad_inches=0.1)


RUN_FIGURES.add("network", run_network_figure)


def effect_of(network: Network, connection: Connection) -> Effect:
    """Returns what a connection does: a reversal potential above its target's rest excites, another inhibits."""
    kind = connection.kind
    if isinstance(kind, GapJunction):
        return "rectified gap junction" if kind.rectified else "gap junction"
    return "excitatory" if kind.reversal_mV > network.neurons[connection.target].rest_mV else "inhibitory"


def role_of(name: str) -> str:
    """Returns a neuron's name without its segment's number."""
    match = _NUMBERED.fullmatch(name)
    return match[1] if match else name


def by_segment(names: Iterable[str]) -> tuple[dict[int, list[str]], list[str]]:
    """Returns names by the segment's number they end in, in ascending order, and those that end in none."""
    segments: dict[int, list[str]] = defaultdict(list)
    others = []
    for name in names:
        match = _NUMBERED.fullmatch(name)
        (segments[int(match[2])] if match else others).append(name)
    return dict(sorted(segments.items())), others


def labels_of(network: Network) -> dict[str, str]:
    """Returns what stands in each neuron: a symbol of the paper, or its role, shortened if it is long."""
    roles = list(dict.fromkeys(map(role_of, network.neurons)))
    shown = {
        role: SYMBOLS.get(role, role if len(role) <= _LONGEST_LABEL else _shortened(role, roles)) for role in roles
    }
    numbered = _columns(network)
    return {name: shown[role_of(name)] if numbered else name for name in network.neurons}


def meanings_of(network: Network) -> dict[str, str]:
    """Returns what labels stand for, as U1 for contraction, of those that are not the names themselves."""
    roles = {label: role_of(name) for name, label in labels_of(network).items() if label != name}
    return {label: role for label, role in roles.items() if label != role}


def looks_of(network: Network) -> dict[str, dict[str, Any]]:
    """Returns colour and dashes of the neurons, by their labels: those of a role are alike."""
    labels = list(dict.fromkeys(labels_of(network).values()))
    return dict(zip(labels, line_looks(len(labels)), strict=True))


def _shortened(role: str, roles: Iterable[str]) -> str:
    """Returns the first three letters of a role, or more where another role begins with these."""
    others = [other for other in roles if other != role]
    starts = (role[:n] for n in range(3, len(role)))
    return next((start for start in starts if not any(other.startswith(start) for other in others)), role)


def _columns(network: Network) -> dict[int, list[str]]:
    """Returns the neurons of each segment, or nothing for a network that is not made of segments."""
    segments, others = by_segment(network.neurons)
    return segments if len(others) < len(network.neurons) - len(others) else {}


def place_neurons(network: Network) -> dict[str, complex]:
    """Returns the centre of every neuron.

    The neurons of a segment, whose names end in its number, stand in rows of one column of the picture, in the
    network's order. Those of no segment stand in a row below, near to the neurons that they are connected with. A
    network without segments stands on a circle.
    """
    columns = _columns(network)
    if not columns:
        n = len(network.neurons)
        radius = 0.65 / np.sin(np.pi / n) if n > 1 else 0.0
        return {name: radius * np.exp(1j * (np.pi - 2.0 * np.pi * i / n)) for i, name in enumerate(network.neurons)}
    pitch = _IN_A_ROW - 1 + _COLUMN_GAP
    places = {
        name: complex(column * pitch + index % _IN_A_ROW, -(index // _IN_A_ROW))
        for column, names in enumerate(columns.values())
        for index, name in enumerate(names)
    }
    below = {}
    for name in by_segment(network.neurons)[1]:
        ends = [(link.source, link.target) for link in network.connections if name in (link.source, link.target)]
        below[name] = np.mean([places[end].real for pair in ends for end in pair if end in places] or [0.0])
    x, y = -1.0, min(place.imag for place in places.values()) - 1.6
    for name in sorted(below, key=lambda name: below[name]):
        x = max(below[name], x + 1.0)
        places[name] = complex(x, y)
    return {name: places[name] for name in network.neurons}


def route_connections(network: Network, places: dict[str, complex]) -> Iterator[Path2D]:
    """Yields the path of each connection from rim to rim: straight, or bent around other neurons and other paths."""
    taken: dict[frozenset[str], list[float]] = defaultdict(list)
    arrived: dict[str, list[complex]] = defaultdict(list)
    middle = np.mean(list(places.values()))
    pairs = [frozenset((link.source, link.target)) for link in network.connections]
    for link, pair in zip(network.connections, pairs, strict=True):
        start, end = places[link.source], places[link.target]
        if link.source == link.target:
            radius = 0.2 + 0.08 * len(taken[pair])
            outwards = _unit(start - middle) if start != middle else 1.0
            path = start + outwards * (
                _RADIUS + 0.6 * radius - radius * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 121))
            )
            taken[pair].append(0.0)
        else:
            # A bend counts from the same side for both directions, so that two paths never coincide.
            side = 1.0 if link.source < link.target else -1.0
            bends = _BENDS if pairs.count(pair) == 1 else _BENDS[1:]
            free = [bend for bend in bends if side * bend not in taken[pair]] or [1.4 + 0.3 * len(taken[pair])]
            others = np.array([place for name, place in places.items() if name not in pair])
            paths = [_bow(start, end, bend) for bend in free]
            costs = [
                10 * _n_hit(path, others) + np.sum(_cosines(arrived[link.target], _arrival(path)) > _CROWDED)
                for path in paths
            ]
            best = int(np.argmin(np.array(costs)))
            path = paths[best]
            taken[pair].append(side * free[best])
            arrived[link.target].append(_arrival(path))
        yield path[(abs(path - start) >= _RADIUS) & (abs(path - end) >= _RADIUS)]


def _bow(start: complex, end: complex, bend: float) -> Path2D:
    """Returns a parabola whose middle is off the straight line by ``bend / 2`` of its length."""
    share = np.linspace(0.0, 1.0, 481)
    return (1 - share) * start + share * end + 2.0 * share * (1 - share) * bend * 1j * (end - start)


def _n_hit(path: Path2D, others: Path2D) -> int:
    """Returns the number of neurons that a path runs over."""
    return int(np.sum(abs(path[::4, np.newaxis] - others).min(axis=0) < 1.25 * _RADIUS)) if others.size else 0


def _arrival(path: Path2D) -> complex:
    """Returns the direction in which a path meets the rim of its target, seen from there."""
    return _unit(path[abs(path - path[-1]) >= _RADIUS][-1] - path[-1])


def _unit(vector: Any) -> complex:
    return complex(vector / abs(vector))


def _cosines(one: Sequence[complex] | Path2D, other: complex) -> NDArray[np.float64]:
    """Returns the cosines of the angles between some directions and another."""
    return np.real(np.conj(one) * other)


@contextmanager
def _drawn(network: Network, n_panels: int = 0) -> Iterator[tuple[Figure, list[Axes]]]:
    """Gives a figure with the network, whose unit fits the width of a page, and empty panels below it."""
    places = place_neurons(network)
    routes = list(route_connections(network, places))
    with canvas(1.0) as figure:
        top, *panels = figure.subplots(1 + n_panels, 1, squeeze=False)[:, 0]
        top.set_aspect("equal")
        top.axis("off")
        _draw_columns(top, network, places)
        for number, (link, route) in enumerate(zip(network.connections, routes, strict=True)):
            _draw_connection(top, route, effect_of(network, link), f"connection-{number}")
        _draw_ends(top, network, places, routes)
        top.update_datalim([(place.real + s, place.imag + s) for place in places.values() for s in (-_RADIUS, _RADIUS)])
        box = top.dataLim.padded(0.1)
        unit_in = min(max(WIDTH_IN / box.width, _UNIT_IN[0]), _UNIT_IN[1])
        heights = [unit_in * box.height, *[_PANEL_IN] * n_panels]
        top.get_gridspec().set_height_ratios(heights)
        figure.set_size_inches(max(unit_in * box.width, WIDTH_IN if panels else 0.0), sum(heights))
        top.set(xlim=(box.x0, box.x1), ylim=(box.y0, box.y1))
        _draw_neurons(top, network, places, unit_in)
        for axes in panels[:-1]:
            axes.sharex(panels[-1])
            axes.sharey(panels[-1])
            axes.tick_params(labelbottom=False)
        yield figure, panels


def _draw_columns(axes: Axes, network: Network, places: dict[str, complex]) -> None:
    """Draws the background of each segment, with its name above."""
    from matplotlib.patches import FancyBboxPatch

    for segment, names in _columns(network).items():
        x, y = (part([places[name] for name in names]) for part in (np.real, np.imag))
        width, height = np.ptp(x) + 0.88, np.ptp(y) + 0.88
        corner = (x.min() - 0.44, y.min() - 0.44)
        look: dict[str, Any] = {
            "boxstyle": "round,pad=0,rounding_size=0.2",
            "facecolor": "#f1f1f1",
            "edgecolor": "none",
        }
        axes.add_patch(FancyBboxPatch(corner, width, height, **look))
        axes.text(x.mean(), y.max() + _RADIUS + _STUB + 0.1, f"segment {segment}", ha="center", va="bottom", **_PAPER)


def _draw_connection(axes: Axes, route: Path2D, effect: Effect, gid: str) -> None:
    """Draws a path and the mark at its end."""
    from matplotlib.patches import RegularPolygon

    dashes, corners, filled, _ = _LOOKS[effect]
    tip = route[-1]
    body = route[abs(route - tip) >= _MARK] if corners else route
    axes.plot(body.real, body.imag, color=_INK, linestyle=dashes, linewidth=1.1, snap=False, gid=gid)
    if corners:
        forward = _unit(tip - body[-1])
        middle = tip - _MARK * forward
        look = {"facecolor": _INK if filled else "white", "edgecolor": _INK, "linewidth": 1.2, "zorder": 3}
        turn = float(np.angle(forward)) - np.pi / 2.0
        axes.add_patch(RegularPolygon((middle.real, middle.imag), corners, radius=_MARK, orientation=turn, **look))


def _draw_ends(axes: Axes, network: Network, places: dict[str, complex], routes: Sequence[Path2D]) -> None:
    """Draws inputs and outputs as arrows where there is room around their neuron, with their names."""
    busy: dict[str, list[complex]] = {name: [] for name in places}
    for link, route in zip(network.connections, routes, strict=True):
        busy[link.source].append(_unit(route[0] - places[link.source]))
        busy[link.target].append(_unit(route[-1] - places[link.target]))
    for name, place in places.items():
        busy[name] += [_unit(other - place) for other in places.values() if 0.0 < abs(other - place) < 1.2]
    directions: Path2D = np.exp(1j * np.pi / 8.0 * np.arange(16))
    outputs = [(name, neuron, 1.0) for name, neuron in network.outputs.items()]
    inputs = [(name, neuron, -1.0) for name, neurons in network.inputs.items() for neuron in neurons]
    for name, neuron, upwards in outputs + inputs:
        nearest = np.max([_cosines(directions, other) for other in busy[neuron]], axis=0, initial=_ROOMY)
        best = int(np.argmax(0.25 * upwards * directions.imag - nearest))
        away = complex(directions[best])
        busy[neuron].append(away)
        rim, outer = places[neuron] + _RADIUS * away, places[neuron] + (_RADIUS + _STUB) * away
        tail, head = (rim, outer) if upwards > 0 else (outer, rim)
        axes.plot([rim.real, outer.real], [rim.imag, outer.imag], linewidth=0.0)
        arrow = {"arrowstyle": "-|>", "color": _INK, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", (head.real, head.imag), (tail.real, tail.imag), arrowprops=arrow)
        if name != neuron:
            across = "center" if abs(away.real) < 0.3 else "left" if away.real > 0 else "right"
            along = "center" if abs(away.imag) < 0.3 else "bottom" if away.imag > 0 else "top"
            axes.text(
                outer.real, outer.imag, plain(name.replace("_", " ")), ha=across, va=along, fontsize=8.0, **_PAPER
            )


def _draw_neurons(axes: Axes, network: Network, places: dict[str, complex], unit_in: float) -> None:
    """Draws circles in the colours of the neurons, with a double rim for gated channels, and their labels."""
    from matplotlib.patches import Circle

    labels, looks = labels_of(network), looks_of(network)
    for number, (name, place) in enumerate(places.items()):
        neuron, center, color = network.neurons[name], (place.real, place.imag), looks[labels[name]]["color"]
        radii = (_RADIUS, 0.82 * _RADIUS) if neuron.channels else (_RADIUS,)
        for radius, width, face in zip(radii, (2.2, 1.2), ("white", "none"), strict=False):
            gid = f"neuron-{number}" if radius == _RADIUS else None
            look = {"facecolor": face, "edgecolor": color, "linewidth": width, "zorder": 4, "gid": gid}
            axes.add_patch(Circle(center, radius, **look))
        size = min(9.0, 1.5 * _RADIUS * unit_in * 72.0 / (0.6 * max(len(labels[name]), 1)))
        axes.text(*center, plain(labels[name]), ha="center", va="center_baseline", fontsize=size, zorder=5)


def _draw_key(figure: Figure, network: Network, traces: Iterable[str]) -> None:
    """Writes below the network what its symbols mean, of those that it has, and which neurons its labels stand for.

    The labels of traces are named, too, where they stand for themselves.
    """
    from matplotlib.lines import Line2D

    meanings, traces = meanings_of(network), set(traces)
    ring: dict[str, Any] = {"marker": "o", "markerfacecolor": "white", "markersize": 9, "markeredgewidth": 2}
    entries = []
    for label, look in looks_of(network).items():
        if label in meanings or label in traces:
            line = look if label in traces else {"linestyle": "none", "markeredgecolor": look["color"]}
            name = f"{label}: {meanings[label]}" if label in meanings else label
            entries.append(Line2D([], [], label=plain(name), **ring, **line))
    if any(neuron.channels for neuron in network.neurons.values()):
        gated = {"marker": "$\u25ce$", "markersize": 11, "color": _INK, "linestyle": "none"}
        entries.append(Line2D([], [], label="neuron with gated channels", **gated))
    found = {effect_of(network, link) for link in network.connections}
    for effect, (dashes, _, filled, marker) in _LOOKS.items():
        if effect in found:
            look = {"color": _INK, "linestyle": dashes, "marker": marker, "markevery": [1]}
            name = effect if "gap" in effect else f"{effect} synapse"
            entries.append(Line2D([], [], markerfacecolor=_INK if filled else "white", label=name, **look))
    if network.inputs or network.outputs:
        entries.append(Line2D([], [], color=_INK, marker=">", markevery=[1], label="input current, output potential"))
    legend = figure.legend(handles=entries, loc="outside lower left", ncols=3, handlelength=2.8)
    # The key takes no room from what is above it.
    figure.set_figheight(figure.get_figheight() + legend.get_window_extent().height / figure.dpi)

"""The diagram of a network of neurons, drawn from the network itself; figure 6 of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.draw.canvas import WIDTH_IN, canvas, plain, save_both
from annelid.nervous import Network
from annelid.nervous.drawing import (
    COLORS,
    Line,
    Shape,
    Words,
    arrow_shapes,
    connection_shapes,
    effect_of,
    frame_of,
    network_shapes,
    neuron_shapes,
    role_of,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAPER_SYMBOLS = {"contraction": "U1", "expansion": "U2", "sensory": "U3", "relay": "U4"}
"""The paper's symbols of the four neurons of a segment, by the role in a neuron's name."""

_PAPER = {"facecolor": "w", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
_SMALLEST_UNIT_IN, _SMALLEST_UNIT_WITH_NUMBERS_IN, _LARGEST_UNIT_IN = 0.5, 0.9, 1.0
_MEANINGS_A_ROW = 5
_ROW, _KEY_COLUMNS, _KEY_UNIT_IN = 0.62, (0.56, 6.22, 11.33), 0.45  # the key's rows and columns, in its own unit


def abbreviations(names: Iterable[str]) -> dict[str, str]:
    """Shortens names, without their segments' numbers, to three letters, or more where these are not distinct."""
    roles = list(dict.fromkeys(role_of(name) for name in names))
    short: dict[str, str] = {}
    for role in roles:
        others = [other for other in roles if other != role]
        lengths = range(min(3, len(role)), len(role) + 1)
        short[role] = next((role[:n] for n in lengths if not any(o.startswith(role[:n]) for o in others)), role)
    return short


def network_figure(network: Network, stem: Path, *, conductances: bool = False) -> Path:
    """Draws any network, each neuron, connection, input and output once, with a key to its symbols.

    The keys of `annelid.nervous.drawing.network_shapes` are ids in the SVG file.

    Args:
        network: The network.
        stem: Path of the two files without their suffixes.
        conductances: Whether to write on each connection how strong it is.

    Returns:
        The path of the PNG file; the SVG file lies beside it.
    """
    written = abbreviations(network.neurons) | PAPER_SYMBOLS
    shapes = network_shapes(network, {n: written[role_of(n)] for n in network.neurons}, strengths=conductances)
    left, right, bottom, top = frame_of(shapes, _SMALLEST_UNIT_IN)
    smallest_in = _SMALLEST_UNIT_WITH_NUMBERS_IN if conductances else _SMALLEST_UNIT_IN
    width_in = max(WIDTH_IN, smallest_in * (right - left))
    diagram_in = min(width_in / (right - left), _LARGEST_UNIT_IN) * (top - bottom)
    roles = dict.fromkeys(map(role_of, network.neurons))
    meanings = [f"{written[role]}  {role}" for role in roles if written[role] != role]
    key, key_height = _key_shapes(_key(network), meanings)
    key_in = _KEY_UNIT_IN * key_height
    with canvas(diagram_in + key_in, width_in) as figure:
        figure.set_layout_engine("none")
        share = key_in / (diagram_in + key_in)
        _paint(figure.add_axes((0.0, share, 1.0, 1.0 - share)), shapes, (left, right, bottom, top))
        _paint(figure.add_axes((0.0, 0.0, 1.0, share)), key, (0.0, width_in / _KEY_UNIT_IN, 0.0, key_height))
        return save_both(figure, stem)


def _paint(axes: Axes, shapes: Iterable[Shape], frame: tuple[float, float, float, float]) -> None:
    """Draws shapes from back to front; the frame is left, right, bottom and top of the axes."""
    from matplotlib.patches import Polygon

    axes.set(xlim=frame[:2], ylim=frame[2:], aspect="equal")
    axes.axis("off")
    # With one height for all, what is added later is drawn over the rest.
    for shape in shapes:
        if isinstance(shape, Words):
            axes.text(
                shape.place.real,
                shape.place.imag,
                plain(shape.text),
                fontsize=shape.size_pt,
                horizontalalignment=shape.across,
                verticalalignment="center_baseline" if shape.along == "center" else shape.along,
                bbox=_PAPER if shape.halo else None,
                zorder=2,
            )
        else:
            patch = Polygon(
                np.column_stack([shape.points.real, shape.points.imag]),
                closed=bool(shape.fill),
                facecolor=shape.fill or "none",
                edgecolor=shape.color,
                linewidth=shape.width_pt,
                linestyle="--" if shape.dashed else "-",
                joinstyle="miter",
                gid=shape.key or None,
                zorder=2,
            )
            axes.add_patch(patch)


def _key(network: Network) -> list[str]:
    """What the key has to explain: only what the network has."""
    effects = {effect_of(network, link) for link in network.connections}
    neurons = network.neurons.values()
    key = ["neuron"] * any(not neuron.channels and neuron.firing is None for neuron in neurons)
    key += ["neuron with gated channels"] * any(neuron.channels for neuron in neurons)
    key += ["spiking neuron"] * any(neuron.firing is not None for neuron in neurons)
    key += [what if "gap" in what else f"{what} synapse" for what in COLORS if what in effects]
    return key + ["input current"] * bool(network.inputs) + ["output: potential read"] * bool(network.outputs)


def _key_shapes(entries: Sequence[str], meanings: Sequence[str]) -> tuple[list[Shape], float]:
    """Draws one example of each entry beside its name, and rows of meanings below them; returns the height, too."""
    starts = range(0, len(meanings), _MEANINGS_A_ROW)
    rows = ["      ".join(meanings[start : start + _MEANINGS_A_ROW]) for start in starts]
    n_rows = -(-len(entries) // len(_KEY_COLUMNS))
    height = _ROW * (n_rows + len(rows)) + 0.2
    shapes: list[Shape] = []
    for index, entry in enumerate(entries):
        x, y = _KEY_COLUMNS[index // n_rows], height - _ROW * (index % n_rows + 0.5)
        path = np.linspace(complex(x, y), complex(x + 0.93, y), 121)
        what = entry.removesuffix(" synapse")
        if what in COLORS:
            shapes += connection_shapes(path, what)
        elif "neuron" in entry:
            shapes += neuron_shapes(path.mean(), "", spiking="spiking" in entry, gated="gated" in entry)
        else:
            shapes += arrow_shapes(path[0], path[-1])
            rim = path[-1 if entry.startswith("input") else 0]
            shapes.append(Line(rim + np.array([-0.15j, 0.15j]), "black"))
        shapes.append(Words(entry, complex(x + 1.22, y), 9.0, "left"))
    for row, meaning in enumerate(reversed(rows)):
        shapes.append(Words(meaning, complex(_KEY_COLUMNS[0], 0.45 + _ROW * row), 9.0, "left"))
    return shapes, height

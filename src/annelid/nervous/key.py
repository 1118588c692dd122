"""The key below a drawn network: an example of each symbol that the network has, and what its labels stand for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from annelid.nervous.drawing import (
    COLORS,
    Line,
    Shape,
    Words,
    arrow_shapes,
    connection_shapes,
    effect_of,
    frame_of,
    meanings_of,
    neuron_shapes,
)
from annelid.nervous.wiring import Wiring

_MEANINGS_A_ROW = 4
_ROW, _COLUMNS, _UNIT_IN = 0.62, (0.56, 6.22, 11.33), 0.45  # rows and columns, in the key's own unit


def key_shapes(network: Wiring, above: Iterable[Shape], unit_in: float) -> list[Shape]:
    """Draws a key below other shapes: an example of each symbol beside its name, and what labels stand for.

    Args:
        network: The network.
        above: The shapes that it explains.
        unit_in: Length of a unit, inches.
    """
    shapes, height = _key_shapes(_key(network), meanings_of(network))
    left, _, bottom, _ = frame_of(above, unit_in)
    scale = _UNIT_IN / unit_in
    origin = complex(left, bottom - scale * height)
    return [
        replace(s, points=origin + scale * s.points)
        if isinstance(s, Line)
        else replace(s, place=origin + scale * s.place)
        for s in shapes
    ]


def _key(network: Wiring) -> list[str]:
    """What the key has to explain: only what the network has."""
    effects = {effect_of(network, link) for link in network.connections}
    neurons = network.neurons.values()
    key = ["neuron"] * any(not neuron.channels for neuron in neurons)
    key += ["neuron with gated channels"] * any(neuron.channels for neuron in neurons)
    key += [what if "gap" in what else f"{what} synapse" for what in COLORS if what in effects]
    return key + ["input current"] * bool(network.inputs) + ["output: potential read"] * bool(network.outputs)


def _key_shapes(entries: Sequence[str], meanings: Sequence[str]) -> tuple[list[Shape], float]:
    """Draws examples and rows of meanings in a unit of the key's own; returns the height, too."""
    starts = range(0, len(meanings), _MEANINGS_A_ROW)
    rows = [",  ".join(meanings[start : start + _MEANINGS_A_ROW]) for start in starts]
    n_rows = -(-len(entries) // len(_COLUMNS))
    height = _ROW * (n_rows + len(rows)) + 0.2
    shapes: list[Shape] = []
    for index, entry in enumerate(entries):
        x, y = _COLUMNS[index // n_rows], height - _ROW * (index % n_rows + 0.5)
        path = np.linspace(complex(x, y), complex(x + 0.93, y), 121)
        what = entry.removesuffix(" synapse")
        if what in COLORS:
            shapes += connection_shapes(path, what)
        elif "neuron" in entry:
            shapes += neuron_shapes(path.mean(), "", gated="gated" in entry)
        else:
            shapes += arrow_shapes(path[0], path[-1])
            rim = path[-1 if entry.startswith("input") else 0]
            shapes.append(Line(rim + np.array([-0.15j, 0.15j]), "black"))
        shapes.append(Words(entry, complex(x + 1.22, y), 9.0, "left"))
    for row, meaning in enumerate(reversed(rows)):
        shapes.append(Words(meaning, complex(_COLUMNS[0], 0.45 + _ROW * row), 9.0, "left"))
    return shapes, height

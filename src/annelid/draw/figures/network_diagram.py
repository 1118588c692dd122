"""The diagram of a network of neurons, drawn from the network itself; figure 6 of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.config import RunConfig
from annelid.draw.canvas import WIDTH_IN, canvas, plain, save
from annelid.draw.figures import RUN_FIGURES
from annelid.errors import RunFileError
from annelid.nervous import Network
from annelid.nervous.drawing import Shape, Words, frame_of, network_shapes
from annelid.nervous.key import key_shapes
from annelid.output import with_suffix
from annelid.simulation import Run, build_plant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SMALLEST_UNIT_IN, _SMALLEST_UNIT_WITH_NUMBERS_IN, _LARGEST_UNIT_IN = 0.5, 0.9, 1.0
_PAPER = {"facecolor": "w", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
NETWORK_SUFFIXES = (".png", ".pdf", ".svg")


def network_figure(network: Network, path: str | Path, *, conductances: bool = False) -> Path:
    """Draws any network, each neuron, connection, input and output once, with a key to its symbols.

    The keys of `annelid.nervous.drawing.network_shapes` are ids in an SVG file.

    Args:
        network: The network.
        path: File to write; its suffix chooses the format (``.png``, ``.pdf``, ``.svg``); a name without
            one becomes a ``.png``.
        conductances: Whether to write beside each connection how strong it is.

    Returns:
        The path written.

    Raises:
        RunFileError: The file has another suffix or cannot be written.
    """
    path = with_suffix(path, NETWORK_SUFFIXES, "a network", default=".png")
    shapes = network_shapes(network, strengths=conductances)
    left, right, _, _ = frame_of(shapes, _SMALLEST_UNIT_IN)
    smallest_in = _SMALLEST_UNIT_WITH_NUMBERS_IN if conductances else _SMALLEST_UNIT_IN
    unit_in = min(max(WIDTH_IN / (right - left), smallest_in), _LARGEST_UNIT_IN)
    shapes += key_shapes(network, shapes, unit_in)
    frame = left, right, bottom, top = frame_of(shapes, unit_in)
    with canvas(unit_in * (top - bottom), unit_in * (right - left)) as figure:
        figure.set_layout_engine("none")
        _paint(figure.add_axes((0.0, 0.0, 1.0, 1.0)), shapes, frame)
        return save(figure, path)


def network_of(config: RunConfig, neurons: Sequence[str]) -> Network | None:
    """Returns the network of these neurons that the controller of a configuration steps, or None without one."""
    network = getattr(config.controller.build(config, build_plant(config)), "network", None)
    return network if isinstance(network, Network) and list(network.neurons) == list(neurons) else None


def run_network_figure(run: Run, path: str | Path) -> Path:
    """Draws the network that a run's controller stepped, as `network_figure`.

    Raises:
        RunFileError: As of `network_figure`, or the run holds the potentials of no network.
    """
    neurons = [str(name) for name in run.data["neuron"].values] if "potential" in run.data else []
    # A network of a user's own, which the configuration does not describe, is in the file itself.
    text = run.data.attrs.get("network")
    network = Network.from_toml(text) if isinstance(text, str) else network_of(run.config, neurons) if neurons else None
    if network is None:
        raise RunFileError(f"{run.path} holds no network to draw: its controller is {run.config.controller.kind}")
    return network_figure(network, path)


RUN_FIGURES.add("network", run_network_figure)


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

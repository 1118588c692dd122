"""Which signals are plotted together: half-centres of all segments, the neurons of one, or activation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from annelid.nervous.drawing import by_segment, role_of

MOST_SEGMENTS = 4
"""With more than these the expansion neurons are left out of the first plot."""
SECONDS = 5.0
"""How far back the plots go, in simulated time."""


@dataclass(frozen=True)
class Curve:
    """One signal of a plot.

    Attributes:
        signal: Its name in the reel.
        label: Its name in the plot.
        number: Its place among the plot's colours.
        dashed: How it is drawn.
    """

    signal: str
    label: str
    number: int
    dashed: bool = False


@dataclass(frozen=True)
class Plot:
    """Curves that are drawn together.

    Attributes:
        title: What they are, with the unit.
        curves: The curves.
        n_colors: Among how many colours they choose.
        limits: Lower and upper end of the axis, or None for those of the curves.
    """

    title: str
    curves: tuple[Curve, ...]
    n_colors: int
    limits: tuple[float, float] | None = None


def plots_of(names: Sequence[str]) -> dict[str, Plot]:
    """Returns the plots that a worm's signals make, by the names that a user chooses from; the first is the default.

    Args:
        names: Signals of a reel: neurons as ``role_segment`` or plain names, then ``activation_1`` and so on.
    """
    muscles = [name for name in names if name.startswith("activation_")]
    segments, others = by_segment(name for name in names if name not in muscles)
    plots: dict[str, Plot] = {}
    if segments:
        plots["half-centres"] = _half_centres(segments)
        for segment, neurons in segments.items():
            labels = [role_of(neuron) for neuron in neurons]
            plots[f"neurons of segment {segment}"] = _plot(f"segment {segment}: potentials (mV)", neurons, labels)
    if others:
        plots["other neurons"] = _plot("potentials (mV)", others, others)
    numbers = [name.removeprefix("activation_") for name in muscles]
    plots["activation"] = _plot("activation of the muscles", muscles, numbers, (-0.05, 1.05))
    return plots


def _plot(title: str, signals: Sequence[str], labels: Sequence[str], limits: tuple[float, float] | None = None) -> Plot:
    curves = tuple(Curve(*names, i) for i, names in enumerate(zip(signals, labels, strict=True)))
    return Plot(title, curves, len(curves), limits)


def _half_centres(segments: dict[int, list[str]]) -> Plot:
    curves: list[Curve] = []
    for number, (segment, neurons) in enumerate(segments.items()):
        if f"contraction_{segment}" in neurons:
            curves.append(Curve(f"contraction_{segment}", str(segment), number))
        if f"expansion_{segment}" in neurons and len(segments) <= MOST_SEGMENTS:
            curves.append(Curve(f"expansion_{segment}", f"{segment} exp.", number, dashed=True))
    words = ", expansion dashed" if any(curve.dashed for curve in curves) else ""
    return Plot(f"contraction{words} (mV)", tuple(curves), len(segments))

"""The limit cycle of a worm: potentials round it, phase response curves and Floquet multipliers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from annelid.draw import canvas, panel_title, plot_path, save, segment_colors
from annelid_studies.limit_cycle.cycle import LimitCycle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROLES = {"contraction": "-", "expansion": "--", "sensory": "-.", "relay": ":"}
_LEAST = 1e-16
# Responses up to this are drawn to scale, greater ones by their logarithm, ms/mV.
_LINEAR_MS_PER_MV = 1.0


def limit_cycle_figure(main: LimitCycle, path: str | Path) -> Path:
    """Draws potentials and phase response of the first segment's neurons over a cycle, and the multipliers.

    Args:
        main: The limit cycle, drawn over its phase.
        path: File to write: ``.png``, ``.pdf`` or ``.svg``; a name without a suffix becomes a ``.png``.
    """
    path = plot_path(path)
    with canvas(6.6) as figure:
        orbit, response, multipliers = figure.subplots(3, 1, height_ratios=[1.0, 1.2, 1.0])
        _neurons(orbit, main, main.state)
        panel_title(orbit, f"Segment 1, period {1e3 * main.period_s:.1f} ms")
        orbit.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(_ROLES), borderaxespad=0.1)
        orbit.set_ylabel("potential (mV)")
        _neurons(response, main, 1e3 * main.phase_response)
        panel_title(response, "Phase response: advance of the cycle by a small kick of each potential")
        response.set_ylabel("advance (ms/mV)")
        response.set_yscale("symlog", linthresh=_LINEAR_MS_PER_MV)
        response.set_xlabel("phase of the cycle, from the section (dotted lines: a sensor or a synapse switches)")
        for axes in (orbit, response):
            axes.set_xlim(0.0, 1.0)
            for time in main.switch_time_s:
                axes.axvline(time / main.period_s, color="0.8", linestyle=":", linewidth=0.5, zorder=0)
        _magnitudes(multipliers, main)
        return save(figure, path)


def _neurons(axes: Axes, cycle: LimitCycle, values: np.ndarray) -> None:
    phase = cycle.time_s / cycle.period_s
    for color, (role, style) in zip(segment_colors(len(_ROLES)), _ROLES.items(), strict=True):
        label = f"{role}_1"
        if label in cycle.labels:
            axes.plot(phase, values[:, cycle.labels.index(label)], style, color=color, label=role)


def _magnitudes(axes: Axes, cycle: LimitCycle) -> None:
    sizes = np.maximum(np.abs(cycle.multipliers), _LEAST)
    axes.plot(np.arange(1, len(sizes) + 1), sizes, "o", color=segment_colors(3)[0], markersize=4.0)
    axes.axhline(1.0, color="0.35", linestyle=":", linewidth=1.0)
    axes.set(yscale="log", ylim=(_LEAST / 3.0, 30.0), ylabel="magnitude", xlabel="Floquet multiplier, by magnitude")
    axes.locator_params(axis="x", integer=True)
    panel_title(axes, "Floquet multipliers")

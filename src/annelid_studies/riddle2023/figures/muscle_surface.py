"""Figure 5: the force-length-velocity relation of MuJoCo's muscle, as the engine computes it."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from annelid.body import Rings, muscle_force
from annelid.draw import canvas, panel_title, save_both, segment_colors
from annelid.morphology import Array
from annelid_studies.riddle2023.figures import caption

SCALED_RANGE = (0.75, 1.05)
"""Scaled lengths between which a ring's operating range lies: MuJoCo's default."""
RING_LENGTHS_M = (0.30, 0.96)
"""Lengths between which the paper's rings work, m: contracted, and at rest."""
SETTLED_FORCE_N = 2.5
"""Force at which the paper's contracted rings settle, N."""

_BLUE, _ORANGE, _GREEN, _ = segment_colors(4)
_CUTS = (
    (-0.75, (0, (1, 1.2)), _GREEN),
    (-0.3, (0, (4, 1.5)), _ORANGE),
    (0.0, "-", "0.1"),
    (0.3, (0, (6, 1.5, 1, 1.5)), _BLUE),
)
"""Velocities of the cuts, with their lines and colours."""


def engine_flv(lengths: ArrayLike, velocities: ArrayLike, rings: Rings, activation: float = 1.0) -> Array:
    """Calls the engine's muscle for its force as a function of scaled length and velocity, as `muscle_force`."""
    own = rings.minimum_length, rings.maximum_length, rings.maximum_velocity, rings.passive_peak, rings.lengthening_peak
    parameters = np.array([*SCALED_RANGE, 1.0, 1.0, *own])
    # With this length range a scaled length is a length in metres.
    reach = np.array(SCALED_RANGE)

    def force(length: float, velocity: float) -> float:
        gain = mujoco.mju_muscleGain(length, velocity, reach, 1.0, parameters)
        return -(activation * gain + mujoco.mju_muscleBias(length, reach, 1.0, parameters))

    return np.vectorize(force, otypes=[float])(lengths, velocities)


def scaled_length(ring_length_m: ArrayLike, length_range_m: tuple[float, float]) -> Array:
    """Converts ring lengths, m, into the muscle's: MuJoCo maps the operating range of a ring to `SCALED_RANGE`."""
    (low_m, high_m), (low, high) = length_range_m, SCALED_RANGE
    return low + (np.asarray(ring_length_m, float) - low_m) * (high - low) / (high_m - low_m)


def largest_difference(rings: Rings) -> float:
    """Returns the largest difference between the engine and the closed form over the figure's range, F0."""
    length, velocity = np.meshgrid(*_grids(rings, 121))
    return float(np.abs(engine_flv(length, velocity, rings) - muscle_force(length, velocity, rings)).max())


def figure_5_muscle_surface(rings: Rings, stem: Path, n_segments: int = 3) -> str:
    """Draws the engine's force over length and velocity, and cuts through it beside the documented formula.

    Returns the caption, with the numbers of this muscle; each ring may have an operating range of its own.
    """
    ranges = rings.length_ranges(n_segments)
    scaled = np.array([scaled_length(RING_LENGTHS_M, one) for one in ranges])
    # At least one of the rings works between these scaled lengths.
    low, high = float(scaled[:, 0].min()), float(scaled[:, 1].max())
    with canvas(3.5) as figure:
        surface, cuts = figure.subplots(1, 2, width_ratios=[1.0, 1.05])
        _draw_surface(surface, rings, (low, high))
        _draw_cuts(cuts, rings, (low, high))
        save_both(figure, stem)
    optimal = [(longest - shortest) / (SCALED_RANGE[1] - SCALED_RANGE[0]) for shortest, longest in ranges]
    peak_N = max(rings.forces(n_segments))
    grid = np.linspace(rings.minimum_length, 1.0, 20_001)
    settled = grid[np.searchsorted(engine_flv(grid, 0.0, rings), SETTLED_FORCE_N / peak_N)]
    settled_m = [far - (SCALED_RANGE[1] - settled) * unit for (_, far), unit in zip(ranges, optimal, strict=True)]
    found = {
        "difference": largest_difference(rings),
        "passive": 1.5 * rings.passive_peak,
        "rings": rings,
        "optimal_m": optimal,
        "work_m": RING_LENGTHS_M,
        "low": low,
        "high": high,
        "settled_N": SETTLED_FORCE_N,
        "settled": settled,
        "settled_m": settled_m,
        "peak_N": peak_N,
    }
    return caption(5, found)


def _draw_surface(axes: Axes, rings: Rings, working: tuple[float, float]) -> None:
    length, velocity = np.meshgrid(*_grids(rings, 141))
    force = engine_flv(length, velocity, rings)
    top = 0.2 * np.ceil(force.max() / 0.2)
    levels = np.arange(0.0, top + 0.1, 0.2)
    filled = axes.contourf(length, velocity, force, levels, cmap="cividis")
    axes.contour(length, velocity, force, levels[1:], colors="w", linewidths=0.6)
    for bound in working:
        axes.axvline(bound, color="w", linewidth=1.2, linestyle=(0, (4, 3)))
    axes.text(sum(working) / 2.0, -0.85 * rings.maximum_velocity, "rings\nwork here", color="w", ha="center")
    axes.grid(visible=False)
    axes.set_xlabel("length ($L_0$)")
    axes.set_ylabel("velocity ($L_0$/s), negative: shortening")
    axes.figure.colorbar(filled, ax=axes, label="force ($F_0$)", pad=0.02, ticks=levels[::2])
    panel_title(axes, "a) full activation, engine")


def _draw_cuts(axes: Axes, rings: Rings, working: tuple[float, float]) -> None:
    lengths, _ = _grids(rings, 301)
    sparse = lengths[::15]
    axes.axvspan(*working, color="0.9", zorder=0)
    for velocity, dashes, color in _CUTS:
        label = f"${velocity:+.2f}\\ L_0$/s" if velocity else "isometric"
        axes.plot(lengths, engine_flv(lengths, velocity, rings), color=color, linestyle=dashes, label=label)
        axes.plot(sparse, muscle_force(sparse, velocity, rings), "o", color=color, markersize=3, fillstyle="none")
    axes.plot(lengths, engine_flv(lengths, 0.0, rings, 0.0), color="0.45", linewidth=0.9, label="passive")
    axes.plot([], [], "o", color="0.2", markersize=3, fillstyle="none", label="documented formula")
    axes.set_xlim(lengths[0], lengths[-1])
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("length ($L_0$)")
    axes.set_ylabel("force ($F_0$)")
    axes.legend(loc="upper left")
    panel_title(axes, "b) cuts at constant velocity")


def _grids(rings: Rings, n: int) -> tuple[Array, Array]:
    """Lengths a little beyond those of the active force, and velocities up to the largest, n of each."""
    lengths = np.linspace(rings.minimum_length - 0.08, rings.maximum_length, n)
    return lengths, np.linspace(-rings.maximum_velocity, 0.5 * rings.maximum_velocity, n)

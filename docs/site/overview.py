"""The picture of the whole instrument: what goes in, what is computed, what comes out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from annelid.draw import canvas, line_looks, save
from annelid.simulation import Run
from annelid_studies.riddle2023.figures.renderings import ISOMETRIC_DEG, recorded_posture, show_worm

INK, EDGE, PALE = "black", "0.35", "0.955"
WIDTH, HEIGHT = 7.2, 4.9  # inches, in which places are given, too
BOX_WIDTH, BOX_HEIGHT = 2.0, 0.92
COLUMNS = (0.05, 5.15)  # left edges of both columns of boxes
MIDDLE = (2.5, 1.42, 2.06, 2.98)  # left, bottom, width and height of the run
ROWS = (3.5, 2.45, 1.4, 0.1)  # lower edges of the boxes
IN = (
    ("Worm", "a preset or your numbers:\nsegments, strands, muscles;\nor your robot as MJCF"),
    ("Arena", "floor, slope, steps, rough\nground, pipes; or your own\nscene as MJCF"),
    ("Controller", "synthetic nervous system,\ntimed wave, oscillators; or\nyour network, your Python"),
    ("Your robot's log", "a CSV file of lengths,\nplaces or forces"),
)
OUT = (
    ("See it", "table, figures, video,\nlive view in the browser", "show, draw, view"),
    ("Use it elsewhere", "CSV, MATLAB, NWB, MJCF,\nLEMS; Gymnasium", "export"),
    ("On your robot", "controller as C firmware,\nservos in the loop", "export-network, loop"),
    ("Compare, calibrate", "errors of the model, and\nmaterial that fits", "compare, calibrate"),
)


def overview_picture(run: Run, time_s: float, path: Path) -> Path:
    """Draws it with a moment and the potentials of a run."""
    with canvas(HEIGHT, WIDTH) as figure:
        figure.set_layout_engine("none")
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0.0, WIDTH), ylim=(0.0, HEIGHT))
        axes.axis("off")
        left, bottom, width, height = MIDDLE
        for column, words in ((COLUMNS[0], "What goes in"), (left, "One run, or many"), (COLUMNS[1], "What comes out")):
            across = BOX_WIDTH if column in COLUMNS else width
            axes.text(column + across / 2, HEIGHT - 0.13, words, ha="center", va="center", size=11, weight="bold")
        for row, (title, text) in zip(ROWS, IN, strict=True):
            _box(axes, (COLUMNS[0], row), title, text)
        for row, (title, text, commands) in zip(ROWS, OUT, strict=True):
            _box(axes, (COLUMNS[1], row), title, text, commands)
        # Cards behind the run: many runs.
        for shift in (0.14, 0.07):
            _frame(axes, (left + shift, bottom - shift), width, height, "white")
        _frame(axes, (left, bottom), width, height, PALE)
        middle = left + width / 2
        _worm(axes, run, time_s)
        _traces(axes, run)
        axes.text(middle, bottom + height - 0.14, "body on its ground (MuJoCo)", ha="center", va="center", size=8)
        axes.text(middle, bottom + 0.3, "nervous system", ha="center", va="center", size=8)
        axes.text(middle, bottom + 0.13, "run, sweep, tune", ha="center", va="center", size=8, family="monospace")
        down, up = (middle - 0.1, 2.97), (middle + 0.3, 2.97)
        _arrow(axes, down, (down[0], 2.6))
        _arrow(axes, (up[0], 2.6), up)
        axes.text(down[0] - 0.07, 2.785, "lengths, touch", ha="right", va="center", size=8)
        axes.text(up[0] + 0.06, 2.785, "activation", ha="left", va="center", size=8)
        for row in ROWS[:3]:
            level = row + BOX_HEIGHT / 2
            _arrow(axes, (COLUMNS[0] + BOX_WIDTH + 0.04, level), (left - 0.04, level))
            _arrow(axes, (left + width + 0.2, level), (COLUMNS[1] - 0.04, level))
        level = ROWS[3] + BOX_HEIGHT / 2
        _arrow(axes, (COLUMNS[0] + BOX_WIDTH + 0.04, level), (COLUMNS[1] - 0.04, level))
        _arrow(axes, (middle, bottom - 0.2), (middle, level + 0.02))
        return save(figure, path)


def _box(axes: Axes, corner: tuple[float, float], title: str, text: str, commands: str = "") -> None:
    _frame(axes, corner, BOX_WIDTH, BOX_HEIGHT, "white")
    x, y = corner[0] + 0.1, corner[1] + BOX_HEIGHT - 0.1
    axes.text(x, y, title, va="top", size=9.5, weight="bold")
    axes.text(x, y - 0.22, text, va="top", size=8, linespacing=1.25)
    axes.text(x, corner[1] + 0.08, commands, va="bottom", size=8, family="monospace")


def _frame(axes: Axes, corner: tuple[float, float], width: float, height: float, face: str) -> None:
    shape: Any = {"boxstyle": "round,pad=0,rounding_size=0.08", "facecolor": face, "edgecolor": EDGE, "linewidth": 1.0}
    axes.add_patch(FancyBboxPatch(corner, width, height, **shape))


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    look: Any = {
        "arrowstyle": "-|>",
        "mutation_scale": 11.0,
        "color": INK,
        "linewidth": 1.2,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    axes.add_patch(FancyArrowPatch(start, end, **look))


def _inset(axes: Axes, bottom: float, height: float) -> Axes:
    left, _, width, _ = MIDDLE
    return axes.inset_axes((left + 0.08, bottom, width - 0.16, height), transform=axes.transData)


def _worm(axes: Axes, run: Run, time_s: float) -> None:
    inside = _inset(axes, 3.0, 1.22)
    show_worm(inside, recorded_posture(run, time_s), ISOMETRIC_DEG)


def _traces(axes: Axes, run: Run) -> None:
    """The contraction neuron of every segment."""
    inside = _inset(axes, 1.85, 0.7)
    inside.axis("off")
    for segment, look in enumerate(line_looks(run.config.body.n_segments), start=1):
        potential = run.data["potential"].sel(neuron=f"contraction_{segment}")
        inside.plot(run.data["time"].values, potential.values, **look, linewidth=1.1)

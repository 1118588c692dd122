"""Slip in pictures: what feedback saves over frictions, and how well slip is detected."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from annelid.draw.canvas import canvas, save_both
from annelid.draw.lines import draw_lines
from annelid.draw.style import panel_title
from annelid.morphology import Array

_LOSSES = (2, 5, 10, 20, 50, 100)


def feedback_figure(
    lines: Mapping[str, tuple[Array, Array, Array]], tuned_at: Collection[float], stem: str | Path
) -> Path:
    """Draws loss per metre and speed against friction.

    Args:
        lines: By the kind of feedback: frictions, loss per way (J/m) and speed (m/s), each ``(n,)``.
        tuned_at: Frictions that get a dotted line.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    with canvas(3.0) as figure:
        cost, pace = figure.subplots(1, 2)
        for axes in (cost, pace):
            axes.set_xlabel("friction of the floor" + (" (dotted: tuned here)" if tuned_at else ""))
            for friction in tuned_at:
                axes.axvline(friction, color="0.35", linewidth=0.8, linestyle=":")
        draw_lines(cost, {name: (friction, loss) for name, (friction, loss, _) in lines.items()}, markersize=4)
        draw_lines(pace, {name: (friction, 100 * speed) for name, (friction, _, speed) in lines.items()}, markersize=4)
        panel_title(cost, "What slip costs")
        cost.set_ylabel("work lost to friction (J/m)")
        cost.set_yscale("log")
        cost.set_yticks(_LOSSES, [f"{loss}" for loss in _LOSSES])
        cost.minorticks_off()
        cost.legend(title="feedback")
        panel_title(pace, "How fast it is")
        pace.set_ylabel("speed (cm/s)")
        pace.set_ylim(bottom=0.0)
        return save_both(figure, stem)


def detector_figure(curves: Mapping[str, tuple[Array, Array]], chosen: tuple[float, float], stem: str | Path) -> Path:
    """Draws precision against recall.

    Args:
        curves: By the name of the run: recall and precision, each ``(n_thresholds,)``.
        chosen: Recall and precision of all runs together at the detector's own threshold.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    with canvas(3.6) as figure:
        axes = figure.subplots()
        draw_lines(axes, curves, markers=False, linewidth=1.1)
        axes.plot(*chosen, marker="o", markersize=7, color="black", linestyle="none", label="all runs, as it is set")
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(0.0, 1.02)
        axes.set_xlabel("recall")
        axes.set_ylabel("precision")
        axes.legend(loc="lower left")
        return save_both(figure, stem)

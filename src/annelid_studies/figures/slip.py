"""Slip in pictures: what feedback saves over frictions, and how well slip is detected."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from annelid.draw.canvas import canvas, save_both
from annelid.draw.style import panel_title, segment_colors
from annelid.morphology import Array

_MARKERS = "os^Dv"
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
        panels = figure.subplots(1, 2)
        for axes, title, label in zip(
            panels,
            ("What slip costs", "How fast it is"),
            ("work lost to friction (J/m)", "speed (cm/s)"),
            strict=True,
        ):
            panel_title(axes, title)
            axes.set_xlabel("friction of the floor" + (" (dotted: tuned here)" if tuned_at else ""))
            for friction in tuned_at:
                axes.axvline(friction, color="0.35", linewidth=0.8, linestyle=":")
            axes.set_ylabel(label)
        for (name, (friction, loss, speed)), color, marker in zip(
            lines.items(), segment_colors(len(lines)), _MARKERS, strict=False
        ):
            panels[0].plot(friction, loss, color=color, marker=marker, markersize=4, label=name)
            panels[1].plot(friction, 100.0 * speed, color=color, marker=marker, markersize=4)
        panels[0].set_yscale("log")
        panels[0].set_yticks(_LOSSES, [f"{loss}" for loss in _LOSSES])
        panels[0].minorticks_off()
        panels[1].set_ylim(bottom=0.0)
        panels[0].legend(title="feedback")
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
        for (name, (recall, precision)), color in zip(curves.items(), segment_colors(len(curves)), strict=True):
            axes.plot(recall, precision, color=color, label=name, linewidth=1.1)
        axes.plot(*chosen, marker="o", markersize=7, color="black", linestyle="none", label="all runs, as it is set")
        axes.set_xlim(0.0, 1.0)
        axes.set_ylim(0.0, 1.02)
        axes.set_xlabel("recall")
        axes.set_ylabel("precision")
        axes.legend(loc="lower left")
        return save_both(figure, stem)

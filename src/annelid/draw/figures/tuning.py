"""A search for a gait: how its best rose over the trials, or its Pareto front."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from annelid.draw.canvas import canvas, save_both
from annelid.draw.style import segment_colors

_DOT, _BEST, _START, _ = segment_colors(4)


@dataclass(frozen=True)
class Mark:
    """One trial.

    Attributes:
        number: Its number, negative for the gait that the search starts from.
        values: Its value of each objective.
        walks: Whether it walks.
    """

    number: int
    values: tuple[float, ...]
    walks: bool


def progress_figure(marks: Sequence[Mark], label: str, more_is_better: bool, stem: str | Path) -> Path:
    """Draws every trial's value and the best so far over the trials' numbers.

    Args:
        marks: The trials; those that do not walk are drawn as ticks on the lower edge.
        label: The objective with its unit.
        more_is_better: Whether it is.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    walking = [mark for mark in marks if mark.walks and mark.number >= 0]
    failed = [mark.number for mark in marks if not mark.walks and mark.number >= 0]
    numbers = np.array([mark.number for mark in walking])
    values = np.array([mark.values[0] for mark in walking])
    with canvas(3.0) as figure:
        axes = figure.subplots()
        axes.plot(numbers, values, "o", color=_DOT, markersize=3.5, label="a gait")
        if walking:
            best = np.maximum.accumulate(values) if more_is_better else np.minimum.accumulate(values)
            axes.step(numbers, best, where="post", color=_BEST, label="best so far")
        for mark in marks:
            if mark.number < 0 and mark.walks:
                axes.axhline(mark.values[0], color=_START, linestyle=(0, (4, 3)), label="start")
        if failed:
            floor = axes.get_xaxis_transform()
            axes.plot(failed, np.zeros(len(failed)), "|", color="0.5", transform=floor, clip_on=False, label="no gait")
        axes.set_xlabel("trial")
        axes.set_ylabel(label)
        figure.legend(loc="outside upper center", ncols=4)
        return save_both(figure, stem)


def pareto_figure(
    marks: Sequence[Mark], front: Collection[int], labels: tuple[str, str], more_is_better: bool, stem: str | Path
) -> Path:
    """Draws one objective against the other, with the front that no trial beats in both: steps over what was reached.

    Args:
        marks: The trials; those that do not walk are left out.
        front: Numbers of the trials on the front.
        labels: The objectives with their units.
        more_is_better: Whether it is, of the first objective.
        stem: Path without suffix; ``.svg`` and ``.png`` are written.

    Returns:
        The path of the picture in pixels.

    Raises:
        RunFileError: A file cannot be written.
    """
    walking = [mark for mark in marks if mark.walks]
    on_front = sorted((mark for mark in walking if mark.number in front), key=lambda mark: mark.values)
    with canvas(3.6) as figure:
        axes = figure.subplots()
        tuned = [mark.values for mark in walking if mark.number >= 0]
        axes.plot(*_columns(tuned), "o", color="0.65", markersize=3.5, label="a gait")
        steps = "steps-pre" if more_is_better else "steps-post"
        reached = _columns([mark.values for mark in on_front])
        axes.plot(*reached, "o-", drawstyle=steps, color=_BEST, markersize=4.5, label="front, with numbers of trials")
        for mark, x, y in zip(on_front, *reached, strict=True):
            axes.annotate(str(mark.number), (x, y), (5, -9), textcoords="offset points", fontsize=7, color=_BEST)
        axes.margins(0.08)
        begun = [mark.values for mark in walking if mark.number < 0]
        axes.plot(*_columns(begun), "D", color=_START, markersize=7, label="start")
        axes.set_xlabel(labels[0])
        axes.set_ylabel(labels[1])
        figure.legend(loc="outside upper center", ncols=3)
        return save_both(figure, stem)


def _columns(rows: Sequence[tuple[float, ...]]) -> tuple[list[float], list[float]]:
    return [row[0] for row in rows], [row[1] for row in rows]

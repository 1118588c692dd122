"""Axial springs that push and pull, as in the authors' files, or only pull, as the paper says."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from annelid.draw import canvas, save_both, segment_colors
from annelid.experiment import Store
from annelid.morphology import Array
from annelid.simulation import open_run
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Findings, examination, findings
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, WORMS, Columns, Point, Reading
from annelid_studies.riddle2023.words import CM
from annelid_studies.tables import tabulated
from annelid_studies.worms import Effort

BILATERAL, TENSION_ONLY = 0.0, 1.0
_SPRINGS = {BILATERAL: "bilateral", TENSION_ONLY: "tension only"}


def _points(effort: Effort) -> list[Point]:
    worms = WORMS if effort == "full" else WORMS[1:]
    changes = {BILATERAL: None, TENSION_ONLY: {"body.springs.tension_only": True}}
    return [Point(worm, springs, worm.case(own)) for worm in worms for springs, own in changes.items()]


def _reach(one: Reading) -> tuple[Array, Array]:
    """Shortest and longest mean of each segment's springs against rest, m, each ``(n_segments,)``."""
    data = open_run(one.closed.path).data
    above_rest = (data["stretch_length"].values - data["stretch_rest_length"].values).mean(axis=2)
    return above_rest.min(axis=0), above_rest.max(axis=0)


def _examine(store: Store, effort: Effort, stem: Path) -> Findings:
    readings = design.read(_points(effort), store)
    reaches = {one: _reach(one) for one in readings}
    _draw(reaches, stem)
    bilateral = dict(zip(readings[1::2], readings[::2], strict=True))
    pulling = list(bilateral)
    lost = [f"{one.worm.label} ({words.rhythm(one.rhythm)})" for one in pulling if not one.walks]
    swing = {one: words.in_cm(one.walked_helix_m[0]) for one in readings}
    below = {one: words.in_cm(-shortest_m.min()) for one, (shortest_m, _) in reaches.items()}
    swings = words.by_worm(pulling, lambda one: f"{swing[one]} in place of {swing[bilateral[one]]} cm")
    shorten = words.listed(
        f"{below[one]} cm (bilateral: {below[both]} cm; {one.worm.label})" for one, both in bilateral.items()
    )
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "springs": lambda one: _SPRINGS[one.value],
        "rhythm": lambda one: words.rhythm(one.rhythm),
        "first helix, peak to peak (cm)": lambda one: words.all_in_cm(one.walked_helix_m),
        "deficit (%)": lambda one: words.in_percent(one.closed.summary.middle_deficit),
        "mean of springs, longest above rest (cm)": lambda one: words.all_in_cm(reaches[one][1]),
        "shortest below rest (cm)": lambda one: words.all_in_cm(-reaches[one][0]),
        "median force (N)": lambda one: words.in_unit(one.force_N),
    }
    found = {
        "walking": words.labels(one for one in pulling if one.walks),
        "lost": words.listed(lost),
        "swings": swings,
        "shorten": shorten,
        "runs": len(readings),
        "papers": PAPERS.label,
    }
    remarks = ["quick"] if effort == "quick" else []
    return findings("springs", found, tabulated(readings, columns), remarks)


def _draw(reaches: Mapping[Reading, tuple[Array, Array]], stem: Path) -> None:
    width = 0.24
    with canvas(3.5) as figure:
        axes = figure.subplots()
        centers = [1.0 * i + 0.35 * (i // 2) for i in range(len(reaches))]
        for center, (one, (shortest_m, longest_m)) in zip(centers, reaches.items(), strict=True):
            for i, color in enumerate(segment_colors(len(longest_m))):
                low, high = CM * shortest_m[i], CM * longest_m[i]
                look: dict[str, Any] = {"facecolor": "white", "hatch": "/////"} if one.value else {"facecolor": color}
                x = center + (i - (len(longest_m) - 1) / 2) * (width + 0.03)
                axes.bar(x, high - low, width, low, edgecolor=color, linewidth=1.2, **look)
        axes.axhline(0.0, color="0.3", linewidth=0.9)
        axes.use_sticky_edges = False
        axes.margins(y=0.06)
        axes.set_ylabel("elongation above rest, from\nshortest to longest (cm)")
        rhythms = [words.rhythm(one.rhythm).replace(", ", ",").replace(",", "\n", 1) for one in reaches]
        names = [f"{_SPRINGS[one.value]}\n{rhythm}" for one, rhythm in zip(reaches, rhythms, strict=True)]
        axes.set_xticks(centers, names, fontsize=8.0)
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False, axis="x")
        top = axes.get_ylim()[1]
        for center, one in zip(centers, reaches, strict=True):
            if one.value == BILATERAL:
                axes.text(center + 0.5, top, one.worm.label, ha="center", va="bottom")
        design.legend_below(figure, design.segment_handles())
        save_both(figure, stem)


SPRINGS = examination("springs", lambda effort: design.cases_of(_points(effort)), _examine)

"""Axial springs that push and pull, as in the authors' files, or only pull, as the paper says."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import segment_colors
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid.simulation.runfile import open_run
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.side_by_side import (
    CM,
    PAPERS,
    WORMS,
    Worm,
    all_in_cm,
    in_cm,
    in_percent,
    in_unit,
    kept,
    legend_below,
    listed,
    rhythm_words,
    segment_handles,
    walked_elongation,
)

_FIELD = "body.springs.tension_only"


def _case(worm: Worm, tension_only: bool) -> Case:
    return worm.case({_FIELD: True} if tension_only else None)


def _worms(effort: Effort) -> Sequence[Worm]:
    return WORMS if effort == "full" else WORMS[1:]


def _cases(effort: Effort) -> Sequence[Case]:
    return [_case(worm, tension_only) for worm in _worms(effort) for tension_only in (False, True)]


class _Walk(NamedTuple):
    """One closed-loop run: shortest and longest mean of each segment's springs against rest, m."""

    worm: Worm
    tension_only: bool
    outcome: Outcome
    shortest_m: NDArray[np.float64]
    longest_m: NDArray[np.float64]

    @property
    def springs(self) -> str:
        return "tension only" if self.tension_only else "bilateral"


def _walk(results: Results, worm: Worm, tension_only: bool) -> _Walk:
    outcome = results[_case(worm, tension_only)]
    data = open_run(outcome.path).data
    above_rest = (data["stretch_length"].values - data["stretch_rest_length"].values).mean(axis=2)
    return _Walk(worm, tension_only, outcome, above_rest.min(axis=0), above_rest.max(axis=0))


def _examine(results: Results, effort: Effort, stem: Path) -> Findings:
    walks = [_walk(results, worm, tension_only) for worm in _worms(effort) for tension_only in (False, True)]
    pairs = list(zip(walks[::2], walks[1::2], strict=True))
    _draw(walks, stem)
    numbers: dict[str, float | str | None] = {}
    for walk in walks:
        kind = f"{'tension_only' if walk.tension_only else 'bilateral'}_{walk.worm.name}"
        numbers[f"verdict_{kind}"] = rhythm_words(walk.outcome.rhythm)
        numbers[f"elongation_first_{kind}_m"] = kept(walked_elongation(walk.outcome, first_helix=True)[0])
        numbers[f"undershoot_{kind}_m"] = kept(-walk.shortest_m.min())
    kept_order = [only for _, only in pairs if only.outcome.rhythm.is_one_wave]
    lost_order = [only for _, only in pairs if not only.outcome.rhythm.is_one_wave]
    sentences = []
    if kept_order:
        sentences.append(
            f"With springs that only pull, {_names(kept_order)} still {_verb(kept_order, 'walks', 'walk')} in the "
            "order 1-2-3."
        )
    if lost_order:
        fates = [f"{w.worm.label} ({rhythm_words(w.outcome.rhythm)})" for w in lost_order]
        sentences.append(
            f"With springs that only pull, {listed(fates)} {_verb(lost_order, 'does', 'do')} not keep the order 1-2-3."
        )
    swings = [f"{in_cm(_swing(only))} in place of {in_cm(_swing(both))} cm ({both.worm.label})" for both, only in pairs]
    sentences.append(f"The spring on the first helix of segment 1 then swings over {listed(swings)}.")
    sentences.append(
        "Segments shorten below their rest length by up to "
        + listed(
            [
                f"{in_cm(-only.shortest_m.min())} cm (bilateral: {in_cm(-both.shortest_m.min())} cm; {both.worm.label})"
                for both, only in pairs
            ]
        )
        + "."
    )
    remarks = []
    if effort == "quick":
        remarks.append(f"The quick effort leaves out {PAPERS.label}.")
    return Findings(
        answer=" ".join(sentences),
        caption=(
            f"Closed loop, 5 s, one run a group, {len(walks)} runs: from the shortest to the longest that each segment "
            "becomes (mean of its six springs, against rest), and below each group its springs and rhythm. Hatched: "
            "springs that only pull."
        ),
        table=_table(walks),
        remarks=remarks,
        numbers=numbers,
    )


def _swing(walk: _Walk) -> float:
    return float(walked_elongation(walk.outcome, first_helix=True)[0])


def _names(walks: Sequence[_Walk]) -> str:
    return listed([walk.worm.label for walk in walks])


def _verb(walks: Sequence[_Walk], one: str, many: str) -> str:
    return one if len(walks) == 1 and walks[0].worm is PAPERS else many


def _table(walks: Sequence[_Walk]) -> Table:
    rows = []
    for walk in walks:
        summary = walk.outcome.summary
        rows.append(
            [
                walk.worm.label,
                walk.springs,
                rhythm_words(walk.outcome.rhythm),
                all_in_cm(walked_elongation(walk.outcome, first_helix=True)),
                in_percent(summary.middle_deficit),
                all_in_cm(walk.longest_m),
                all_in_cm(-walk.shortest_m),
                in_unit(summary.contraction_force_median_N),
            ]
        )
    header = [
        "worm",
        "springs",
        "rhythm",
        "first helix, peak to peak (cm)",
        "deficit (%)",
        "mean of springs, longest above rest (cm)",
        "shortest below rest (cm)",
        "median force (N)",
    ]
    return Table(header, rows)


def _draw(walks: Sequence[_Walk], stem: Path) -> None:
    n_segments = len(walks[0].longest_m)
    colors = segment_colors(n_segments)
    width = 0.24
    with canvas(3.5) as figure:
        axes = figure.subplots()
        centers = [1.0 * i + 0.35 * (i // 2) for i in range(len(walks))]
        for center, walk in zip(centers, walks, strict=True):
            look: dict[str, Any]
            for i, color in enumerate(colors):
                low, high = CM * walk.shortest_m[i], CM * walk.longest_m[i]
                look = {"facecolor": "white", "hatch": "/////"} if walk.tension_only else {"facecolor": color}
                x = center + (i - (n_segments - 1) / 2) * (width + 0.03)
                axes.bar(x, high - low, width, low, edgecolor=color, linewidth=1.2, **look)
        axes.axhline(0.0, color="0.3", linewidth=0.9)
        axes.use_sticky_edges = False
        axes.margins(y=0.06)
        axes.set_ylabel("elongation above rest, from\nshortest to longest (cm)")
        axes.set_xticks(
            centers,
            [
                f"{walk.springs}\n{rhythm_words(walk.outcome.rhythm).replace(', ', ',').replace(',', chr(10), 1)}"
                for walk in walks
            ],
            fontsize=8.0,
        )
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False, axis="x")
        top = axes.get_ylim()[1]
        for k in range(0, len(walks), 2):
            axes.text((centers[k] + centers[k + 1]) / 2, top, walks[k].worm.label, ha="center", va="bottom")
        legend_below(figure, segment_handles(n_segments))
        save_both(figure, stem)


SPRINGS = Examination(
    name="springs",
    title="Springs that push or only pull",
    question="The paper says that its axial springs act only in tension; the authors' files have them act both ways. "
    "Does it matter?",
    cases=_cases,
    examine=_examine,
)

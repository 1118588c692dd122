"""Friction of the floor: travel, elongation, the middle segment's deficit and the rhythm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.elongation import middle_deficit
from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import panel_title
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.side_by_side import (
    CM,
    PAPERS,
    SPRUNG,
    TIGHT,
    WORMS,
    Worm,
    all_in_cm,
    capitalised,
    draw_rhythms,
    held_elongation,
    in_cm,
    in_percent,
    kept,
    legend_below,
    listed,
    look_handle,
    number,
    parameter_ticks,
    rhythm_words,
    span,
    walked_elongation,
)
from annelid_studies.worms import one_after_the_other, rods

FRICTIONS = (0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5)
FEW = (0.05, 0.2, 0.4, 1.0, 1.5)
"""Of the paper's chain, which takes longest."""
SLIPPERY, PAPERS_FRICTION = 0.05, 1.0
TIMESTEPS_S = (0.005, 0.002)
IMPEDANCE_RATIOS = (100.0, 1000.0)
NEGLIGIBLE_M = 0.01
"""Travel below this, a fiftieth of the body in two cycles, is called negligible."""

_FIELD = "arena.friction"
_OPEN = (SPRUNG, TIGHT)


def frictions_of(worm: Worm, effort: Effort) -> Sequence[float]:
    """Returns the frictions at which a worm is walked."""
    if effort == "full":
        return FEW if worm is PAPERS else FRICTIONS
    return (PAPERS_FRICTION,) if worm is PAPERS else (SLIPPERY, 0.4, PAPERS_FRICTION)


def _walking(worm: Worm, friction: float) -> Case:
    return worm.case({_FIELD: friction})


def _held(worm: Worm, friction: float) -> Case:
    return worm.case({**one_after_the_other(), _FIELD: friction})


def _solved(timestep_s: float, ratio: float) -> Case:
    return rods({"clock.physics_timestep_s": timestep_s, "body.formulation.friction_impedance_ratio": ratio})


def _solutions(effort: Effort) -> Sequence[tuple[float, float]]:
    return [(step, ratio) for step in TIMESTEPS_S for ratio in IMPEDANCE_RATIOS] if effort == "full" else []


def _cases(effort: Effort) -> Sequence[Case]:
    return [
        *(_walking(worm, friction) for worm in WORMS for friction in frictions_of(worm, effort)),
        *(_held(worm, friction) for worm in _OPEN for friction in (SLIPPERY, PAPERS_FRICTION)),
        *(_solved(*solution) for solution in _solutions(effort)),
    ]


class _Series(NamedTuple):
    """One worm in closed loop over the frictions."""

    worm: Worm
    frictions: Sequence[float]
    outcomes: Sequence[Outcome]

    @property
    def travel_m(self) -> NDArray[np.float64]:
        """Towards the front, against the axis x, which runs from front to rear."""
        return np.array([number(outcome.summary.travel_m) for outcome in self.outcomes])

    @property
    def elongation_m(self) -> NDArray[np.float64]:
        return np.array([walked_elongation(outcome) for outcome in self.outcomes])

    @property
    def deficit(self) -> NDArray[np.float64]:
        """Over all springs."""
        return np.array([middle_deficit(elongation) for elongation in self.elongation_m])

    def at(self, friction: float) -> int:
        return list(self.frictions).index(friction)


def _examine(results: Results, effort: Effort, stem: Path) -> Findings:
    every = [
        _Series(worm, frictions := frictions_of(worm, effort), [results[_walking(worm, f)] for f in frictions])
        for worm in WORMS
    ]
    held = {
        worm.name: tuple(middle_deficit(held_elongation(results[_held(worm, f)])) for f in (SLIPPERY, PAPERS_FRICTION))
        for worm in _OPEN
    }
    solved = [
        (step, ratio, number(results[_solved(step, ratio)].summary.travel_m)) for step, ratio in _solutions(effort)
    ]
    _draw(every, held, stem)
    numbers: dict[str, Any] = {}
    for series in every:
        name = series.worm.name
        for i, friction in enumerate(series.frictions):
            numbers[f"travel_friction_{friction:g}_{name}_m"] = kept(series.travel_m[i])
            numbers[f"deficit_closed_mean_friction_{friction:g}_{name}"] = kept(series.deficit[i])
            numbers[f"verdict_friction_{friction:g}_{name}"] = rhythm_words(series.outcomes[i].rhythm)
        walk = [f"{f:g}" for f, o in zip(series.frictions, series.outcomes, strict=True) if o.rhythm.is_one_wave]
        numbers[f"frictions_that_walk_{name}"] = listed(walk)
    for name, (slippery, rough) in held.items():
        numbers[f"deficit_open_mean_friction_{SLIPPERY:g}_{name}"] = kept(slippery)
        numbers[f"deficit_open_mean_friction_{PAPERS_FRICTION:g}_{name}"] = kept(rough)
    numbers["travel_friction_1_m"] = kept(every[0].travel_m[every[0].at(PAPERS_FRICTION)])
    for step, ratio, travel in solved:
        numbers[f"travel_rods_{step * 1e3:g}ms_impratio_{ratio:g}_m"] = kept(travel)
    return Findings(
        answer=_answer(every, held),
        caption=(
            "Closed loop, 5 s, over the coefficient of friction: travel of the centre of mass, positive towards the "
            "front, against the wave; elongation of segments 1 and 2 (2 with empty markers), mean of six springs; the "
            "deficit of segment 2 below 1 in the same reading, in closed loop (filled) and open loop (empty); rhythm. "
            f"One run a point, {', '.join(str(len(series.frictions)) for series in every)} frictions."
        ),
        table=_table(every, held),
        remarks=_remarks(every, solved, effort),
        numbers=numbers,
    )


def _answer(every: Sequence[_Series], held: Mapping[str, tuple[float, ...]]) -> str:
    travels = [series.travel_m[series.at(PAPERS_FRICTION)] for series in every]
    goes = [f"{in_cm(t, 1)} cm ({s.worm.label})" for t, s in zip(travels, every, strict=True)]
    small = [s.worm.label for t, s in zip(travels, every, strict=True) if abs(t) < NEGLIGIBLE_M]
    sentences = [f"At friction {PAPERS_FRICTION:g} the centre of mass travels {listed(goes)} forwards in 5 s."]
    if len(small) < len(every):
        large = [s.worm.label for s in every if s.worm.label not in small]
        sentences.append(
            f"That is not negligible for {listed(large)}" + (f", and negligible for {listed(small)}." if small else ".")
        )
    shares = [
        f"{in_percent(held[worm.name][0])} % at {SLIPPERY:g} and {in_percent(held[worm.name][1])} % at "
        f"{PAPERS_FRICTION:g} ({worm.label})"
        for worm in _OPEN
    ]
    parts = [rough - slippery for slippery, rough in held.values()]
    sentences.append(
        f"In open loop the deficit of segment 2 over all springs is {listed(shares)}: friction makes "
        f"{span(parts, 100.0, 1)} percentage points of it."
    )
    return " ".join(sentences)


def _remarks(every: Sequence[_Series], solved: Sequence[tuple[float, float, float]], effort: Effort) -> list[str]:
    remarks = []
    for series in every:
        pairs = list(zip(series.frictions, series.outcomes, strict=True))
        walk = [f"{f:g}" for f, o in pairs if o.rhythm.is_one_wave]
        fail = [f"{f:g} ({rhythm_words(o.rhythm)})" for f, o in pairs if not o.rhythm.is_one_wave]
        sentence = f"{capitalised(series.worm.label)}: order 1-2-3 at friction {listed(walk)}"
        remarks.append(
            sentence + (f"; not at {listed(fail)}." if fail else "; no other was tried." if len(pairs) == 1 else ".")
        )
    if solved:
        travels = [travel for *_, travel in solved]
        sizes = [f"{in_cm(t)} cm at {step * 1e3:g} ms and impratio {ratio:g}" for step, ratio, t in solved]
        spread = max(travels) - min(travels)
        scale = float(np.mean(np.abs(travels)))
        remarks.append(
            f"Convergence, tight rods at friction {PAPERS_FRICTION:g}: travel {listed(sizes)}. The spread is "
            f"{in_cm(spread)} cm, {100 * spread / scale:.0f} % of the mean; "
            + (
                "so the travel is no artefact of step or friction cone."
                if spread < 0.2 * scale
                else "so the travel is known to that accuracy and no better."
            )
        )
    if effort == "quick":
        remarks.append(f"The quick effort runs {PAPERS.label} at friction {PAPERS_FRICTION:g} only.")
    return remarks


def _table(every: Sequence[_Series], held: Mapping[str, tuple[float, ...]]) -> Table:
    rows = []
    for series in every:
        opened = dict(zip((SLIPPERY, PAPERS_FRICTION), held.get(series.worm.name, ()), strict=False))
        for i, friction in enumerate(series.frictions):
            rows.append(
                [
                    series.worm.label,
                    f"{friction:g}",
                    in_cm(series.travel_m[i]),
                    all_in_cm(series.elongation_m[i]),
                    in_percent(series.deficit[i], 1),
                    in_percent(series.outcomes[i].summary.middle_deficit, 1),
                    in_percent(opened.get(friction), 1),
                    rhythm_words(series.outcomes[i].rhythm),
                ]
            )
    header = [
        "worm",
        "friction (1)",
        "travel forwards in 5 s (cm)",
        "elongation, mean of springs (cm)",
        "deficit (%)",
        "deficit, first helix (%)",
        "deficit, open loop (%)",
        "rhythm",
    ]
    return Table(header, rows)


def _draw(every: Sequence[_Series], held: Mapping[str, tuple[float, ...]], stem: Path) -> None:
    with canvas(5.4) as figure:
        (travel, elongation), (deficit, rhythms) = figure.subplots(2, 2)
        for series in every:
            look = series.worm.look
            travel.plot(series.frictions, CM * series.travel_m, **look)
            for segment, face in ((0, series.worm.color), (1, "white")):
                values = CM * series.elongation_m[:, segment]
                elongation.plot(series.frictions, values, **{**look, "markerfacecolor": face})
            deficit.plot(series.frictions, 100 * series.deficit, **look)
            if series.worm.name in held:
                values = [100 * value for value in held[series.worm.name]]
                deficit.plot(
                    (SLIPPERY, PAPERS_FRICTION), values, **{**look, "markerfacecolor": "white", "linewidth": 0.9}
                )
        travel.axhline(0.0, color="0.3", linewidth=0.8)
        elongation.set_ylim(bottom=0.0)
        rows = [(s.worm.short, [(f, o.rhythm) for f, o in zip(s.frictions, s.outcomes, strict=True)]) for s in every]
        kinds = draw_rhythms(rhythms, rows)
        panels = (
            (travel, "Travel", "forwards in 5 s (cm)"),
            (elongation, "Elongation of segments 1 and 2", "elongation (cm)"),
            (deficit, "Deficit", "segment 2 below segment 1 (%)"),
            (rhythms, "Rhythm", ""),
        )
        for axes, title, label in panels:
            panel_title(axes, title)
            axes.set_ylabel(label)
            parameter_ticks(axes, FRICTIONS)
            axes.set_xlim(0.042, 1.8)
            axes.set_xlabel("coefficient of friction (1)")
        worms = [look_handle(w.label, color=w.color, marker=w.marker, linestyle=w.line) for w in WORMS]
        opened = look_handle("segment 2 / open loop", hollow=True, marker="o", linestyle="none")
        legend_below(figure, [*worms, opened, *kinds], 4)
        save_both(figure, stem)


FRICTION = Examination(
    name="friction",
    title="Friction of the floor",
    question="The paper's worm hardly gets anywhere. How do travel, elongation and rhythm depend on friction, and is "
    "the middle segment's deficit friction's work?",
    cases=_cases,
    examine=_examine,
)

"""Start of the sodium gates and update order of the network: what the rhythm owes to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.rhythm import contractions, segment_activation
from annelid.analysis.score import DESIGN_INTERVAL_S, SHORTEST_S
from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import panel_title, segment_colors
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid.simulation.runfile import open_run
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.side_by_side import (
    NOTHING,
    PAPERS,
    SPRUNG,
    TIGHT,
    capitalised,
    in_unit,
    kept,
    legend_below,
    listed,
    rhythm_kind,
    rhythm_words,
    segment_handles,
    span,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

PLANAR = "riddle2022-planar"
STARTS = ("toolbox", "steady")
SCHEMES = ("euler", "toolbox", "heun")
ALL = tuple((start, scheme) for start in STARTS for scheme in SCHEMES)
"""Every start of the gates with every scheme."""

LABELS: Mapping[str, str] = {
    **{worm.name: worm.label for worm in (PAPERS, SPRUNG, TIGHT)},
    "planar": "planar worm, kinematic",
}
VARIANTS: Mapping[Effort, Mapping[str, Sequence[tuple[str, str]]]] = {
    "quick": {
        "chain": (("toolbox", "euler"),),
        "fast": (("toolbox", "euler"), ("steady", "euler")),
        "rods": (("toolbox", "euler"), ("toolbox", "toolbox"), ("steady", "euler")),
        "planar": ALL,
    },
    "full": {
        "chain": (("toolbox", "euler"), ("toolbox", "toolbox"), ("steady", "euler"), ("steady", "toolbox")),
        "fast": ALL,
        "rods": ALL,
        "planar": ALL,
    },
}
_SHOWN_S = 5.0


def variant(worm: str, start: str, scheme: str) -> Case:
    """Returns the closed-loop run of a worm with a start of the gates and a scheme."""
    changes = {"controller.gate_start": start, "controller.scheme": scheme}
    makers = {each.name: each.case for each in (PAPERS, SPRUNG, TIGHT)}
    return makers[worm](changes) if worm in makers else Case(PLANAR, changes)


def cases(effort: Effort) -> list[Case]:
    """Returns the runs of all worms."""
    return [variant(worm, *pair) for worm, pairs in VARIANTS[effort].items() for pair in pairs]


@dataclass(frozen=True)
class Beat:
    """The contractions of a run.

    Attributes:
        outcome: Its outcome.
        contractions_s: Onset and release of each contraction of each segment, s; infinite where it does not end.
        first_s: How long segment 1 is contracted at first, s; infinite if it never relaxes, NaN if it never contracts.
    """

    outcome: Outcome
    contractions_s: tuple[Array, ...]
    first_s: float


def read_beat(outcome: Outcome) -> Beat:
    """Reads the contractions of a run."""
    run = open_run(outcome.path)
    times = run.data["time"].values
    active = segment_activation(run.data["activation"].values, run.config.body.n_segments)
    found = tuple(contractions(times, column, shortest_s=SHORTEST_S) for column in active.T)
    first = float(np.diff(found[0][0])[0]) if len(found[0]) else float("nan")
    return Beat(outcome, found, first)


Beats = Mapping[str, Mapping[tuple[str, str], Beat]]


def examine(results: Results, effort: Effort, stem: Path) -> Findings:
    """Draws when which segment contracts, for every start of the gates and every scheme."""
    beats: Beats = {
        worm: {pair: read_beat(results[variant(worm, *pair)]) for pair in pairs}
        for worm, pairs in VARIANTS[effort].items()
    }
    _draw(beats, stem)
    return Findings(
        answer=" ".join([_starts_in_words(beats), _firsts_in_words(beats), _schemes_in_words(beats)]),
        caption=(
            f"When which segment contracts in the first {_SHOWN_S:g} s of closed loop, for each start of the sodium "
            "gates (toolbox: as SNS-Toolbox starts them; steady: at the steady state of their neuron's potential) and "
            "each update order of the network, one run a row. At the right, the period or, where there is none, "
            "what became of the rhythm; rows without either were not run."
        ),
        table=_table(beats),
        remarks=[_planar_in_words(beats)],
        numbers=_numbers(beats),
    )


def _of_start(beats: Mapping[tuple[str, str], Beat], start: str) -> list[Beat]:
    return [beat for (of, _), beat in beats.items() if of == start]


def _walks(beat: Beat) -> bool:
    return beat.outcome.rhythm.is_one_wave


def _starts_in_words(beats: Beats) -> str:
    parts = []
    for start in STARTS:
        runs = {worm: of_start for worm, of_worm in beats.items() if (of_start := _of_start(of_worm, start))}
        failing = []
        for worm, of_start in runs.items():
            kinds = sorted({rhythm_kind(beat.outcome.rhythm) for beat in of_start if not _walks(beat)})
            if kinds:
                failing.append(f"{LABELS[worm]} ({listed(kinds)})")
        text = f"with the {start} start of the gates {len(runs) - len(failing)} of {len(runs)}"
        parts.append(f"{text}, all but {listed(failing)}" if failing else text)
    return f"So many worms walk 1-2-3 with every update order that was run: {'; '.join(parts)}."


def _firsts_in_words(beats: Beats) -> str:
    parts = []
    for start in STARTS:
        lasting = [beat.first_s for of_worm in beats.values() for beat in _of_start(of_worm, start)]
        ended = [value for value in lasting if np.isfinite(value)]
        parts.append(f"{span(ended, digits=2)} s with the {start} start")
    return f"The first contraction of segment 1 lasts {listed(parts)}."


def _schemes_in_words(beats: Beats) -> str:
    spreads = []
    for of_worm in beats.values():
        for start in STARTS:
            periods = [beat.outcome.rhythm.period_s for beat in _of_start(of_worm, start) if _walks(beat)]
            known = [period for period in periods if period is not None]
            if len(known) > 1:
                spreads.append(max(known) - min(known))
    kinds = [
        {rhythm_kind(beat.outcome.rhythm) for beat in _of_start(of_worm, start)}
        for of_worm in beats.values()
        for start in STARTS
    ]
    same = all(len(of_start) <= 1 for of_start in kinds)
    text = (
        "The update order of the network changes no verdict"
        if same
        else "The update order of the network changes the verdict of some worms"
    )
    return f"{text}, and the period by {in_unit(max(spreads), 1000.0, 0)} ms at most." if spreads else f"{text}."


def _planar_in_words(beats: Beats) -> str:
    words = [
        f"{in_unit(beat.outcome.rhythm.period_s, 1000.0, 1)} ms ({start} start, {scheme})"
        for (start, scheme), beat in beats["planar"].items()
    ]
    return (
        f"The planar worm has no dynamics of its own, so its period is the network's: {listed(words)}. By the "
        f"design of the network it is {3000.0 * DESIGN_INTERVAL_S:g} ms."
    )


def _numbers(beats: Beats) -> dict[str, float | str | None]:
    numbers: dict[str, float | str | None] = {}
    for worm, of_worm in beats.items():
        for (start, scheme), beat in of_worm.items():
            tag = f"{worm}_{start}_{scheme}"
            numbers[f"verdict_{tag}"] = rhythm_kind(beat.outcome.rhythm)
            numbers[f"period_{tag}_s"] = beat.outcome.rhythm.period_s
            numbers[f"first_contraction_{tag}_s"] = kept(beat.first_s)
    return numbers


def _table(beats: Beats) -> Table:
    rows = [
        [
            LABELS[worm],
            start,
            scheme,
            rhythm_words(beat.outcome.rhythm),
            in_unit(beat.outcome.rhythm.period_s, digits=4),
            " ".join(in_unit(onset) for onset in beat.outcome.summary.onsets_s[:6]) or NOTHING,
            in_unit(beat.first_s) if np.isfinite(beat.first_s) else "to the end",
        ]
        for worm, of_worm in beats.items()
        for (start, scheme), beat in of_worm.items()
    ]
    return Table(
        ("worm", "gate start", "update order", "rhythm", "period (s)", "first onsets (s)", "first contraction (s)"),
        rows,
    )


def _draw(beats: Beats, stem: Path) -> None:
    with canvas(5.0) as figure:
        panels = figure.subplots(2, 2, sharex=True, sharey=True)
        for axes, (worm, of_worm) in zip(panels.flat, beats.items(), strict=False):
            for row, pair in enumerate(ALL):
                if pair in of_worm:
                    _draw_beat(axes, row, of_worm[pair])
            panel_title(axes, capitalised(LABELS[worm]))
            axes.set_xlim(0.0, _SHOWN_S)
            axes.set_ylim(len(ALL) - 0.4, -0.6)
            axes.set_yticks(range(len(ALL)), [f"{start}, {scheme}" for start, scheme in ALL])
            axes.tick_params(axis="y", length=0)
            axes.grid(visible=False, axis="y")
        for axes in panels[:, 0]:
            axes.set_ylabel("gate start, update order")
        for axes in panels[-1]:
            axes.set_xlabel("time (s)")
        legend_below(figure, segment_handles(3))
        save_both(figure, stem)


def _draw_beat(axes: Axes, row: int, beat: Beat) -> None:
    n = len(beat.contractions_s)
    height = 0.8 / n
    for i, (spans, color) in enumerate(zip(beat.contractions_s, segment_colors(n), strict=True)):
        ends = np.minimum(spans[:, 1], _SHOWN_S)
        axes.barh(
            np.full(len(spans), row - 0.4 + (i + 0.5) * height),
            ends - spans[:, 0],
            left=spans[:, 0],
            height=0.85 * height,
            color=color,
            linewidth=0.0,
        )
    score = beat.outcome.rhythm
    text = f"{score.period_s:.3f} s" if _walks(beat) and score.period_s is not None else rhythm_kind(score)
    axes.annotate(
        text,
        (1.0, row),
        xycoords=("axes fraction", "data"),
        xytext=(3, 0),
        textcoords="offset points",
        va="center",
        fontsize=7.5,
        annotation_clip=False,
    )


GATE = Examination(
    name="gate",
    title="Gate start and update order",
    question=(
        "Does the rhythm depend on how the sodium gates start, and on the order in which the network's gates and "
        "potentials are advanced?"
    ),
    cases=cases,
    examine=examine,
)

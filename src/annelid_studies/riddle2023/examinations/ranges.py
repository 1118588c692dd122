"""The muscles' length ranges: how much of the middle segment's deficit they make."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from annelid.analysis.elongation import middle_deficit
from annelid.analysis.paper import published
from annelid.body.worm import WormBody
from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import panel_title
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.side_by_side import (
    PAPERS,
    WORMS,
    Worm,
    all_in_cm,
    held_elongation,
    in_percent,
    kept,
    legend_below,
    listed,
    look_handle,
    rhythm_words,
    walked_elongation,
)
from annelid_studies.worms import chain, one_after_the_other

EQUAL = (0.566, 1.067)
"""Mean of the three ranges that the engine of the paper's time compiled, m."""

_FIELD = "body.rings.length_range_m"


def compiled_ranges() -> list[list[float]]:
    """The ranges of the paper's worm, one a segment, as the engine of its time compiled them, m."""
    body = chain().config.body
    assert isinstance(body, WormBody)
    return [list(limits) for limits in body.rings.length_ranges(body.mesh.n_segments)]


def _changes(equal: bool, held: bool) -> dict[str, Any]:
    limits = {_FIELD: list(EQUAL) if equal else compiled_ranges()}
    return {**one_after_the_other(), **limits} if held else limits


def _case(worm: Worm, equal: bool, held: bool) -> Case:
    return worm.case(_changes(equal, held))


def _pairs(effort: Effort) -> list[tuple[Worm, bool]]:
    """Worms and loops, open or not, that are compared at an effort."""
    return [(worm, held) for worm in (WORMS if effort == "full" else WORMS[1:]) for held in (True, False)]


def _cases(effort: Effort) -> Sequence[Case]:
    return [_case(worm, equal, held) for worm, held in _pairs(effort) for equal in (False, True)]


class _Row(NamedTuple):
    """Deficits of one worm in one loop with both kinds of ranges; each as (first helix, mean of all springs)."""

    worm: Worm
    held: bool
    compiled: tuple[float, float]
    equal: tuple[float, float]

    @property
    def label(self) -> str:
        return f"{self.worm.label},\n{'open' if self.held else 'closed'} loop"


def _deficits(outcome: Outcome, held: bool) -> tuple[float, float]:
    read = held_elongation if held else walked_elongation
    first_helix, mean = (middle_deficit(read(outcome, first_helix=reading)) for reading in (True, False))
    return first_helix, mean


def _examine(results: Results, effort: Effort, stem: Path) -> Findings:
    rows = [
        _Row(
            worm,
            held,
            _deficits(results[_case(worm, False, held)], held),
            _deficits(results[_case(worm, True, held)], held),
        )
        for worm, held in _pairs(effort)
    ]
    paper = published(chain().config)["middle_deficit"].value
    assert isinstance(paper, float)
    _draw(rows, paper, stem)
    numbers: dict[str, float | str | None] = {}
    for row in rows:
        loop = "open" if row.held else "closed"
        for kind, deficits in (("compiled", row.compiled), ("equal", row.equal)):
            for reading, value in zip(("", "_mean"), deficits, strict=True):
                numbers[f"deficit{reading}_{loop}_{kind}_{row.worm.name}"] = kept(value)
    closed = next(row for row in rows if not row.held)
    opened = [row for row in rows if row.held]
    return Findings(
        answer=_answer(closed, opened),
        caption=(
            "How far segment 2 elongates less than segment 1, with the three length ranges as the engine of the "
            "paper's time compiled them and with equal ones. Left: first helix (closed loop: peak to peak), the "
            f"paper's reading; the line is the paper's {in_percent(paper, 1)} %. Right: mean of the six springs. "
            "One run a point, closed loop 5 s, open loop one contraction of 0.8 s a segment."
        ),
        table=_table(results, rows),
        remarks=[*_remarks(rows), *([f"The quick effort leaves out {PAPERS.label}."] if effort == "quick" else [])],
        numbers=numbers,
    )


def _answer(closed: _Row, opened: Sequence[_Row]) -> str:
    (helix, mean), (helix_equal, mean_equal) = closed.compiled, closed.equal
    parts = [
        f"In closed loop {closed.worm.label} {'has' if closed.worm is PAPERS else 'have'} a deficit of "
        f"{in_percent(helix)} % on the first helix with the ranges as compiled and {in_percent(helix_equal)} % with "
        f"equal ones; over all springs, {in_percent(mean)} % and {in_percent(mean_equal)} %."
    ]
    left = [f"{in_percent(row.equal[1])} of {in_percent(row.compiled[1])} % ({row.worm.label})" for row in opened]
    parts.append(f"In open loop, over all springs, equal ranges leave {listed(left)}.")
    shares = [1.0 - row.equal[1] / row.compiled[1] for row in opened]
    least = min(shares)
    parts.append(
        "So most of the deficit of a contraction held by itself comes from the range that the compiler gave segment 2."
        if least > 0.5
        else f"So the ranges make {in_percent(least)} to {in_percent(max(shares))} % of the deficit of a contraction "
        "held by itself, and the rest has other causes."
    )
    return " ".join(parts)


def _remarks(rows: Sequence[_Row]) -> list[str]:
    low, high = zip(*compiled_ranges(), strict=True)
    opened, closed = ({row.worm: row for row in rows if row.held is held} for held in (True, False))
    left = [
        f"{in_percent(row.equal[1])} of {in_percent(row.compiled[1])} % ({worm.label})" for worm, row in closed.items()
    ]
    beyond = [f"{in_percent(closed[worm].equal[1] - row.equal[1], 1)} ({worm.label})" for worm, row in opened.items()]
    return [
        f"The ranges as compiled begin at {' / '.join(f'{value:g}' for value in low)} m and end at "
        f"{' / '.join(f'{value:g}' for value in high)} m for segments 1 / 2 / 3. A muscle's active force ends at a "
        f"length that follows from its range, and segment 2's begins {100 * (low[1] - (low[0] + low[2]) / 2):.1f} cm "
        "above the mean of its neighbours'.",
        f"In closed loop, over all springs, equal ranges leave {listed(left)}. With equal ranges the deficit in closed "
        f"loop exceeds that in open loop by {listed(beyond)} percentage points. Equal muscles "
        "cannot make that difference; in closed loop segments contract while others still relax.",
    ]


def _table(results: Results, rows: Sequence[_Row]) -> Table:
    lines = []
    for row in rows:
        for equal in (False, True):
            outcome = results[_case(row.worm, equal, row.held)]
            read = held_elongation if row.held else walked_elongation
            helix, mean = row.equal if equal else row.compiled
            lines.append(
                [
                    row.worm.label,
                    "open" if row.held else "closed",
                    "equal" if equal else "as compiled",
                    all_in_cm(read(outcome, first_helix=True)),
                    in_percent(helix, 1),
                    all_in_cm(read(outcome)),
                    in_percent(mean, 1),
                    "as programmed" if row.held else rhythm_words(outcome.rhythm),
                ]
            )
    header = [
        "worm",
        "loop",
        "ranges",
        "first helix (cm)",
        "deficit (%)",
        "mean of springs (cm)",
        "deficit (%)",
        "rhythm",
    ]
    return Table(header, lines)


def _draw(rows: Sequence[_Row], paper: float, stem: Path) -> None:
    with canvas(1.2 + 0.42 * len(rows)) as figure:
        panels = figure.subplots(1, 2, sharey=True, sharex=True)
        titles = ("First helix", "Mean of six springs")
        for reading, (axes, title) in enumerate(zip(panels, titles, strict=True)):
            panel_title(axes, title)
            for i, row in enumerate(rows):
                before, after = 100 * row.compiled[reading], 100 * row.equal[reading]
                axes.plot([before, after], [-i, -i], color="0.7", linewidth=2.0, zorder=1)
                look = {"marker": row.worm.marker, "color": row.worm.color, "markersize": 7.0, "linestyle": "none"}
                axes.plot([before], [-i], **look)
                axes.plot([after], [-i], **look, markerfacecolor="white", markeredgewidth=1.4)
            axes.axvline(0.0, color="0.4", linewidth=0.8)
            axes.set_xlabel("segment 2 below segment 1 (%)")
            axes.grid(visible=False, axis="y")
        panels[0].axvline(100 * paper, color="0.2", linewidth=1.0, linestyle="-.")
        panels[0].set_yticks([-i for i in range(len(rows))], [row.label for row in rows])
        panels[0].set_ylim(0.5 - len(rows), 0.5)
        from matplotlib.lines import Line2D

        line = Line2D([], [], color="0.2", linewidth=1.0, linestyle="-.", label="the paper")
        dots: dict[str, Any] = {"marker": "o", "linestyle": "none"}
        legend_below(figure, [look_handle("as compiled", **dots), look_handle("equal", hollow=True, **dots), line])
        save_both(figure, stem)


RANGES = Examination(
    name="ranges",
    title="Length ranges of the muscles",
    question="The engine of the paper's time gave each muscle a length range of its own. How much of the middle "
    "segment's deficit is left when all have the same?",
    cases=_cases,
    examine=_examine,
)

"""The muscles' length ranges: how much of the middle segment's deficit they make."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from annelid.analysis import middle_deficit, published
from annelid.body import WormBody
from annelid.draw import canvas, save_both
from annelid.morphology import Array
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations import design, plots, words
from annelid_studies.riddle2023.examinations.design import PAPERS, WORMS, Point, Reading, Worm
from annelid_studies.riddle2023.examinations.words import PERCENT
from annelid_studies.tables import tabulated
from annelid_studies.worms import chain, one_after_the_other

EQUAL = (0.566, 1.067)
"""Mean of the three ranges that the engine of the paper's time compiled, m."""

_FIELD = "body.rings.length_range_m"


def compiled_ranges() -> list[list[float]]:
    """The ranges of the paper's worm, one a segment, as the engine of its time compiled them, m."""
    body = chain().config.body
    assert isinstance(body, WormBody)
    return [list(limits) for limits in body.rings.length_ranges(body.mesh.n_segments)]


def _points(effort: Effort) -> list[Point]:
    """Each worm with the ranges as compiled (value 0) and with equal ones (value 1)."""
    points = []
    for worm in WORMS if effort == "full" else WORMS[1:]:
        for equal, limits in enumerate((compiled_ranges(), list(EQUAL))):
            changes = {_FIELD: limits}
            points.append(Point(worm, equal, worm.case(changes), worm.case({**one_after_the_other(), **changes})))
    return points


class _Row(NamedTuple):
    """One worm in open or closed loop, with either kind of ranges."""

    loop: str
    compiled: Reading
    equal: Reading

    @property
    def worm(self) -> Worm:
        return self.compiled.worm


def _elongation(loop: str, one: Reading, first_helix: bool) -> Array:
    if loop == "open":
        return design.held_elongation(one.hold, first_helix=first_helix)
    return design.walked_elongation(one.walk, first_helix=first_helix)


def _deficit(loop: str, one: Reading, first_helix: bool = False) -> float:
    return middle_deficit(_elongation(loop, one, first_helix))


def _examine(results: Results, effort: Effort, stem: Path) -> Findings:
    readings = design.read(_points(effort), results)
    pairs = list(zip(readings[::2], readings[1::2], strict=True))
    rows = [_Row(loop, *pair) for pair in pairs for loop in ("open", "closed")]
    paper = published(chain().config)["middle_deficit"].value
    assert isinstance(paper, float)
    _draw(rows, paper, stem)
    numbers = {
        f"deficit{reading}_{row.loop}_{kind}_{row.worm.name}": _deficit(row.loop, one, first_helix)
        for row in rows
        for kind, one in (("compiled", row.compiled), ("equal", row.equal))
        for reading, first_helix in (("", True), ("_mean", False))
    }
    first = rows[1]
    helix, helix_equal, mean, mean_equal = (
        words.in_percent(_deficit("closed", one, first_helix))
        for first_helix in (True, False)
        for one in (first.compiled, first.equal)
    )
    shares = [1.0 - one.equal.held_deficit / one.compiled.held_deficit for one in rows[::2]]
    return Findings(
        answer=(
            f"Deficit of {first.worm.label} in closed loop: {helix} % on the first helix with the ranges as compiled "
            f"and {helix_equal} % with equal ones; over all springs, {mean} % and {mean_equal} %. In open loop, over "
            f"all springs, equal ranges leave {_left(rows[::2])}. So the ranges make "
            f"{words.span(shares, PERCENT, 0)} % of the deficit of a contraction held by itself"
            f"{', which is most of it' if min(shares) > 0.5 else ', and the rest has other causes'}."
        ),
        caption=(
            "How far segment 2 elongates less than segment 1, with the three length ranges as the engine of the "
            "paper's time compiled them and with equal ones. Left: first helix (closed loop: peak to peak), the "
            f"paper's reading; the line is the paper's {words.in_percent(paper, 1)} %. Right: mean of the six springs. "
            "One run a point, closed loop 5 s, open loop one contraction of 0.8 s a segment."
        ),
        table=tabulated(
            [(row.loop, one) for row in rows for one in (row.compiled, row.equal)],
            {
                "worm": lambda at: at[1].worm.label,
                "loop": lambda at: at[0],
                "ranges": lambda at: "equal" if at[1].value else "as compiled",
                "first helix (cm)": lambda at: words.all_in_cm(_elongation(*at, first_helix=True)),
                "deficit on it (%)": lambda at: words.in_percent(_deficit(*at, first_helix=True), 1),
                "mean of springs (cm)": lambda at: words.all_in_cm(_elongation(*at, first_helix=False)),
                "deficit (%)": lambda at: words.in_percent(_deficit(*at), 1),
                "rhythm": lambda at: "as programmed" if at[0] == "open" else words.rhythm(at[1].rhythm),
            },
        ),
        remarks=[
            *_remarks(rows),
            *([f"The quick effort leaves out {PAPERS.label}."] if effort == "quick" else []),
        ],
        numbers=numbers,
    )


def _left(rows: Sequence[_Row]) -> str:
    """What equal ranges leave of the deficit over all springs."""
    return words.listed(
        f"{words.in_percent(_deficit(row.loop, row.equal))} of {words.in_percent(_deficit(row.loop, row.compiled))} % "
        f"({row.worm.label})"
        for row in rows
    )


def _remarks(rows: Sequence[_Row]) -> list[str]:
    low, high = zip(*compiled_ranges(), strict=True)
    closed = [row.equal for row in rows[1::2]]
    beyond = words.told(closed, lambda one: words.in_percent(one.deficit - one.held_deficit, 1))
    return [
        f"The ranges as compiled begin at {' / '.join(f'{value:g}' for value in low)} m and end at "
        f"{' / '.join(f'{value:g}' for value in high)} m for segments 1 / 2 / 3. A muscle's active force ends at a "
        f"length that follows from its range, and segment 2's begins {100 * (low[1] - (low[0] + low[2]) / 2):.1f} cm "
        "above the mean of its neighbours'.",
        f"In closed loop, over all springs, equal ranges leave {_left(rows[1::2])}. With equal ranges the deficit in "
        f"closed loop exceeds that in open loop by {beyond} percentage points. Equal muscles cannot make that "
        "difference; in closed loop segments contract while others still relax.",
    ]


def _draw(rows: Sequence[_Row], paper: float, stem: Path) -> None:
    with canvas(1.2 + 0.42 * len(rows)) as figure:
        panels = figure.subplots(1, 2, sharey=True, sharex=True)
        for axes, title, first_helix in zip(panels, ("First helix", "Mean of six springs"), (True, False), strict=True):
            plots.label_panel(axes, title, "segment 2 below segment 1 (%)", "")
            for i, row in enumerate(rows):
                compiled, equal = (PERCENT * _deficit(row.loop, one, first_helix) for one in (row.compiled, row.equal))
                look = {**row.worm.look, "markersize": 7.0, "linestyle": "none"}
                axes.plot([compiled, equal], [-i, -i], color="0.7", linewidth=2.0, zorder=1)
                axes.plot([compiled], [-i], **look)
                axes.plot([equal], [-i], **look, markerfacecolor="white", markeredgewidth=1.4)
            axes.axvline(0.0, color="0.4", linewidth=0.8)
            axes.grid(visible=False, axis="y")
        line = panels[0].axvline(PERCENT * paper, color="0.2", linewidth=1.0, linestyle="-.", label="the paper")
        panels[0].set_yticks([-i for i in range(len(rows))], [f"{row.worm.label},\n{row.loop} loop" for row in rows])
        panels[0].set_ylim(0.5 - len(rows), 0.5)
        dots: dict[str, Any] = {"marker": "o", "linestyle": "none"}
        kinds = [plots.look_handle("as compiled", **dots), plots.look_handle("equal", hollow=True, **dots)]
        plots.legend_below(figure, [*kinds, line])
        save_both(figure, stem)


RANGES = Examination(
    name="ranges",
    title="Length ranges of the muscles",
    question="The engine of the paper's time gave each muscle a length range of its own. How much of the middle "
    "segment's deficit is left when all have the same?",
    cases=lambda effort: design.cases_of(_points(effort)),
    examine=_examine,
)

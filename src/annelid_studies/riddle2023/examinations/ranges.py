"""The muscles' length ranges: how much of the middle segment's deficit they make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from annelid.analysis import PAPER_MIDDLE_DEFICIT, middle_deficit
from annelid.body import worm_of
from annelid.draw import canvas, save_both
from annelid.experiment import Store
from annelid.morphology import Array
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Examination, Findings
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, WORMS, Point, Worm
from annelid_studies.riddle2023.words import PERCENT
from annelid_studies.tables import tabulated
from annelid_studies.worms import Effort, chain, one_after_the_other

EQUAL = (0.566, 1.067)
"""Mean of the three ranges that the engine of the paper's time compiled, m."""


def compiled_ranges() -> list[list[float]]:
    """The ranges of the paper's worm, one a segment, as the engine of its time compiled them, m."""
    body = worm_of(chain().config)
    return [list(limits) for limits in body.rings.length_ranges(body.mesh.n_segments)]


def _points(effort: Effort) -> list[Point]:
    """Each worm with the ranges as compiled (value 0) and with equal ones (value 1)."""
    points = []
    for worm in WORMS if effort == "full" else WORMS[1:]:
        for equal, limits in enumerate((compiled_ranges(), list(EQUAL))):
            changes = {"body.rings.length_range_m": limits}
            points.append(Point(worm, equal, worm.case(changes), worm.case({**one_after_the_other(), **changes})))
    return points


class _Loop(NamedTuple):
    """One worm in open or closed loop, with one kind of ranges: elongation on the first helix, and mean of springs."""

    worm: Worm
    loop: str
    ranges: str
    elongation_m: tuple[Array, Array]
    rhythm: str

    def deficit(self, reading: int = 1) -> float:
        """Deficit of segment 2, a fraction, on the first helix (0) or over all springs (1)."""
        return middle_deficit(self.elongation_m[reading])


def _examine(store: Store, effort: Effort, stem: Path) -> Findings:
    readings = design.read(_points(effort), store)
    loops = []
    for pair in zip(readings[::2], readings[1::2], strict=True):
        for loop in ("open", "closed"):
            for ranges, one in zip(("compiled", "equal"), pair, strict=True):
                helix_m, mean_m = (
                    design.held_elongation(one.hold, first_helix=helix)
                    if loop == "open"
                    else design.walked_elongation(one.walk, first_helix=helix)
                    for helix in (True, False)
                )
                rhythm = "as programmed" if loop == "open" else words.rhythm(one.rhythm)
                loops.append(_Loop(one.worm, loop, ranges, (helix_m, mean_m), rhythm))
    rows = list(zip(loops[::2], loops[1::2], strict=True))
    opened, closed = rows[::2], rows[1::2]
    _draw(rows, stem)
    first, first_equal = closed[0]
    shares = [1.0 - equal.deficit() / compiled.deficit() for compiled, equal in opened]
    low, high = zip(*compiled_ranges(), strict=True)
    beyond = words.listed(
        f"{words.in_percent(in_closed.deficit() - in_open.deficit(), 1)} ({in_open.worm.label})"
        for (_, in_open), (_, in_closed) in zip(opened, closed, strict=True)
    )
    columns: Mapping[str, Callable[[_Loop], str]] = {
        "worm": lambda one: one.worm.label,
        "loop": lambda one: one.loop,
        "ranges": lambda one: {"compiled": "as compiled"}.get(one.ranges, one.ranges),
        "first helix (cm)": lambda one: words.all_in_cm(one.elongation_m[0]),
        "deficit on it (%)": lambda one: words.in_percent(one.deficit(0), 1),
        "mean of springs (cm)": lambda one: words.all_in_cm(one.elongation_m[1]),
        "deficit (%)": lambda one: words.in_percent(one.deficit(), 1),
        "rhythm": lambda one: one.rhythm,
    }
    return Findings(
        answer=f"Deficit of {first.worm.label} in closed loop: {words.in_percent(first.deficit(0))} % on the first "
        f"helix with the ranges as compiled and {words.in_percent(first_equal.deficit(0))} % with equal ones; over all "
        f"springs, {words.in_percent(first.deficit())} % and {words.in_percent(first_equal.deficit())} %. In open "
        f"loop, over all springs, equal ranges leave {_left(opened)}. So the ranges make "
        f"{words.span(shares, PERCENT, 0)} % of the deficit of a contraction held by "
        f"itself{', which is most of it' if min(shares) > 0.5 else ', and the rest has other causes'}.",
        caption="How far segment 2 elongates less than segment 1, with the three length ranges as the engine of the "
        "paper's time compiled them and with equal ones. Left: first helix (closed loop: peak to peak), the paper's "
        f"reading; the line is the paper's {words.in_percent(PAPER_MIDDLE_DEFICIT, 1)} %. Right: mean of the six "
        "springs. One run a point, closed loop 5 s, open loop one contraction of 0.8 s a segment.",
        table=tabulated(loops, columns),
        remarks=[
            f"The ranges as compiled begin at {' / '.join(f'{value:g}' for value in low)} m and end at "
            f"{' / '.join(f'{value:g}' for value in high)} m for segments 1 / 2 / 3. A muscle's active force ends at a "
            "length that follows from its range, and segment 2's begins "
            f"{100 * (low[1] - (low[0] + low[2]) / 2):.1f} cm above the mean of its neighbours'.",
            f"In closed loop, over all springs, equal ranges leave {_left(closed)}. With equal ranges the deficit in "
            f"closed loop exceeds that in open loop by {beyond} percentage points. Equal muscles cannot make that "
            "difference; in closed loop segments contract while others still relax.",
            *([f"The quick effort leaves out {PAPERS.label}."] if effort == "quick" else []),
        ],
        numbers={
            f"deficit{reading}_{one.loop}_{one.ranges}_{one.worm.name}": one.deficit(index)
            for one in loops
            for index, reading in enumerate(("", "_mean"))
        },
    )


def _left(rows: Sequence[tuple[_Loop, _Loop]]) -> str:
    """What equal ranges leave of the deficit over all springs."""
    return words.listed(
        f"{words.in_percent(equal.deficit())} of {words.in_percent(compiled.deficit())} % ({equal.worm.label})"
        for compiled, equal in rows
    )


def _draw(rows: Sequence[tuple[_Loop, _Loop]], stem: Path) -> None:
    with canvas(1.2 + 0.42 * len(rows)) as figure:
        panels = figure.subplots(1, 2, sharey=True, sharex=True)
        for reading, (axes, title) in enumerate(zip(panels, ("First helix", "Mean of six springs"), strict=True)):
            design.label_panel(axes, title, "segment 2 below segment 1 (%)", "")
            for i, row in enumerate(rows):
                compiled, equal = (PERCENT * one.deficit(reading) for one in row)
                look = {**row[0].worm.look, "markersize": 7.0, "linestyle": "none"}
                axes.plot([compiled, equal], [-i, -i], color="0.7", linewidth=2.0, zorder=1)
                axes.plot([compiled], [-i], **look)
                axes.plot([equal], [-i], **look, markerfacecolor="white", markeredgewidth=1.4)
            axes.axvline(0.0, color="0.4", linewidth=0.8)
            axes.grid(visible=False, axis="y")
        paper = PERCENT * PAPER_MIDDLE_DEFICIT
        line = panels[0].axvline(paper, color="0.2", linewidth=1.0, linestyle="-.", label="the paper")
        panels[0].set_yticks([-i for i in range(len(rows))], [f"{one.worm.label},\n{one.loop} loop" for one, _ in rows])
        panels[0].set_ylim(0.5 - len(rows), 0.5)
        dots: dict[str, Any] = {"marker": "o", "linestyle": "none"}
        kinds = [design.look_handle("as compiled", **dots), design.look_handle("equal", hollow=True, **dots)]
        design.legend_below(figure, [*kinds, line])
        save_both(figure, stem)


RANGES = Examination(
    "ranges",
    "Length ranges of the muscles",
    "The engine of the paper's time gave each muscle a length range of its own. How much of the middle "
    "segment's deficit is left when all have the same?",
    lambda effort: design.cases_of(_points(effort)),
    _examine,
)

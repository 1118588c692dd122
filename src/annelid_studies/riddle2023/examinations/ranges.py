"""The muscles' length ranges: how much of the middle segment's deficit they make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from annelid.analysis import middle_deficit
from annelid.body import worm_of
from annelid.experiment import Store
from annelid.morphology import Array
from annelid_studies.papers import words
from annelid_studies.papers.report_parts import Findings
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, WORMS, Point, Worm
from annelid_studies.standard_cases import Effort, chain, one_after_the_other
from annelid_studies.tables import tabulated

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


def _examine(store: Store, effort: Effort) -> Findings:
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
    found: dict[str, Any] = {
        "worm": first.worm.label,
        "helix": first.deficit(0),
        "helix_equal": first_equal.deficit(0),
        "springs": first.deficit(),
        "springs_equal": first_equal.deficit(),
        "left_open": _left(opened),
        "shares": shares,
        "most": ", which is most of it" if min(shares) > 0.5 else ", and the rest has other causes",
        "begin": " / ".join(f"{value:g}" for value in low),
        "end": " / ".join(f"{value:g}" for value in high),
        "above_cm": 100 * (low[1] - (low[0] + low[2]) / 2),
        "left_closed": _left(closed),
        "beyond": beyond,
        "papers": PAPERS.label,
    }
    remarks = ["compiled", "closed", *(["quick"] if effort == "quick" else [])]
    numbers = {f"deficit_mean_{one.loop}_{one.ranges}_{one.worm.name}": one.deficit() for one in loops}
    return design.findings("ranges", found, tabulated(loops, columns), remarks, numbers)


def _left(rows: Sequence[tuple[_Loop, _Loop]]) -> str:
    """What equal ranges leave of the deficit over all springs."""
    return words.listed(
        f"{words.in_percent(equal.deficit())} of {words.in_percent(compiled.deficit())} % ({equal.worm.label})"
        for compiled, equal in rows
    )


RANGES = design.examination("ranges", lambda effort: design.cases_of(_points(effort)), _examine)

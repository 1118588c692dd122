"""Friction of the floor: travel, elongation, the middle segment's deficit and the rhythm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from annelid.experiment import Store
from annelid_studies.papers import words
from annelid_studies.papers.report_parts import Findings
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, WORMS, Columns, Point, Worm
from annelid_studies.standard_cases import Effort, one_after_the_other
from annelid_studies.tables import tabulated

FRICTIONS = (0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5)
FEW = (0.05, 0.2, 0.4, 1.0, 1.5)
"""Of the paper's chain, which takes longest."""
SLIPPERY, PAPERS_FRICTION = 0.05, 1.0
NEGLIGIBLE_M = 0.01
"""Travel below this, a fiftieth of the body in two cycles, is called negligible."""


def frictions_of(worm: Worm, effort: Effort) -> Sequence[float]:
    """Returns the frictions at which a worm is walked."""
    if effort == "full":
        return FEW if worm is PAPERS else FRICTIONS
    return (PAPERS_FRICTION,) if worm is PAPERS else (SLIPPERY, 0.4, PAPERS_FRICTION)


def _points(effort: Effort) -> list[Point]:
    points = []
    for worm in WORMS:
        for friction in frictions_of(worm, effort):
            changes = {"arena.friction": friction}
            held = worm is not PAPERS and friction in (SLIPPERY, PAPERS_FRICTION)
            hold = worm.case({**one_after_the_other(), **changes}) if held else None
            points.append(Point(worm, friction, worm.case(changes), hold))
    return points


def _examine(store: Store, effort: Effort) -> Findings:
    readings = design.read(_points(effort), store)
    held = [one for one in readings if one.hold]
    at_papers = [one for one in readings if one.value == PAPERS_FRICTION]
    numbers = design.numbered(
        readings,
        {
            "travel_friction_{value:g}_{worm}_m": lambda one: one.travel_m,
            "verdict_friction_{value:g}_{worm}": lambda one: words.rhythm(one.rhythm),
        },
    )
    numbers |= design.numbered(held, {"deficit_open_mean_friction_{value:g}_{worm}": lambda one: one.held_deficit})
    orders = []
    for worm, own in design.by_worm(readings).items():
        walk = numbers[f"frictions_that_walk_{worm.name}"] = words.listed(f"{one.value:g}" for one in own if one.walks)
        fail = words.listed(f"{one.value:g} ({words.rhythm(one.rhythm)})" for one in own if not one.walks)
        orders.append(f"{words.capitalised(worm.label)}: order 1-2-3 at friction {walk}, lost at {fail}.")
    parts = [rough.held_deficit - smooth.held_deficit for smooth, rough in design.by_worm(held).values()]
    slippery = {one.worm: words.in_percent(one.held_deficit) for one in held if one.value == SLIPPERY}
    deficits = words.by_worm(
        (one for one in held if one.value == PAPERS_FRICTION),
        lambda one: (
            f"{slippery[one.worm]} % at {SLIPPERY:g} and {words.in_percent(one.held_deficit)} % at {one.value:g}"
        ),
    )
    found: dict[str, Any] = {
        "papers_friction": PAPERS_FRICTION,
        "travels": words.by_worm(at_papers, lambda one: f"{words.in_cm(one.travel_m, 1)} cm"),
        "small": words.labels(one for one in at_papers if abs(one.travel_m) < NEGLIGIBLE_M),
        "deficits": deficits,
        "parts": parts,
        "papers": PAPERS.label,
    }
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "friction (1)": lambda one: f"{one.value:g}",
        "travel forwards in 5 s (cm)": lambda one: words.in_cm(one.travel_m),
        "elongation, mean of springs (cm)": lambda one: words.all_in_cm(one.walked_m),
        "deficit (%)": lambda one: words.in_percent(one.deficit, 1),
        "deficit, first helix (%)": lambda one: words.in_percent(one.closed.summary.middle_deficit, 1),
        "deficit, open loop (%)": lambda one: words.in_percent(one.held_deficit, 1),
        "rhythm": lambda one: words.rhythm(one.rhythm),
    }
    said = design.findings(
        "friction", found, tabulated(readings, columns), ["quick"] if effort == "quick" else [], numbers
    )
    return replace(said, remarks=[*orders, *said.remarks])


FRICTION = design.examination("friction", lambda effort: design.cases_of(_points(effort)), _examine)

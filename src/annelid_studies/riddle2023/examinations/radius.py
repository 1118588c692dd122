"""The strands' radius at the same mass: elongation, force and rhythm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from annelid.draw import canvas, save_both
from annelid.experiment import Store
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Examination, Findings
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, WORMS, Columns, Point, Reading
from annelid_studies.riddle2023.words import CM, MM
from annelid_studies.tables import tabulated
from annelid_studies.worms import Effort, one_after_the_other

RADII_M = (0.002, 0.00233, 0.00299)
"""The paper's strands, and the two radii of the authors' later files."""


def _points(effort: Effort) -> list[Point]:
    points = []
    for worm in WORMS:
        for radius in RADII_M if effort == "full" else RADII_M[:1] if worm is PAPERS else RADII_M[::2]:
            changes = {"body.strands.radius_m": radius}
            held = worm is not PAPERS or radius == RADII_M[0]
            hold = worm.case({**one_after_the_other(), **changes}) if held else None
            points.append(Point(worm, MM * radius, worm.case(changes), hold))
    return points


def _stiffness(radius_mm: float) -> float:
    """Bending stiffness relative to that of the paper's strands."""
    return (radius_mm / (MM * RADII_M[0])) ** 4


def _examine(store: Store, effort: Effort, stem: Path) -> Findings:
    readings = design.read(_points(effort), store)
    _draw(readings, stem)
    thin, thick = MM * RADII_M[0], MM * RADII_M[-1]
    thinnest = {one.worm: one for one in readings if one.value == thin}
    thickest = [one for one in readings if one.value == thick]
    keep = [one for one in thickest if one.walks]
    # Names of numbers have the radius in micrometres.
    in_micrometres = [replace(one, value=1e3 * one.value) for one in readings]
    numbers = design.numbered(
        in_micrometres,
        {
            "verdict_{value:.0f}um_{worm}": lambda one: words.rhythm(one.rhythm),
            "force_{value:.0f}um_{worm}_N": lambda one: one.force_N,
            "elongation_closed_first_{value:.0f}um_{worm}_m": lambda one: one.walked_m[0],
        },
    )
    open_loop = [one for one in in_micrometres if one.hold]
    numbers |= design.numbered(open_loop, {"elongation_open_first_{value:.0f}um_{worm}_m": lambda one: one.held_m[0]})
    tolerances = words.by_worm(thinnest.values(), lambda one: f"{MM * one.worm.tolerance_m:g} mm")
    held = words.by_worm(
        [one for one in thickest if one.hold],
        lambda one: f"from {words.in_cm(thinnest[one.worm].held_m[0])} to {words.in_cm(one.held_m[0])} cm",
    )
    forces = words.by_worm(
        thickest, lambda one: f"from {words.in_unit(thinnest[one.worm].force_N)} to {words.in_unit(one.force_N)} N"
    )
    remarks = [
        f"At {thick:g} mm: {'; '.join(f'{one.worm.label}: {words.rhythm(one.rhythm)}' for one in thickest)}."
        f" The sensor tolerances are those of the presets, {tolerances}, which were found for the paper's radius."
    ]
    if effort == "quick":
        remarks.append(f"The quick effort varies the radius of {words.labels(thickest)} only.")
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "radius (mm)": lambda one: f"{one.value:g}",
        "bending stiffness (1)": lambda one: f"{_stiffness(one.value):.2f}",
        "open loop (cm)": lambda one: words.all_in_cm(one.held_m) if one.hold else words.NOTHING,
        "closed loop (cm)": lambda one: words.all_in_cm(one.walked_m),
        "deficit, first helix (%)": lambda one: words.in_percent(one.closed.summary.middle_deficit),
        "median force (N)": lambda one: words.in_unit(one.force_N),
        "rhythm": lambda one: words.rhythm(one.rhythm),
    }
    return Findings(
        answer=f"Strands of {thick:g} in place of {thin:g} mm are {_stiffness(thick):.1f} times as stiff in bending. "
        f"The elongation of segment 1 in open loop goes {held}. The median force in closed loop goes {forces}. At "
        f"{thick:g} mm, {len(keep)} of {len(thickest)} worms keep the order 1-2-3: {words.labels(keep)}.",
        caption="Top: elongation (mean of six springs) over the strands' radius at the same mass, in closed loop "
        "(filled, largest in 5 s) and in open loop (empty, each segment held by itself). Bottom: median muscle force "
        "while contracted, and the rhythm, both in closed loop. One run a point. Bending stiffness goes with the "
        "fourth power of the radius.",
        table=tabulated(readings, columns),
        remarks=remarks,
        numbers={"bending_stiffness_ratio": _stiffness(thick), **numbers},
    )


def _draw(readings: Sequence[Reading], stem: Path) -> None:
    with canvas(5.0) as figure:
        panels = figure.subplot_mosaic("abc;frr", height_ratios=[3.0, 2.2])
        tops = [panels[name] for name in "abc"]
        for axes, (worm, own) in zip(tops, design.by_worm(readings).items(), strict=True):
            held = [one for one in own if one.hold]
            design.draw_over(axes, own, lambda one: CM * one.walked_m, linestyle="-")
            design.draw_over(axes, held, lambda one: CM * one.held_m, hollow=True, linestyle="--", linewidth=1.0)
            axes.sharey(tops[0])
            design.label_panel(axes, words.capitalised(worm.label), "strand radius (mm)", "")
        tops[0].set_ylabel("elongation (cm)")
        tops[0].set_ylim(bottom=0.0)
        force, rhythms = panels["f"], panels["r"]
        design.draw_over(force, readings, lambda one: one.force_N)
        force.set_ylim(bottom=0.0)
        kinds = design.draw_rhythms(rhythms, readings)
        design.label_panel(force, "Force", "strand radius (mm)", "median force (N)")
        design.label_panel(rhythms, "Rhythm", "strand radius (mm)", "")
        ticks = [MM * radius for radius in RADII_M]
        for axes in panels.values():
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.set_xlim(ticks[0] - 0.1, ticks[-1] + 0.1)
        loops = [
            design.look_handle("closed loop", marker="o"),
            design.look_handle("open loop", hollow=True, marker="o", linestyle="--"),
        ]
        design.legend_below(figure, [*design.segment_handles(), *loops, *design.worm_handles(), *kinds], 4)
        save_both(figure, stem)


RADIUS = Examination(
    "radius",
    "Radius of the strands",
    "Thicker strands of the same mass resist bending more. What becomes of elongation, force and rhythm?",
    lambda effort: design.cases_of(_points(effort)),
    _examine,
)

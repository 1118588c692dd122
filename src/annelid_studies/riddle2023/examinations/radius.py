"""The strands' radius at the same mass: elongation, force and rhythm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from annelid.draw import canvas, save_both
from annelid.experiment import Store
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Findings, examination, findings
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
    tolerances = words.by_worm(thinnest.values(), lambda one: f"{MM * one.worm.tolerance_m:g} mm")
    held = words.by_worm(
        [one for one in thickest if one.hold],
        lambda one: f"from {words.in_cm(thinnest[one.worm].held_m[0])} to {words.in_cm(one.held_m[0])} cm",
    )
    forces = words.by_worm(
        thickest, lambda one: f"from {words.in_unit(thinnest[one.worm].force_N)} to {words.in_unit(one.force_N)} N"
    )
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "radius (mm)": lambda one: f"{one.value:g}",
        "bending stiffness (1)": lambda one: f"{_stiffness(one.value):.2f}",
        "open loop (cm)": lambda one: words.all_in_cm(one.held_m) if one.hold else words.DASH,
        "closed loop (cm)": lambda one: words.all_in_cm(one.walked_m),
        "deficit, first helix (%)": lambda one: words.in_percent(one.closed.summary.middle_deficit),
        "median force (N)": lambda one: words.in_unit(one.force_N),
        "rhythm": lambda one: words.rhythm(one.rhythm),
    }
    found = {
        "thin": thin,
        "thick": thick,
        "stiffer": _stiffness(thick),
        "held": held,
        "forces": forces,
        "n_walking": len(keep),
        "n": len(thickest),
        "walking": words.labels(keep),
        "rhythms": "; ".join(f"{one.worm.label}: {words.rhythm(one.rhythm)}" for one in thickest),
        "tolerances": tolerances,
        "worms": words.labels(thickest),
    }
    remarks = ["rhythms", *(["quick"] if effort == "quick" else [])]
    return findings("radius", found, tabulated(readings, columns), remarks)


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


RADIUS = examination("radius", lambda effort: design.cases_of(_points(effort)), _examine)

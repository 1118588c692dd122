"""The strands' radius at the same mass: elongation, force and rhythm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from annelid.draw import canvas, save_both
from annelid.experiment import Case
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations import design, plots, words
from annelid_studies.riddle2023.examinations.design import PAPERS, WORMS, Point, Reading, Worm
from annelid_studies.riddle2023.examinations.words import CM, MM
from annelid_studies.tables import tabulated
from annelid_studies.worms import one_after_the_other

RADII_M = (0.002, 0.00233, 0.00299)
"""The paper's strands, and the two radii of the authors' later files."""

_FIELD = "body.strands.radius_m"


def _radii(worm: Worm, effort: Effort) -> Sequence[float]:
    if effort == "full":
        return RADII_M
    return RADII_M[:1] if worm is PAPERS else RADII_M[::2]


def _points(effort: Effort) -> list[Point]:
    return [
        Point(worm, radius, worm.case({_FIELD: radius}), _hold(worm, radius))
        for worm in WORMS
        for radius in _radii(worm, effort)
    ]


def _hold(worm: Worm, radius_m: float) -> Case | None:
    if worm is PAPERS and radius_m != RADII_M[0]:
        return None
    return worm.case({**one_after_the_other(), _FIELD: radius_m})


def _stiffness(radius_m: float) -> float:
    """Bending stiffness relative to that of the paper's strands."""
    return (radius_m / RADII_M[0]) ** 4


def _examine(results: Results, effort: Effort, stem: Path) -> Findings:
    readings = design.read(_points(effort), results)
    _draw(readings, stem)
    thinnest = {one.worm: one for one in readings if one.value == RADII_M[0]}
    thickest = [one for one in readings if one.value == RADII_M[-1]]
    keep = [one for one in thickest if one.walks]
    # Names of numbers tell the radius in micrometres.
    in_micrometres = [Reading(one.worm, 1e6 * one.value, one.walk, one.hold) for one in readings]
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
    tolerances = words.told(thinnest.values(), lambda one: f"{MM * one.worm.tolerance_m:g} mm")
    remarks = [
        f"At {MM * RADII_M[-1]:g} mm: {'; '.join(f'{one.worm.label}: {words.rhythm(one.rhythm)}' for one in thickest)}."
        f" The sensor tolerances are those of the presets, {tolerances}, which were found for the paper's radius."
    ]
    if effort == "quick":
        remarks.append(f"The quick effort varies the radius of {words.labels(thickest)} only.")

    def held_change(one: Reading) -> str:
        return f"from {words.in_cm(thinnest[one.worm].held_m[0])} to {words.in_cm(one.held_m[0])} cm"

    def force_change(one: Reading) -> str:
        return f"from {words.in_unit(thinnest[one.worm].force_N)} to {words.in_unit(one.force_N)} N"

    return Findings(
        answer=(
            f"Strands of {MM * RADII_M[-1]:g} in place of {MM * RADII_M[0]:g} mm are {_stiffness(RADII_M[-1]):.1f} "
            "times as stiff in bending. The elongation of segment 1 in open loop goes "
            f"{words.told([one for one in thickest if one.hold], held_change)}. The median force in closed loop goes "
            f"{words.told(thickest, force_change)}. At {MM * RADII_M[-1]:g} mm, {len(keep)} of {len(thickest)} worms "
            f"keep the order 1-2-3: {words.labels(keep)}."
        ),
        caption=(
            "Top: elongation (mean of six springs) over the strands' radius at the same mass, in closed loop (filled, "
            "largest in 5 s) and in open loop (empty, each segment held by itself). Bottom: median muscle force while "
            "contracted, and the rhythm, both in closed loop. One run a point. Bending stiffness goes with the fourth "
            "power of the radius."
        ),
        table=tabulated(
            readings,
            {
                "worm": lambda one: one.worm.label,
                "radius (mm)": lambda one: f"{MM * one.value:g}",
                "bending stiffness (1)": lambda one: f"{_stiffness(one.value):.2f}",
                "open loop (cm)": lambda one: words.all_in_cm(one.held_m) if one.hold else words.NOTHING,
                "closed loop (cm)": lambda one: words.all_in_cm(one.walked_m),
                "deficit, first helix (%)": lambda one: words.in_percent(one.helix_deficit),
                "median force (N)": lambda one: words.in_unit(one.force_N),
                "rhythm": lambda one: words.rhythm(one.rhythm),
            },
        ),
        remarks=remarks,
        numbers={"bending_stiffness_ratio": _stiffness(RADII_M[-1]), **numbers},
    )


def _draw(readings: Sequence[Reading], stem: Path) -> None:
    def in_mm(one: Reading) -> float:
        return MM * one.value

    with canvas(5.0) as figure:
        panels = figure.subplot_mosaic("abc;frr", height_ratios=[3.0, 2.2])
        tops = [panels[name] for name in "abc"]
        for axes, (worm, own) in zip(tops, design.by_worm(readings).items(), strict=True):
            held = [one for one in own if one.hold]
            plots.draw_over(axes, own, lambda one: CM * one.walked_m, at=in_mm, linestyle="-")
            plots.draw_over(
                axes, held, lambda one: CM * one.held_m, at=in_mm, hollow=True, linestyle="--", linewidth=1.0
            )
            axes.sharey(tops[0])
            plots.label_panel(axes, words.capitalised(worm.label), "strand radius (mm)", "")
        tops[0].set_ylabel("elongation (cm)")
        tops[0].set_ylim(bottom=0.0)
        force, rhythms = panels["f"], panels["r"]
        plots.draw_over(force, readings, lambda one: one.force_N, at=in_mm)
        force.set_ylim(bottom=0.0)
        kinds = plots.draw_rhythms(rhythms, readings, at=in_mm)
        plots.label_panel(force, "Force", "strand radius (mm)", "median force (N)")
        plots.label_panel(rhythms, "Rhythm", "strand radius (mm)", "")
        ticks = [MM * radius for radius in RADII_M]
        for axes in panels.values():
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.set_xlim(ticks[0] - 0.1, ticks[-1] + 0.1)
        loops = [
            plots.look_handle("closed loop", marker="o"),
            plots.look_handle("open loop", hollow=True, marker="o", linestyle="--"),
        ]
        plots.legend_below(figure, [*plots.segment_handles(), *loops, *plots.worm_handles(), *kinds], 4)
        save_both(figure, stem)


RADIUS = Examination(
    name="radius",
    title="Radius of the strands",
    question="Thicker strands of the same mass resist bending more. What becomes of elongation, force and rhythm?",
    cases=lambda effort: design.cases_of(_points(effort)),
    examine=_examine,
)

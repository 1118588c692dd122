"""Crossings from soft to rigid: how far they part, and what that costs in elongation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from annelid.body import build_spec, worm_of
from annelid.config import field_value
from annelid.draw import canvas, save_both
from annelid.experiment import Case, Store
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Examination, Findings
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, SOFT, Columns, Point, Reading
from annelid_studies.riddle2023.examinations.ranges import compiled_ranges
from annelid_studies.riddle2023.words import CM, MM, PERCENT
from annelid_studies.tables import tabulated
from annelid_studies.worms import HOLD_S, TIGHT_CHAIN, Effort, chain, fast, one_after_the_other, rods

STIFFNESSES_N_PER_M = (12.0, 26.0, 50.0, 100.0, 300.0, 1000.0)
"""Ties of the rods; 25.5 N/m are the preset's."""
DAMPING_TIME_S = 0.04
"""Damping over stiffness of the ties, as the paper's pins have it, s."""
TIME_CONSTANTS_S = (0.0126, 0.01, 0.008)
"""Of the chain's pin constraints, beside the paper's 0.02 s."""
LONG_S = 3.0
"""A contraction long enough to settle, s."""

_FORMULATION = "body.formulation"
_TIGHT = {f"{_FORMULATION}.{name}": value for name, value in TIGHT_CHAIN.items() if name != "kind"}


def tie_stiffness_N_per_m(case: Case) -> float:
    """Stiffness of the tie between a pin and a strand, N/m, averaged over the pins; infinite where they share a vertex.

    A soft constraint with time constant T and impedance d at critical damping pulls with ``K = k d / R`` per
    violation, where ``k = 1 / (d T)^2`` and ``R = (1 - d) / d`` times the inverse mass of the pair.
    """
    config = case.config
    formulation = worm_of(config).formulation
    if formulation.has_rigid_crossings:
        return float("inf")
    if formulation.tie is not None:
        return formulation.tie.stiffness_N_per_m
    model = build_spec(config).compile()
    inverse_mass = model.body_invweight0[model.eq_obj1id, 0] + model.body_invweight0[model.eq_obj2id, 0]
    (_, impedance, _), time_s = (
        field_value(config, f"{_FORMULATION}.{name}") for name in ("pin_impedance", "pin_time_constant_s")
    )
    reference = 1.0 / (impedance * time_s) ** 2
    stiffness = reference * impedance / ((1.0 - impedance) / impedance * inverse_mass)
    return float(stiffness.mean())


def _tied(stiffness: float) -> dict[str, Any]:
    return {
        f"{_FORMULATION}.pin_stiffness_N_per_m": stiffness,
        f"{_FORMULATION}.pin_damping_Ns_per_m": round(DAMPING_TIME_S * stiffness, 6),
    }


_OWN_DAMPING = rods({**one_after_the_other(), "body.rings.length_range_m": compiled_ranges()})
_DAMPING = "body.strands.damping_time_s"
# Muscles and damping as the rods with soft crossings have them, so that the pins alone differ.
_HELD_TIGHT = _OWN_DAMPING.but({_DAMPING: field_value(fast().config, _DAMPING)})


def _points(effort: Effort) -> list[Point]:
    """The worms, softest pins first; the value is worked out later."""
    paper = chain(one_after_the_other())
    chains = [paper]
    if effort == "full":
        stiffer = [{f"{_FORMULATION}.pin_time_constant_s": value} for value in TIME_CONSTANTS_S]
        chains += [paper.but(changes) for changes in (*stiffer, _TIGHT)]
    walked = STIFFNESSES_N_PER_M if effort == "full" else STIFFNESSES_N_PER_M[1::3]
    sprung = [
        Point(SOFT, k, fast(_tied(k)) if k in walked else None, fast({**one_after_the_other(), **_tied(k)}))
        for k in STIFFNESSES_N_PER_M
    ]
    return [*(Point(PAPERS, 0.0, hold=case) for case in chains), *sprung, Point(RIGID, 0.0, rods(), _HELD_TIGHT)]


def _settling(effort: Effort) -> list[Case]:
    """Rods with rigid crossings, segment 1 held contracted for long: the damping of soft crossings, and their own."""
    long = one_after_the_other(1, hold_s=LONG_S)
    return [case.but(long) for case in (_HELD_TIGHT, _OWN_DAMPING)] if effort == "full" else []


def _examine(store: Store, effort: Effort, stem: Path) -> Findings:
    points = [one._replace(value=tie_stiffness_N_per_m(one.hold)) for one in _points(effort) if one.hold]
    readings = design.read(points, store)
    groups = design.by_worm(readings)
    chains, sprung, [tight] = groups[PAPERS], groups[SOFT], groups[RIGID]
    _draw(readings, stem)

    paper, stiffest = chains[0], chains[-1]
    paper_m, tight_m = paper.held_m[0], tight.held_m[0]
    gaps_m, ring_m, tight_ring_m = paper.at_holds("pin_gap_m"), _rings(paper)[0], _rings(tight)[0]
    own_m = design.held_elongation(store[_OWN_DAMPING])[0]
    settled = [design.held_elongation(store[case])[0] for case in _settling(effort)]
    walked = [one for one in sprung if one.walk]
    ordered = words.listed(f"{one.value:g}" for one in walked if one.walks)
    others = words.listed(f"{one.value:g} ({words.kind(one.closed.rhythm)})" for one in walked if not one.walks)
    common = [one for one in chains if sprung[0].value <= one.value <= sprung[-1].value]
    largest = max(abs(one.held_m[0] / _between(sprung, one.value) - 1.0) for one in common)
    remarks = [
        f"At {words.listed(f'{one.value:.0f}' for one in common)} N/m the chain's elongation is within "
        f"{PERCENT * largest:.0f} % of that of rods with soft crossings, read between their own values"
        f"{': the stiffness of the pins is what the two formulations have in common' if largest < 0.15 else ''}.",
        f"In closed loop the sensor tolerance is {MM * SOFT.tolerance_m:g} mm, which was chosen for ties of "
        f"{tie_stiffness_N_per_m(fast()):g} N/m. With it the rods walk 1-2-3 at {ordered} N/m, and not at {others} "
        f"N/m. Rigid crossings at {MM * RIGID.tolerance_m:g} mm: {words.rhythm(tight.rhythm)}.",
        "The rods with rigid crossings here have the muscles and the damping of those with soft ones, so that only the "
        "pins differ. With the damping of their own preset they elongate by "
        f"{words.in_cm(own_m)} cm, {_beside(own_m, tight_m)}.",
    ]
    if settled:
        passes = abs(settled[1] / settled[0] - 1.0) < 0.5 * abs(own_m / tight_m - 1.0)
        remarks.insert(
            1,
            "The stiffest chain here has ties of about "
            f"{_rounded(stiffest.value)} N/m and elongates by {words.in_cm(stiffest.held_m[0])} cm, "
            f"{_beside(stiffest.held_m[0], tight_m)} the rods with rigid crossings.",
        )
        remarks.append(
            f"Held for {LONG_S:g} s in place of {HOLD_S:g} s, rods with rigid crossings elongate by "
            f"{words.in_cm(settled[0])} cm with the damping of soft crossings and {words.in_cm(settled[1])} cm with "
            "their own: what the damping changes "
            f"{'passes; the readings are of meshes that still come to rest' if passes else 'lasts'}."
        )
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "tie (N/m)": lambda one: _rounded(one.value) if one is not tight else "rigid",
        "elongation of 1 / 2 / 3 (cm)": lambda one: words.all_in_cm(one.held_m),
        "largest gap (cm)": lambda one: words.all_in_cm(one.at_holds("pin_gap_m")) if one is not tight else "0",
        "ring (m)": lambda one: words.each_in_unit(_rings(one), digits=3),
        "closed loop": lambda one: words.rhythm(one.rhythm),
    }
    return Findings(
        answer=f"The paper's pins give like springs of {paper.value:.0f} N/m: with segment 1 held contracted, strands "
        f"part by up to {words.in_cm(gaps_m[0], 1)} cm at a pin, and the segment elongates by {words.in_cm(paper_m)} "
        f"cm. Rigid crossings give {words.in_cm(tight_m)} cm, {tight_m / paper_m:.1f} times as much, at rings of "
        f"{words.in_unit(ring_m)} and {words.in_unit(tight_ring_m)} m. Rods with ties of {sprung[-1].value:g} N/m "
        f"reach {words.in_percent(sprung[-1].held_m[0] / tight_m)} % of that.",
        caption="Open loop: each of the three segments is held contracted for 0.8 s in turn. Its elongation (mean of "
        "six springs), the largest gap at any pin, and its ring's length, over the stiffness of the tie between pin "
        f"and strand. One run a point; {len(chains)} of the paper's chain, {len(sprung)} of rods with sprung pins, one "
        "of rods with rigid crossings, drawn at the right edge. The rhythm is that of closed loops of 5 s.",
        table=tabulated(readings, columns),
        remarks=remarks,
        numbers={
            "stiffness_paper_N_per_m": paper.value,
            "elongation_paper_first_m": paper_m,
            "elongation_tight_first_m": tight_m,
            "elongation_sprung_at_paper_stiffness_first_m": _between(sprung, paper.value),
            "elongation_stiffest_chain_first_m": stiffest.held_m[0] if effort == "full" else None,
            "elongation_tight_own_damping_first_m": own_m,
            "elongation_tight_settled_first_m": settled[0] if settled else None,
            "tight_over_paper": tight_m / paper_m,
            "pin_gap_paper_m": gaps_m.max(),
            "ring_paper_first_m": ring_m,
            "ring_tight_first_m": tight_ring_m,
            "stiffnesses_that_walk_N_per_m": ordered,
        },
    )


def _rings(reading: Reading) -> np.ndarray:
    return reading.at_holds("ring_length_m")


def _between(sprung: Sequence[Reading], stiffness: float) -> float:
    """Elongation of the first segment of rods with soft crossings at a stiffness between those that were run."""
    known, elongation_m = [one.value for one in sprung], [one.held_m[0] for one in sprung]
    return float(np.interp(np.log(stiffness), np.log(known), elongation_m))


def _rounded(stiffness: float) -> str:
    return f"{float(f'{stiffness:.3g}'):,g}"


def _beside(value: float, reference: float) -> str:
    difference = value / reference - 1.0
    if abs(difference) < 0.005:
        return "the same as"
    return f"{PERCENT * abs(difference):.0f} % {'above' if difference > 0 else 'below'}"


def _draw(readings: Sequence[Reading], stem: Path) -> None:
    edge = 6.0 * max(one.value for one in readings if one.worm is not RIGID)
    readings = [replace(one, value=min(one.value, edge)) for one in readings]
    groups = design.by_worm(readings)
    with canvas(5.2) as figure:
        (elongation, gap), (ring, rhythm) = figure.subplots(2, 2)
        for axes, numbers in (
            (elongation, lambda one: CM * one.held_m),
            (gap, lambda one: CM * one.at_holds("pin_gap_m")),
            (ring, _rings),
        ):
            design.draw_over(axes, groups[SOFT], numbers)
            design.draw_over(axes, groups[PAPERS], numbers, hollow=True)
            if axes is not gap:
                design.draw_over(axes, groups[RIGID], numbers, linestyle="none", markersize=6.0)
        kinds = design.draw_rhythms(rhythm, readings)
        decades = [10.0**k for k in range(1, 6) if 10.0**k < 0.2 * edge]
        for axes, title, label in (
            (elongation, "Elongation", "elongation, held (cm)"),
            (gap, "Largest gap at a pin", "gap, held (cm)"),
            (ring, "Ring", "length, held (m)"),
            (rhythm, "Rhythm in closed loop", ""),
        ):
            design.label_panel(axes, title, "stiffness of a tie (N/m)", label, logarithmic=True)
            axes.set_xticks([*decades, edge], [*(f"{value:g}" for value in decades), "rigid"])
            axes.minorticks_off()
            axes.set_xlim(9.0, 1.5 * edge)
        elongation.set_ylim(bottom=0.0)
        gap.set_yscale("log")
        gap.minorticks_off()
        steps = [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0]
        low, high = gap.get_ylim()
        gap.set_yticks(shown := [step for step in steps if low <= step <= high], [f"{step:g}" for step in shown])
        looks = (PAPERS, {"hollow": True}), (SOFT, {}), (RIGID, {"linestyle": "none"})
        worms = [design.look_handle(**{**worm.look, "color": "0.25", **look}) for worm, look in looks]
        design.legend_below(figure, [*design.segment_handles(), *worms, *kinds], 3)
        save_both(figure, stem)


PINS = Examination(
    "pins",
    "Crossings, from soft to rigid",
    "The paper ties its strands with the engine's soft constraints. How soft are they, and what would tight "
    "pins change?",
    lambda effort: [*design.cases_of(_points(effort)), _OWN_DAMPING, *_settling(effort)],
    _examine,
)

"""Crossings from soft to rigid: how far they part, and what that costs in elongation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from annelid.body import build_spec, worm_of
from annelid.config import field_value
from annelid.experiment import Case, Store
from annelid_studies.papers import words
from annelid_studies.papers.report_parts import Findings
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, SOFT, Columns, Point, Reading
from annelid_studies.riddle2023.examinations.ranges import compiled_ranges
from annelid_studies.standard_cases import TIGHT_CHAIN, Effort, chain, fast, one_after_the_other, rods
from annelid_studies.tables import tabulated

STIFFNESSES_N_PER_M = (12.0, 26.0, 50.0, 100.0, 300.0, 1000.0)
"""Ties of the rods; 25.5 N/m are the preset's."""
DAMPING_TIME_S = 0.04
"""Damping over stiffness of the ties, as the paper's pins have it, s."""
TIME_CONSTANTS_S = (0.0126, 0.01, 0.008)
"""Of the chain's pin constraints, beside the paper's 0.02 s."""

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


_DAMPING = "body.strands.damping_time_s"
# Muscles and damping as the rods with soft crossings have them, so that the pins alone differ.
_HELD_TIGHT = rods(
    {
        **one_after_the_other(),
        "body.rings.length_range_m": compiled_ranges(),
        _DAMPING: field_value(fast().config, _DAMPING),
    }
)


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


def _examine(store: Store, effort: Effort) -> Findings:
    points = [one._replace(value=tie_stiffness_N_per_m(one.hold)) for one in _points(effort) if one.hold]
    readings = design.read(points, store)
    groups = design.by_worm(readings)
    chains, sprung, [tight] = groups[PAPERS], groups[SOFT], groups[RIGID]
    paper = chains[0]
    paper_m, tight_m = paper.held_m[0], tight.held_m[0]
    common = [one for one in chains if sprung[0].value <= one.value <= sprung[-1].value]
    largest = max(abs(one.held_m[0] / _between(sprung, one.value) - 1.0) for one in common)
    found: dict[str, Any] = {
        "stiffness": paper.value,
        "gap": paper.at_holds("pin_gap_m")[0],
        "paper": paper_m,
        "tight": tight_m,
        "ratio": tight_m / paper_m,
        "ring": _rings(paper)[0],
        "tight_ring": _rings(tight)[0],
        "stiffest": sprung[-1].value,
        "reached": sprung[-1].held_m[0] / tight_m,
        "common": words.listed(f"{one.value:.0f}" for one in common),
        "largest": largest,
        "alike": ": the stiffness of the pins is what the two formulations have in common" if largest < 0.15 else "",
    }
    remarks = ["formulations", "damping"]
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "tie (N/m)": lambda one: _rounded(one.value) if one is not tight else "rigid",
        "elongation of 1 / 2 / 3 (cm)": lambda one: words.all_in_cm(one.held_m),
        "largest gap (cm)": lambda one: words.all_in_cm(one.at_holds("pin_gap_m")) if one is not tight else "0",
        "ring (m)": lambda one: words.each_in_unit(_rings(one), digits=3),
        "closed loop": lambda one: words.rhythm(one.rhythm),
    }
    numbers = {"elongation_tight_first_m": tight_m}
    return design.findings("pins", found, tabulated(readings, columns), remarks, numbers)


def _rings(reading: Reading) -> np.ndarray:
    return reading.at_holds("ring_length_m")


def _between(sprung: Sequence[Reading], stiffness: float) -> float:
    """Elongation of the first segment of rods with soft crossings at a stiffness between those that were run."""
    known, elongation_m = [one.value for one in sprung], [one.held_m[0] for one in sprung]
    return float(np.interp(np.log(stiffness), np.log(known), elongation_m))


def _rounded(stiffness: float) -> str:
    return f"{float(f'{stiffness:.3g}'):,g}"


PINS = design.examination("pins", lambda effort: design.cases_of(_points(effort)), _examine)

"""Pins from soft to tight: how far they part, and what that costs in elongation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.body.assemble import build_spec
from annelid.body.formulations.chain import Chain
from annelid.body.formulations.rods import Rods
from annelid.body.worm import WormBody
from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import panel_title, segment_colors
from annelid.errors import ConfigError
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.ranges import compiled_ranges
from annelid_studies.riddle2023.examinations.side_by_side import (
    CM,
    NOTHING,
    PAPERS,
    SPRUNG,
    TIGHT,
    all_in_cm,
    draw_rhythms,
    draw_segments,
    held_elongation,
    in_cm,
    in_percent,
    in_unit,
    kept,
    legend_below,
    listed,
    look_handle,
    number,
    rhythm_kind,
    rhythm_words,
    segment_handles,
)
from annelid_studies.worms import HOLD_S, chain, fast, one_after_the_other, rods

STIFFNESSES_N_PER_M = (12.0, 21.5, 50.0, 100.0, 300.0, 1000.0)
"""Ties of the rods; 21.5 N/m are the preset's."""
DAMPING_TIME_S = 0.04
"""Damping over stiffness of the ties, as the paper's pins have it, s."""
TIME_CONSTANTS_S = (0.0126, 0.01, 0.008)
"""Of the chain's pin constraints, beside the paper's 0.02 s."""

LONG_S = 3.0
"""A contraction long enough to settle, s."""

_FORMULATION = "body.formulation"
_DIRECT = {
    f"{_FORMULATION}.pins": "direct",
    f"{_FORMULATION}.pin_time_constant_s": 0.004,
    f"{_FORMULATION}.pin_impedance": [0.95, 0.99, 0.001],
}


def tie_stiffness_N_per_m(case: Case) -> float:
    """Stiffness of the tie between a pin and a strand, N/m, averaged over the pins; infinite where they share a vertex.

    A soft constraint with time constant T and impedance d at critical damping pulls with ``K = k d / R`` per
    violation, where ``k = 1 / (d T)^2`` and ``R = (1 - d) / d`` times the inverse mass of the pair. Where strands are
    tied to each other without a pin between them, one tie does the work of two in series and counts double.

    Args:
        case: A case of a 3D worm.

    Raises:
        ConfigError: The case has no pins.
    """
    config = case.config
    if not isinstance(config.body, WormBody):
        raise ConfigError("a planar worm has no pins")
    formulation = config.body.formulation
    if isinstance(formulation, Rods):
        return formulation.pin_stiffness_N_per_m if formulation.pins == "separate" else float("inf")
    assert isinstance(formulation, Chain)
    model = build_spec(config).compile()
    inverse_mass = model.body_invweight0[model.eq_obj1id, 0] + model.body_invweight0[model.eq_obj2id, 0]
    impedance = formulation.pin_impedance[1]
    reference = 1.0 / (impedance * formulation.pin_time_constant_s) ** 2
    stiffness = reference * impedance / ((1.0 - impedance) / impedance * inverse_mass)
    return float(stiffness.mean()) * (2.0 if formulation.pins == "direct" else 1.0)


def _tied(stiffness: float) -> dict[str, Any]:
    return {
        f"{_FORMULATION}.pin_stiffness_N_per_m": stiffness,
        f"{_FORMULATION}.pin_damping_Ns_per_m": round(DAMPING_TIME_S * stiffness, 6),
    }


def _held_chains(effort: Effort) -> list[Case]:
    open_loop = one_after_the_other()
    paper = chain(open_loop)
    if effort == "quick":
        return [paper]
    softer = [paper.but({f"{_FORMULATION}.pin_time_constant_s": value}) for value in TIME_CONSTANTS_S]
    return [paper, *softer, paper.but(_DIRECT)]


def _held_rods() -> list[Case]:
    return [fast({**one_after_the_other(), **_tied(value)}) for value in STIFFNESSES_N_PER_M]


def _settling(effort: Effort) -> list[Case]:
    """Tight rods whose segment 1 is held contracted for long, with the sprung rods' damping and with their own."""
    long = one_after_the_other(1, hold_s=LONG_S)
    return [case.but(long) for case in (_HELD_TIGHT, _OWN_DAMPING)] if effort == "full" else []


def _walking(effort: Effort) -> list[Case]:
    stiffnesses = STIFFNESSES_N_PER_M if effort == "full" else STIFFNESSES_N_PER_M[1::3]
    return [fast(_tied(value)) for value in stiffnesses]


_OWN_DAMPING = rods({**one_after_the_other(), "body.rings.length_range_m": compiled_ranges()})


def _body(case: Case) -> WormBody:
    body = case.config.body
    assert isinstance(body, WormBody)
    return body


# Muscles and damping as the sprung rods have them, so that the pins alone differ.
_HELD_TIGHT = _OWN_DAMPING.but({"body.strands.damping_time_s": _body(fast()).strands.damping_time_s})


def _cases(effort: Effort) -> Sequence[Case]:
    return [
        *_held_chains(effort),
        *_held_rods(),
        _HELD_TIGHT,
        _OWN_DAMPING,
        *_settling(effort),
        *_walking(effort),
        rods(),
    ]


class _Held(NamedTuple):
    """Readings of one worm's open-loop runs, softest pins first."""

    stiffness: NDArray[np.float64]
    elongation_m: NDArray[np.float64]
    gap_m: NDArray[np.float64]
    ring_m: NDArray[np.float64]


def _held(cases: Sequence[Case], results: Results) -> _Held:
    outcomes = [results[case] for case in cases]
    return _Held(
        np.array([tie_stiffness_N_per_m(case) for case in cases]),
        np.array([held_elongation(outcome) for outcome in outcomes]),
        np.array([_of_holds(outcome, "pin_gap_m") for outcome in outcomes]),
        np.array([_of_holds(outcome, "ring_length_m") for outcome in outcomes]),
    )


def _of_holds(outcome: Outcome, name: str) -> NDArray[np.float64]:
    values = np.full(outcome.summary.n_segments, np.nan)
    for hold in outcome.holds:
        values[hold.segment - 1] = number(getattr(hold, name))
    return values


def _examine(results: Results, effort: Effort, stem: Path) -> Findings:
    chains, sprung = _held(_held_chains(effort), results), _held(_held_rods(), results)
    tight = _held([_HELD_TIGHT], results)
    walking = [(tie_stiffness_N_per_m(case), results[case]) for case in _walking(effort)]
    walking_tight = results[rods()]
    _draw(chains, sprung, tight, walking, walking_tight, stem)

    paper_m, tight_m = chains.elongation_m[0, 0], tight.elongation_m[0, 0]
    last = sprung.elongation_m[-1, 0]
    own_m = float(held_elongation(results[_OWN_DAMPING])[0])
    ordered = [f"{k:g}" for k, outcome in walking if outcome.rhythm.is_one_wave]
    others = [f"{k:g} ({rhythm_kind(o.rhythm)})" for k, o in walking if not o.rhythm.is_one_wave]
    at_paper = _at(chains.stiffness[0], sprung)
    answer = (
        f"The paper's pins give like springs of {chains.stiffness[0]:.0f} N/m: with segment 1 held contracted, strands "
        f"part by up to {in_cm(chains.gap_m[0, 0], 1)} cm at a pin, and the segment elongates by {in_cm(paper_m)} cm. "
        f"Tight pins give {in_cm(tight_m)} cm, {tight_m / paper_m:.1f} times as much, at rings of "
        f"{in_unit(chains.ring_m[0, 0])} and {in_unit(tight.ring_m[0, 0])} m. "
        f"Rods with ties of {sprung.stiffness[-1]:g} N/m reach {in_percent(last / tight_m)} % of that."
    )
    walk = (
        f"In closed loop the sensor tolerance is {fast().config.sensor.tolerance_m * 1e3:g} mm, which was chosen for "
        f"ties of {tie_stiffness_N_per_m(fast()):g} N/m. "
        f"With it the rods walk 1-2-3 at {listed(ordered)} N/m, and not at {listed(others)} N/m. Tight pins at "
        f"{rods().config.sensor.tolerance_m * 1e3:g} mm: {rhythm_words(walking_tight.rhythm)}."
    )
    common = [
        (k, elongation[0] / _at(k, sprung) - 1.0)
        for k, elongation in zip(chains.stiffness, chains.elongation_m, strict=True)
        if sprung.stiffness[0] <= k <= sprung.stiffness[-1]
    ]
    largest = max(abs(difference) for _, difference in common)
    remarks = [
        f"At {listed([f'{k:.0f}' for k, _ in common])} N/m the chain's elongation is within {100 * largest:.0f} % of "
        "that of sprung rods, read between their own values"
        + (
            ": the stiffness of the pins, in N/m, is what the two formulations have in common."
            if largest < 0.15
            else "."
        ),
        walk,
        "The tight rods here have the muscles and the damping of the sprung ones, so that only the pins differ. "
        f"With the damping of their own preset they elongate by {in_cm(own_m)} cm, {_beside(own_m, tight_m)}.",
    ]
    settled = [float(held_elongation(results[case])[0]) for case in _settling(effort)]
    if settled:
        remarks.append(
            f"Held for {LONG_S:g} s in place of {HOLD_S:g} s, tight rods elongate by {in_cm(settled[0])} cm with the "
            f"sprung rods' damping and {in_cm(settled[1])} cm with their own: "
            + (
                "what the damping changes passes; the readings are of meshes still on their way to rest."
                if abs(settled[1] / settled[0] - 1.0) < 0.5 * abs(own_m / tight_m - 1.0)
                else "what the damping changes lasts."
            )
        )
    if effort == "full":
        remarks.insert(
            1,
            "The stiffest chain here, its strands tied to each other without pin masses, has ties of "
            f"about {_rounded(chains.stiffness[-1])} N/m and elongates by {in_cm(chains.elongation_m[-1, 0])} cm, "
            f"{_beside(chains.elongation_m[-1, 0], tight_m)} the tight rods.",
        )
    return Findings(
        answer=answer,
        caption=(
            "Open loop: each of the three segments is held contracted for 0.8 s in turn. Its elongation (mean of six "
            "springs), the largest gap at any pin, and its ring's length, over the stiffness of the tie between pin "
            f"and strand. One run a point; {len(chains.stiffness)} of the paper's chain, {len(sprung.stiffness)} of "
            "rods with sprung pins, one of rods with tight pins, drawn at the right edge. The rhythm is that of "
            "closed loops of 5 s."
        ),
        table=_table(chains, sprung, tight, walking, walking_tight),
        remarks=remarks,
        numbers={
            "stiffness_paper_N_per_m": kept(chains.stiffness[0]),
            "elongation_paper_first_m": kept(paper_m),
            "elongation_tight_first_m": kept(tight_m),
            "elongation_sprung_at_paper_stiffness_first_m": kept(at_paper),
            "elongation_stiffest_chain_first_m": kept(chains.elongation_m[-1, 0]) if effort == "full" else None,
            "elongation_tight_own_damping_first_m": kept(own_m),
            "elongation_tight_settled_first_m": kept(settled[0]) if settled else None,
            "tight_over_paper": kept(tight_m / paper_m),
            "pin_gap_paper_m": kept(float(chains.gap_m[0].max())),
            "ring_paper_first_m": kept(chains.ring_m[0, 0]),
            "ring_tight_first_m": kept(tight.ring_m[0, 0]),
            "stiffnesses_that_walk_N_per_m": listed(ordered),
        },
    )


def _at(stiffness: float, sprung: _Held) -> float:
    """Elongation of the first segment of sprung rods at a stiffness between those that were run."""
    return float(np.interp(np.log(stiffness), np.log(sprung.stiffness), sprung.elongation_m[:, 0]))


def _rounded(stiffness: float) -> str:
    return f"{float(f'{stiffness:.3g}'):,g}"


def _beside(value: float, reference: float) -> str:
    difference = value / reference - 1.0
    if abs(difference) < 0.005:
        return "the same as"
    return f"{100 * abs(difference):.0f} % {'above' if difference > 0 else 'below'}"


def _table(
    chains: _Held, sprung: _Held, tight: _Held, walking: Sequence[tuple[float, Outcome]], walking_tight: Outcome
) -> Table:
    rhythms = {f"{k:g}": rhythm_words(outcome.rhythm) for k, outcome in walking}
    rows = []
    for worm, held in ((PAPERS, chains), (SPRUNG, sprung), (TIGHT, tight)):
        for i, k in enumerate(held.stiffness):
            closed = rhythms.get(f"{k:g}", NOTHING) if worm is SPRUNG else NOTHING
            rows.append(
                [
                    worm.label,
                    _rounded(k) if np.isfinite(k) else "tight",
                    all_in_cm(held.elongation_m[i]),
                    all_in_cm(held.gap_m[i]) if worm is not TIGHT else "0",
                    " / ".join(in_unit(float(ring), 1.0, 3) for ring in held.ring_m[i]),
                    rhythm_words(walking_tight.rhythm) if worm is TIGHT else closed,
                ]
            )
    return Table(
        ["worm", "tie (N/m)", "elongation of 1 / 2 / 3 (cm)", "largest gap (cm)", "ring (m)", "closed loop"], rows
    )


def _draw(
    chains: _Held,
    sprung: _Held,
    tight: _Held,
    walking: Sequence[tuple[float, Outcome]],
    walking_tight: Outcome,
    stem: Path,
) -> None:
    edge = 6.0 * max(chains.stiffness.max(), sprung.stiffness.max())
    decades = [10.0**k for k in range(1, 6) if 10.0**k < 0.2 * edge]
    n_segments = tight.elongation_m.shape[1]
    with canvas(5.2) as figure:
        (elongation, gap), (ring, rhythm) = figure.subplots(2, 2)
        for axes, name, scale in ((elongation, "elongation_m", CM), (gap, "gap_m", CM), (ring, "ring_m", 1.0)):
            for worm, held in ((SPRUNG, sprung), (PAPERS, chains)):
                values = getattr(held, name) * scale
                look = {"marker": worm.marker, "linestyle": worm.line, "hollow": worm is PAPERS}
                draw_segments(axes, held.stiffness.tolist(), values, **look)
            if axes is not gap:
                for value, color in zip(getattr(tight, name)[0] * scale, segment_colors(n_segments), strict=True):
                    axes.plot([edge], [value], marker=TIGHT.marker, color=color, markersize=6.0)
        rows = [
            (SPRUNG.short, [(k, outcome.rhythm) for k, outcome in walking]),
            (TIGHT.short, [(edge, walking_tight.rhythm)]),
        ]
        handles = draw_rhythms(rhythm, rows)
        elongation.set_ylim(bottom=0.0)
        gap.set_yscale("log")
        for axes, title, label in (
            (elongation, "Elongation", "elongation, held (cm)"),
            (gap, "Largest gap at a pin", "gap, held (cm)"),
            (ring, "Ring", "length, held (m)"),
            (rhythm, "Rhythm in closed loop", ""),
        ):
            panel_title(axes, title)
            axes.set_ylabel(label)
            axes.set_xscale("log")
            axes.set_xlim(9.0, 1.5 * edge)
            axes.set_xticks([*decades, edge], [*(f"{value:g}" for value in decades), "tight"])
            axes.minorticks_off()
            axes.set_xlabel("stiffness of a tie (N/m)")
        steps = [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0]
        low, high = gap.get_ylim()
        gap.set_yticks(shown := [step for step in steps if low <= step <= high], [f"{step:g}" for step in shown])
        worms = [
            look_handle(worm.label, marker=worm.marker, linestyle=worm.line, hollow=worm is PAPERS)
            for worm in (PAPERS, SPRUNG)
        ]
        worms.append(look_handle(TIGHT.label, marker=TIGHT.marker, linestyle="none"))
        legend_below(figure, [*segment_handles(n_segments), *worms, *handles], 3)
        save_both(figure, stem)


PINS = Examination(
    name="pins",
    title="Pins, from soft to tight",
    question="The paper ties its strands with the engine's soft constraints. How soft are they, and what would tight "
    "pins change?",
    cases=_cases,
    examine=_examine,
)

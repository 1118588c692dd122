"""Results: order, period, elongations, cost."""

from __future__ import annotations

from annelid.simulation.runfile import Run
from annelid.studies.case import FAST, Case
from annelid.studies.claims.evidence import (
    MAIN,
    PAPER_STEPS,
    PAPER_WALL_S,
    Evidence,
    centimetres,
    holds_if,
    nearness,
    order_of,
)
from annelid.studies.contents import Claim
from annelid.studies.outcome import Outcome


def result_claims(evidence: Evidence, outcome: Outcome, main: Run) -> list[Claim]:
    """Judges the claims about order, period, elongations and cost."""
    summary = outcome.summary
    lengths = [value or float("nan") for value in summary.elongation_first_helix_pp_m or ()]
    claims = [
        Claim(
            "Results",
            "The wave runs from segment 1 to 3 and repeats, as in 2D.",
            "section 3, Fig. 7",
            holds_if(outcome.rhythm.verdict == "ordered" and outcome.rhythm.direction == 1),
            "1-2-3",
            f"{order_of(outcome)}, {outcome.rhythm.verdict}",
            outcome.rhythm.reason[:1].upper() + outcome.rhythm.reason[1:] + ".",
            MAIN.command,
        )
    ]
    period = outcome.rhythm.period_s or float("nan")
    verdict, within = nearness(period, 2.635)
    claims.append(
        Claim(
            "Results",
            "A cycle of the three-segment worm takes about 2.6 s.",
            "Fig. 7",
            verdict,
            "2.635 s (2D, toolbox order, 2.631 s)",
            f"{period:.3f} s",
            "The network sets it: 875 ms a segment at a gate time constant of 300 ms.",
            MAIN.command,
            within,
        )
    )
    for segment, (ours, paper) in enumerate(zip(lengths, (0.0420, 0.0255, 0.0402), strict=True), start=1):
        verdict, within = nearness(ours, paper)
        claims.append(
            Claim(
                "Results",
                f"Segment {segment} elongates by at most {100 * paper:.2f} cm.",
                "section 3",
                verdict,
                f"{100 * paper:.2f} cm",
                f"{100 * ours:.2f} cm (mean of six springs, above rest: "
                f"{centimetres((summary.elongation_mean_max_m or [])[segment - 1 : segment])})",
                "The spring on the first helix, peak to peak: the reading that comes nearest, since the paper does not "
                "say how it read its figure.",
                MAIN.command,
                within,
            )
        )
    deficit = summary.middle_deficit or float("nan")
    difference = summary.end_difference or float("nan")
    verdict, within = nearness(deficit, 0.394)
    claims.append(
        Claim(
            "Results",
            "Segment 2 elongates 39.4 % less than segment 1.",
            "section 3",
            verdict,
            "39.4 %",
            f"{100 * deficit:.1f} % ({100 * (summary.middle_deficit_mean or float('nan')):.1f} % in the mean of six)",
            "What it comes from is claimed, and examined, further below.",
            MAIN.command,
            within,
        )
    )
    verdict, within = nearness(difference, 0.0445)
    claims.append(
        Claim(
            "Results",
            "Segments 1 and 3 differ by 4.45 %.",
            "section 3",
            verdict,
            "4.45 %",
            f"{100 * difference:.1f} %",
            "It rests on segment 3, of which the main table gives what variants of the paper's formulation make. A "
            "difference of two large numbers is sensitive: it changes with time step and contacts.",
            MAIN.command,
            within,
        )
    )
    spent = (summary.duration_s or 0.0) / (summary.real_time_factor or float("nan"))
    quick = evidence.results[Case(FAST)].summary
    fast_s = (quick.duration_s or 0.0) / (quick.real_time_factor or float("nan"))
    claims.append(
        Claim(
            "Results",
            "5000 steps take 3.5 minutes.",
            "section 3",
            holds_if(spent <= PAPER_WALL_S),
            f"{1e3 * PAPER_WALL_S / PAPER_STEPS:.0f} ms a step",
            f"{1e3 * spent / PAPER_STEPS:.0f} ms a step, {spent:.0f} s; riddle2023-fast {fast_s:.0f} s",
            "The same formulation and step on one core; rooting each strand in its middle halves the cost.",
            MAIN.command,
        )
    )
    return claims

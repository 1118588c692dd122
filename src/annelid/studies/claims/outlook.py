"""Conclusions and future work: noise, friction, adaptive gaits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from annelid.studies.claims.evidence import (
    LABELS,
    PLANAR_CASES,
    Evidence,
    holds_if,
)
from annelid.studies.contents import Claim


def outlook_claims(evidence: Evidence) -> list[Claim]:
    """Judges the claims about noise, friction and what is to come."""
    rhythms = {tau: evidence.results[case].rhythm for tau, case in PLANAR_CASES.items()}
    periods = {tau: rhythm.period_s or float("nan") for tau, rhythm in rhythms.items()}
    in_order = all(rhythm.verdict == "ordered" and rhythm.direction == 1 for rhythm in rhythms.values())
    factor = max(periods.values()) / min(periods.values())
    return [
        _noise_claim(evidence.findings["noise"].numbers),
        _friction_claim(evidence.findings["friction"].numbers),
        Claim(
            "Future work",
            "A central pattern generator of adaptive frequency is feasible in this network.",
            "section 5",
            holds_if(in_order and factor > 2),
            "should be feasible",
            ", ".join(f"{tau} ms: {period:.3f} s" for tau, period in periods.items()),
            f"The gate's time constant sets the period over a factor of {factor:.1f} (planar worm). A drive that "
            "changes it is the controller of kind adaptive.",
            PLANAR_CASES[100].command,
        ),
        Claim(
            "Future work",
            "Pressure and stretch sensors together detect slip reliably.",
            "section 5",
            "not testable here",
            "shown by Wang on the robot",
            "-",
            "The model has contact forces for every segment, but no slip detector to judge yet.",
            "annelid show RUN --json",
        ),
    ]


def _noise_claim(noise: Mapping[str, Any]) -> Claim:
    tested = {worm: float(noise[f"noise_tested_{worm}"]) for worm in LABELS}
    handled = {worm: float(noise[f"noise_handled_{worm}"]) for worm in LABELS}
    judged = "chain" if tested["chain"] > 0 else "fast"
    listed = "; ".join(
        f"{1e3 * handled[worm]:g} of {1e3 * tested[worm]:g} mm ({label})"
        for worm, label in LABELS.items()
        if tested[worm] > 0
    )
    own_step = noise.get("walking_share_noisy_papers_step")
    windows = ", ".join(f"{noise[f'window_{worm}']} ({label})" for worm, label in LABELS.items())
    return Claim(
        "Future work",
        "Sensor noise can be accounted for by adjusting the sensors' threshold.",
        "section 5",
        holds_if(handled[judged] >= tested[judged] and (own_step is None or own_step == 1.0)),
        "as simple as that, not validated",
        f"handled: {listed}",
        "Largest noise (standard deviation of every reading) under which some threshold keeps every seed in the wave "
        f"1-2-3, of the largest tested. Without noise the wave runs at thresholds of {windows}."
        + (
            ""
            if own_step is None
            else f" At the paper's own step and threshold {100 * own_step:.0f} % of the runs keep it under the largest."
        ),
        "annelid paper --only noise",
    )


def _friction_claim(friction: Mapping[str, Any]) -> Claim:
    travels = {
        (worm, float(name.split("_")[2])): float(value)
        for worm in LABELS
        for name, value in friction.items()
        if name.startswith("travel_friction_") and name.endswith(f"_{worm}_m")
    }
    gains = {
        (worm, mu): abs(travel / travels[worm, 1.0])
        for (worm, mu), travel in travels.items()
        if str(friction[f"verdict_friction_{mu:g}_{worm}"]).startswith("1-2-3")
    }
    (worm, mu), gain = max(gains.items(), key=lambda item: item[1])
    walking = ", ".join(f"{friction[f'frictions_that_walk_{worm}']} ({label})" for worm, label in LABELS.items())
    return Claim(
        "Future work",
        "The small speed is largely due to an unoptimised coefficient of friction.",
        "section 5",
        holds_if(gain > 2),
        "friction 1 is not optimal",
        f"largest travel while walking in order: {1e3 * travels[worm, mu]:+.0f} mm in 5 s at friction {mu:g} "
        f"({LABELS[worm]}), {gain:.1f} times that at friction 1",
        f"All other things as they are. Worms keep the order 1-2-3 at frictions {walking}.",
        "annelid paper --only friction",
    )

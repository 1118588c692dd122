"""Conclusions and future work: noise, friction, adaptive gaits."""

from __future__ import annotations

from annelid.studies.claims.evidence import (
    PLANAR_CASES,
    Evidence,
    holds_if,
)
from annelid.studies.contents import Claim


def outlook_claims(evidence: Evidence) -> list[Claim]:
    """Judges the claims about noise, friction and what is to come."""
    noise = evidence.findings["noise"].numbers
    worms = {worm: noise.get(f"noise_handled_{worm}") for worm in ("chain", "fast", "rods")}
    judged = worms["chain"] if worms["chain"] is not None else worms["fast"]
    handled = "; ".join(
        f"{worm} up to {1e3 * float(limit):.0f} mm" for worm, limit in worms.items() if limit is not None
    )
    periods = {tau: evidence.results[case].rhythm.period_s for tau, case in PLANAR_CASES.items()}
    friction = evidence.findings["friction"].numbers
    travels = [value for name, value in friction.items() if name.startswith("travel_") and isinstance(value, float)]
    return [
        Claim(
            "Future work",
            "Sensor noise can be accounted for by adjusting the sensors' threshold.",
            "section 5",
            "not testable here" if judged is None else holds_if(float(judged) >= 0.001),
            "as simple as that, not validated",
            handled or "-",
            "Largest noise (standard deviation) for which some threshold keeps every seed in order. On the soft pins "
            "the window of the threshold is no wider than the noise it would have to bear; on tight pins it is.",
            "annelid paper --only noise",
        ),
        Claim(
            "Future work",
            "The small speed is largely due to an unoptimised coefficient of friction.",
            "section 5",
            "not testable here" if not travels else holds_if(max(map(abs, travels)) > 0.15),
            "friction 1 is not optimal",
            "-" if not travels else f"travel in 5 s between {1e3 * min(travels):.0f} and {1e3 * max(travels):.0f} mm",
            "Friction 0.05 to 1.5, three worms, all other things as they are.",
            "annelid paper --only friction",
        ),
        Claim(
            "Future work",
            "A central pattern generator of adaptive frequency is feasible in this network.",
            "section 5",
            holds_if(all(period is not None for period in periods.values())),
            "should be feasible",
            ", ".join(f"{tau} ms: {period:.3f} s" for tau, period in periods.items() if period is not None),
            "The gate's time constant sets the period over a factor of more than two, in order throughout (planar "
            "worm). A drive that changes it while the worm walks remains to be built.",
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

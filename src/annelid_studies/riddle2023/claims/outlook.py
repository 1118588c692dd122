"""Conclusions and future work: noise, friction, adaptive gaits, slip detection."""

from __future__ import annotations

from functools import partial
from math import nan

from annelid.analysis.detector import detect, score
from annelid_studies.riddle2023.claims.evidence import (
    LABELS,
    PLANAR_CASES,
    Evidence,
    judged,
    slip_runs,
)
from annelid_studies.riddle2023.contents import Claim
from annelid_studies.riddle2023.examinations.design import WORMS
from annelid_studies.riddle2023.examinations.friction import PAPERS_FRICTION, frictions_of
from annelid_studies.riddle2023.examinations.words import span
from annelid_studies.slip import detection

_claim = partial(Claim, "Future work")
RELIABLE = 0.9
"""Precision and recall from which we call a detector reliable."""
MUCH = 2.0
"""From so many times the travel, or the rate, on we call a difference large."""


def outlook_claims(evidence: Evidence) -> list[Claim]:
    """Judges the claims about noise, friction and what is to come."""
    rhythms = {tau: evidence.results[case].rhythm for tau, case in PLANAR_CASES.items()}
    periods = {tau: rhythm.period_s or nan for tau, rhythm in rhythms.items()}
    factor = max(periods.values()) / min(periods.values())
    adaptive = judged([*(rhythm.is_one_wave for rhythm in rhythms.values()), factor > MUCH], "the time constant")
    return [
        noise_claim(evidence),
        friction_claim(evidence),
        _claim(
            "A central pattern generator of adaptive frequency is feasible in this network.",
            "section 5",
            "should be feasible",
            ", ".join(f"{tau} ms: {period:.3f} s" for tau, period in periods.items()),
            f"It holds if the planar worm walks 1-2-3 at every one of these time constants of the gate and the period "
            f"spans a factor of {MUCH:g}; it spans {factor:.1f}. A drive that changes it is the controller of kind "
            "adaptive.",
            PLANAR_CASES[100].command,
            *adaptive,
        ),
        _slip_claim(evidence),
    ]


def noise_claim(evidence: Evidence) -> Claim:
    """Judges the claim about noise and thresholds."""
    tested = {worm: evidence.number("noise", f"noise_tested_{worm}") for worm in LABELS}
    handled = {worm: evidence.number("noise", f"noise_handled_{worm}") for worm in LABELS}
    noisy = [worm for worm in LABELS if tested[worm] > 0]
    shares = [evidence.number("noise", "walking_share_noisy_papers_step")] if evidence.effort == "full" else []
    listed = "; ".join(f"{1e3 * handled[worm]:g} of {1e3 * tested[worm]:g} mm ({LABELS[worm]})" for worm in noisy)
    windows = ", ".join(f"{evidence.words('noise', f'window_{worm}')} ({LABELS[worm]})" for worm in LABELS)
    own = (
        f" At the paper's own step and threshold {100 * shares[0]:.0f} % of the runs keep it at 2 mm." if shares else ""
    )
    return _claim(
        "Sensor noise can be accounted for by adjusting the sensors' threshold.",
        "section 5",
        "as simple as that, not validated",
        f"handled: {listed}",
        "Largest noise (standard deviation of every reading) under which some threshold keeps every seed in the wave "
        f"1-2-3, of the largest tested; it holds if that is the largest tested, for every worm. Without noise the wave "
        f"runs at thresholds of {windows}.{own}",
        "annelid paper --only noise",
        *judged((handled[worm] >= tested[worm] for worm in noisy), "the worm"),
    )


def friction_claim(evidence: Evidence) -> Claim:
    """Judged for every worm by itself, travel forwards only, as the paper asks for locomotion."""
    told, gains = [], []
    for worm in WORMS:
        tried = frictions_of(worm, evidence.effort)
        if len(tried) == 1:
            continue
        travel = {mu: evidence.number("friction", f"travel_friction_{mu:g}_{worm.name}_m") for mu in tried}
        walking = [
            mu for mu in tried if evidence.words("friction", f"verdict_friction_{mu:g}_{worm.name}").startswith("1-2-3")
        ]
        best = max(walking, key=lambda mu: travel[mu], default=PAPERS_FRICTION)
        gains.append(travel[best] > MUCH * abs(travel[PAPERS_FRICTION]))
        told.append(
            f"{worm.label}: {1e3 * travel[PAPERS_FRICTION]:+.0f} mm at friction 1, at most {1e3 * travel[best]:+.0f} "
            f"mm at {best:g}"
        )
    walk = ", ".join(f"{evidence.words('friction', f'frictions_that_walk_{w.name}')} ({w.label})" for w in WORMS)
    return _claim(
        "The small speed is largely due to an unoptimised coefficient of friction.",
        "section 5",
        "friction 1 is not optimal",
        "; ".join(told),
        f"Travel forwards in 5 s, all other things as they are. It holds for a worm if some friction makes it travel "
        f"more than {MUCH:g} times as far, forwards and in the order 1-2-3, as friction 1 does either way; each worm "
        f"counts alike. Worms keep that order at frictions {walk}.",
        "annelid paper --only friction",
        *judged(gains, "the worm"),
    )


def _slip_claim(evidence: Evidence) -> Claim:
    cases = {name: detection.CASES[name] for name in slip_runs(evidence.effort)}
    found = [score([detect(evidence.store.run(case))], detection.LIMIT_M_PER_S) for case in cases.values()]
    return _claim(
        "Pressure and stretch sensors together detect slip reliably.",
        "section 5",
        "shown by Wang on the robot",
        f"precision {span((one.precision for one in found), digits=2)}, recall "
        f"{span((one.recall for one in found), digits=2)} over {len(found)} runs ({'; '.join(cases)})",
        f"Our detector reads stretch and load only, and is judged by the slip that the simulator knows of; it holds if "
        f"precision and recall are at least {RELIABLE:g}. It tells "
        f"{span((one.found for one in found), 100, 0)} % of the slips sooner or later, and is seldom late, but its "
        "constants were chosen on one of these runs, and another detector may do better. The worm is the later "
        "six-segment one (riddle2025-muscles).",
        "annelid experiment slip-detector",
        *judged((min(one.precision, one.recall) >= RELIABLE for one in found), "the gait and the friction"),
    )

"""Claims about what is to come: noise, friction, adaptive frequency and slip."""

from __future__ import annotations

from math import nan

from annelid_studies import slip as slip_study
from annelid_studies.papers.judging import Judgement, judged
from annelid_studies.riddle2023.claims.evidence import LABELS, PLANAR_CASES, Evidence, judges, slip_runs
from annelid_studies.riddle2023.examinations.design import WORMS
from annelid_studies.riddle2023.examinations.friction import PAPERS_FRICTION, frictions_of
from annelid_studies.slip_detector import detect_slip, score_detections

RELIABLE = 0.9
"""Precision and recall from which we call a detector reliable."""
MUCH = 2.0
"""From so many times the travel, or the rate, on we call a difference large."""


@judges
def noise(evidence: Evidence) -> Judgement:
    """Every worm walks under the largest noise tested, with some threshold."""
    tested, handled = (
        {worm: evidence.number("noise", f"noise_{which}_{worm}") for worm in LABELS} for which in ("tested", "handled")
    )
    noisy = [worm for worm in LABELS if tested[worm] > 0]
    own = ""
    if evidence.effort == "full":
        share = evidence.number("noise", "walking_share_noisy_papers_step")
        own = f" At the paper's own step and threshold {100 * share:.0f} % of the runs keep it at 2 mm."
    return judged((handled[worm] >= tested[worm] for worm in noisy), "the worm"), {
        "handled": "; ".join(
            f"{1e3 * handled[worm]:g} of {1e3 * tested[worm]:g} mm ({LABELS[worm]})" for worm in noisy
        ),
        "windows": ", ".join(f"{evidence.words('noise', f'window_{worm}')} ({LABELS[worm]})" for worm in LABELS),
        "at_the_papers_step": own,
    }


@judges
def friction(evidence: Evidence) -> Judgement:
    """Some friction makes a worm travel much farther forwards than friction 1 does, each worm by itself."""
    travels, gains = [], []
    for worm in WORMS:
        frictions = frictions_of(worm, evidence.effort)
        if len(frictions) == 1:
            continue
        travel = {mu: evidence.number("friction", f"travel_friction_{mu:g}_{worm.name}_m") for mu in frictions}
        verdicts = {mu: evidence.words("friction", f"verdict_friction_{mu:g}_{worm.name}") for mu in frictions}
        walking = [mu for mu, verdict in verdicts.items() if verdict.startswith("1-2-3")]
        best = max(walking, key=lambda mu: travel[mu], default=PAPERS_FRICTION)
        gains.append(travel[best] > MUCH * abs(travel[PAPERS_FRICTION]))
        travels.append(
            f"{worm.label}: {1e3 * travel[PAPERS_FRICTION]:+.0f} mm at friction 1, at most {1e3 * travel[best]:+.0f} "
            f"mm at {best:g}"
        )
    walk = ", ".join(f"{evidence.words('friction', f'frictions_that_walk_{w.name}')} ({w.label})" for w in WORMS)
    return judged(gains, "the worm"), {"travels": "; ".join(travels), "much": MUCH, "walk": walk}


@judges
def adaptive_frequency(evidence: Evidence) -> Judgement:
    """The planar worm walks at every time constant of the gate, and the periods differ much."""
    rhythms = {tau: evidence.store[case].rhythm for tau, case in PLANAR_CASES.items()}
    periods = {tau: rhythm.period_s or nan for tau, rhythm in rhythms.items()}
    factor = max(periods.values()) / min(periods.values())
    return judged([*(one.is_one_wave for one in rhythms.values()), factor > MUCH], "the time constant"), {
        "periods": ", ".join(f"{tau} ms: {period:.3f} s" for tau, period in periods.items()),
        "much": MUCH,
        "factor": factor,
        "planar_fastest": PLANAR_CASES[100].command,
    }


@judges
def slip(evidence: Evidence) -> Judgement:
    """Our detector is precise and misses little in every run."""
    names = slip_runs(evidence.effort)
    detections = [detect_slip(evidence.store.run(slip_study.CASES[name])) for name in names]
    found = [score_detections([one], slip_study.LIMIT_M_PER_S) for one in detections]
    verdict = judged((min(one.precision, one.recall) >= RELIABLE for one in found), "the gait and the friction")
    return verdict, {
        "precision": [one.precision for one in found],
        "recall": [one.recall for one in found],
        "found": [one.found for one in found],
        "runs": len(found),
        "names": "; ".join(names),
        "reliable": RELIABLE,
    }

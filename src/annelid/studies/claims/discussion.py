"""Discussion: propagation, the weak middle, the robot, travel."""

from __future__ import annotations

from typing import Any

import numpy as np

from annelid.analysis.robot import ROBOT_ELONGATION_M, relative_to_first
from annelid.simulation.runfile import Run
from annelid.studies.case import chain, fast, one_after_the_other
from annelid.studies.claims.evidence import (
    MAIN,
    Evidence,
    holds_if,
    longer_worm,
    longer_worms,
)
from annelid.studies.contents import Claim
from annelid.studies.outcome import Outcome


def discussion_claims(evidence: Evidence, outcome: Outcome, main: Run) -> list[Claim]:
    """Judges the claims about propagation, the weak middle, the robot and travel."""
    from annelid.view.figures.propagation import measure_propagation

    held = evidence.results[chain(one_after_the_other())] if evidence.effort == "full" else None
    held = held or evidence.results[fast(one_after_the_other())]
    worm = "riddle2023" if evidence.effort == "full" else "riddle2023-fast"
    first, second = held.holds[0].elongation_mean_m, held.holds[1].elongation_mean_m
    at_onset = _lifts(main)
    seen = measure_propagation(main)
    near, far = (now / rest - 1 for rest, now in (seen.near.length_m, seen.far.length_m))
    weight = float(main.data.attrs["total_mass_kg"]) * 9.81
    settled = main.data["time"].values > 0.5
    load = float(main.data["contact_force"].sel(axis="z").values[settled].sum(axis=1).mean())
    return [
        Claim(
            "Discussion",
            "Contraction deforms unactuated neighbours, even with a rhombus between the rings, and leaves far ones "
            "alone (Fig. 8).",
            "sections 3, 4",
            holds_if(abs(near) > 5 * abs(far)),
            "Fig. 8",
            f"near rhombus {100 * near:+.0f} % in length, far rhombus {100 * far:+.0f} %",
            f"Segment 2 contracted at {seen.time_s:.2f} s; figure 8 shows how the deformation decays with distance.",
            MAIN.command,
        ),
        Claim(
            "Discussion",
            "When segment 1 contracts, segment 2 lengthens slightly; when segment 2 contracts, segments 1 and 3 do.",
            "section 4",
            holds_if(min(at_onset) > 0.001),
            "slightly longer",
            f"up to {', '.join(f'{1e3 * lift:+.0f}' for lift in at_onset)} mm (2 while 1; 1 and 3 while 2)",
            f"Largest reading of the neighbour during the contraction, against rest. Once settled in open loop "
            f"({worm}) little of it is left: {1e3 * first[1]:+.1f} mm in segment 2 while 1 is held, "
            f"{1e3 * second[0]:+.1f} and {1e3 * second[2]:+.1f} mm in 1 and 3 while 2 is held.",
            MAIN.command,
        ),
        *_middle_claims(evidence),
        _robot_claim(evidence),
        Claim(
            "Discussion",
            "On flat ground the contact forces are produced by gravity.",
            "section 4",
            holds_if(abs(load / weight - 1) < 0.05),
            "gravity",
            f"mean load on the floor {load:.2f} N, weight {weight:.2f} N",
            "Mean of the vertical contact force from 0.5 s on.",
            MAIN.command,
        ),
        Claim(
            "Discussion",
            "Net speed is negligible.",
            "section 5",
            holds_if(abs(outcome.summary.travel_m or 1.0) < 0.1),
            "negligible",
            f"{1e3 * (outcome.summary.travel_m or 0.0):.0f} mm in 5 s, body 0.56 m long",
            "Travel depends on contact settings more than shape does; see friction for its convergence.",
            MAIN.command,
        ),
    ]


def _lifts(run: Run) -> tuple[float, float, float]:
    """Largest elongation of segment 2 while 1 first contracts, and of 1 and 3 while 2 does after 1 has relaxed, m."""
    data = run.data
    above = (data["stretch_length"].values - data["stretch_rest_length"].values).mean(axis=2)
    active = data["activation"].values > 0.5
    time = data["time"].values
    began = [float(time[np.argmax(active[:, segment])]) for segment in range(3)]
    first = active[:, 0] & (time < began[1])
    second = active[:, 1] & (time < began[2])
    # Segment 1 still relaxes from its own contraction at first: its last third says what its neighbour does to it.
    late = second & (time > began[2] - (began[2] - began[1]) / 3)
    return float(above[first, 1].max()), float(above[late, 0].max()), float(above[second, 2].max())


def _middle_claims(evidence: Evidence) -> list[Claim]:
    pairs = [(3, "fast"), (3, "rods"), *longer_worms(evidence.effort)]
    deficits = {(n, worm): _own(evidence.results[longer_worm(n, worm)]) for n, worm in pairs if n > 3}
    shortfalls = {key: 1 - np.array(own[1:-1]) / min(own[0], own[-1]) for key, own in deficits.items()}
    all_below = all((shortfall > 0).all() for shortfall in shortfalls.values())
    per_worm = {
        worm: [float(shortfall.mean()) for (_, name), shortfall in shortfalls.items() if name == worm]
        for worm in ("chain", "fast", "rods")
    }
    listed = "; ".join(
        f"{worm} {min(means) * 100:.0f} to {max(means) * 100:.0f} %" for worm, means in per_worm.items() if means
    )
    friction = evidence.findings["friction"].numbers
    ranges = evidence.findings["ranges"].numbers
    return [
        Claim(
            "Discussion",
            "In longer worms all interior segments elongate less than the ends (N = 4, 5, 6).",
            "section 4",
            holds_if(all_below),
            "all of 2 .. N-1",
            f"interior below the lower end by {listed}",
            "Every segment contracted alone, one after the other, with equal muscles: position is all that differs.",
            longer_worm(6, "rods").command,
        ),
        _cause_claim(ranges, friction),
    ]


def _own(outcome: Outcome) -> list[float]:
    """Elongation of each segment while it is held, m."""
    return [hold.elongation_mean_m[hold.segment - 1] for hold in outcome.holds]


def _cause_claim(ranges: Any, friction: Any) -> Claim:
    compiled, equal = ranges.get("deficit_open_compiled_fast"), ranges.get("deficit_open_equal_fast")
    slippery, rough = friction.get("deficit_open_friction_low_fast"), friction.get("deficit_open_friction_one_fast")
    known = None not in (compiled, equal, slippery, rough)
    share_range = compiled - equal if known else float("nan")
    share_friction = rough - slippery if known else float("nan")
    return Claim(
        "Discussion",
        "Segment 2's smaller elongation is due to contact friction and its central place.",
        "section 4",
        "not testable here" if not known else holds_if(share_friction > share_range),
        "friction and place",
        "-"
        if not known
        else f"{100 * compiled:.0f} % in open loop; {100 * share_range:.0f} points of it from the muscle's compiled "
        f"length range, {100 * share_friction:.0f} from friction",
        "The compiler gave each ring another operating range, and the middle ring the one that stops earliest. With "
        "equal ranges much of the deficit goes; without friction little does. What then remains is the place: the "
        "neighbours' mesh must be deformed on both sides.",
        "annelid paper --only ranges --only friction",
    )


def _robot_claim(evidence: Evidence) -> Claim:
    robot = relative_to_first(ROBOT_ELONGATION_M)
    ours = {worm: relative_to_first(_own(evidence.results[longer_worm(4, worm)])) for worm in ("fast", "rods")}
    text = "; ".join(f"{worm} {' / '.join(f'{value:.2f}' for value in values)}" for worm, values in ours.items())
    weak = {worm: 1 - float(np.mean(values[1:3])) for worm, values in ours.items()}
    alike = all(0.15 < value < 0.45 for value in weak.values())
    return Claim(
        "Discussion",
        "The model closely emulates the robot: ends alike, middle segments clearly weaker.",
        "section 4, Fig. 9",
        holds_if(alike),
        " / ".join(f"{value:.2f}" for value in robot) + " relative to segment 1",
        text,
        f"Four segments with equal muscles: the middle falls short by {100 * weak['fast']:.0f} % (soft pins) and "
        f"{100 * weak['rods']:.0f} % (tight pins), in the robot by {100 * (1 - float(np.mean(robot[1:3]))):.0f} %. "
        "A muscle that stops by its length hides the load; the robot's motors stop by their force. Only the robot's "
        "maxima are published.",
        longer_worm(4, "fast").command,
    )

"""Discussion: propagation, the weak middle, the robot, travel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from annelid.analysis.robot import ROBOT_ELONGATION_M, relative_to_first
from annelid.simulation.runfile import Run
from annelid.studies.case import chain, fast, one_after_the_other, rods
from annelid.studies.claims.evidence import (
    LABELS,
    MAIN,
    NEGLIGIBLE,
    Evidence,
    holds_if,
    longer_worm,
    longer_worms,
    nearness,
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
    loaded, margin = nearness(load, weight)
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
            loaded,
            "gravity",
            f"mean load on the floor {load:.2f} N, weight {weight:.2f} N",
            "Mean of the vertical contact force from 0.5 s on, at samples of 10 ms, between which short impacts are "
            "missed or counted double.",
            MAIN.command,
            margin,
        ),
        _speed_claim(evidence, outcome, main),
    ]


def _speed_claim(evidence: Evidence, outcome: Outcome, main: Run) -> Claim:
    period = outcome.rhythm.period_s or float("nan")
    body_m = float(main.data.attrs["body_length_m"])
    ours = _travel_in_a_cycle(main, period)
    others = {
        case.preset: _travel_in_a_cycle(evidence.store.run(case), evidence.results[case].rhythm.period_s or period)
        for case in (fast(), rods())
    }
    listed = ", ".join(f"{1e3 * travel:+.0f} mm ({name})" for name, travel in others.items())
    return Claim(
        "Discussion",
        "Net speed is negligible.",
        "section 5",
        holds_if(abs(ours) < NEGLIGIBLE * body_m),
        "negligibly small",
        f"{1e3 * ours:+.0f} mm forwards in the last cycle, {100 * abs(ours) / body_m:.1f} % of the body; "
        f"{1e3 * abs(ours) / period:.0f} mm/s",
        f"Centre of mass over one period. Negligible means below "
        f"{100 * NEGLIGIBLE:.0f} % of the body here; the paper gives no number. Other worms in the same gait: "
        f"{listed}. Travel depends on pins, contact settings and time step more than on anything the paper states; "
        "friction and time step are examined.",
        MAIN.command,
    )


def _travel_in_a_cycle(run: Run, period_s: float) -> float:
    """Displacement of the centre of mass over the last period of a run, m; forwards, which is towards -x, positive."""
    time = run.data["time"].values
    position = run.data["center_of_mass"].sel(axis="x").values
    return float(np.interp(time[-1] - period_s, time, position) - position[-1])


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
    held = {(n, worm): _own(evidence.results[longer_worm(n, worm)]) for n, worm in longer_worms(evidence.effort)}
    shortfalls = {key: 1 - np.array(own[1:-1]) / min(own[0], own[-1]) for key, own in held.items()}
    all_below = all((shortfall > 0).all() for shortfall in shortfalls.values())
    per_worm = {
        worm: [float(shortfall.mean()) for (_, name), shortfall in shortfalls.items() if name == worm]
        for worm in LABELS
    }
    listed = "; ".join(
        f"{LABELS[worm]} {100 * min(means):.1f} to {100 * max(means):.1f} %"
        for worm, means in per_worm.items()
        if means
    )
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
        _cause_claim(evidence.findings["ranges"].numbers, evidence.findings["friction"].numbers),
    ]


def _own(outcome: Outcome) -> list[float]:
    """Elongation of each segment while it is held, m."""
    return [hold.elongation_mean_m[hold.segment - 1] for hold in outcome.holds]


def _cause_claim(ranges: Mapping[str, Any], friction: Mapping[str, Any]) -> Claim:
    compiled, equal = ranges["deficit_mean_open_compiled_fast"], ranges["deficit_mean_open_equal_fast"]
    slippery, rough = friction["deficit_open_mean_friction_0.05_fast"], friction["deficit_open_mean_friction_1_fast"]
    by_range, by_friction = compiled - equal, rough - slippery
    larger = "more" if by_range > by_friction else "less"
    return Claim(
        "Discussion",
        "Segment 2's smaller elongation is due to contact friction and its central place.",
        "section 4",
        holds_if(by_friction > by_range),
        "friction and place",
        f"of {100 * compiled:.1f} % in open loop, {100 * by_range:.1f} points go with equal length ranges of the "
        f"muscles, {100 * by_friction:.1f} with the friction",
        "The compiler of the paper's time gave each ring another operating range, and the middle one the range that "
        f"ends earliest. That makes {larger} of the deficit than friction does (sprung rods, each segment held by "
        "itself, mean of its springs). Friction and place have their share, but the muscle's range is in the model for "
        "a reason that has nothing to do with the worm.",
        "annelid paper --only ranges --only friction",
    )


def _robot_claim(evidence: Evidence) -> Claim:
    robot = relative_to_first(ROBOT_ELONGATION_M)
    ours = {worm: relative_to_first(_own(evidence.results[longer_worm(4, worm)])) for worm in ("fast", "rods")}
    text = "; ".join(
        f"{LABELS[worm]} {' / '.join(f'{value:.2f}' for value in values)}" for worm, values in ours.items()
    )
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

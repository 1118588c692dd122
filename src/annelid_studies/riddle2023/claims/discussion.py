"""Discussion and future work: propagation, weak middle, robot, travel; noise, friction, adaptive gaits, slip."""

from __future__ import annotations

from functools import partial
from math import nan

import numpy as np

from annelid.analysis import (
    ROBOT_ELONGATION_M,
    detect_slip,
    forward_position,
    middle_deficit,
    score_detections,
)
from annelid.simulation import Run
from annelid_studies import slip
from annelid_studies.riddle2023.claims.evidence import (
    LABELS,
    MAIN,
    NEGLIGIBLE,
    PLANAR_CASES,
    Evidence,
    judged,
    longer_worm,
    longer_worms,
    near,
    slip_runs,
)
from annelid_studies.riddle2023.contents import Claim
from annelid_studies.riddle2023.examinations.design import WORMS
from annelid_studies.riddle2023.examinations.friction import PAPERS_FRICTION, SLIPPERY, frictions_of
from annelid_studies.riddle2023.words import span
from annelid_studies.worms import chain, fast, one_after_the_other, rods

_of_discussion = partial(Claim, "Discussion")
SLIGHT_M = 0.001


def discussion_claims(evidence: Evidence, main: Run) -> list[Claim]:
    """Judges the claims about propagation, the weak middle, the robot and travel."""
    from annelid_studies.riddle2023.figures.propagation import measure_propagation

    held = evidence.store[chain(one_after_the_other())] if evidence.effort == "full" else None
    held = held or evidence.store[fast(one_after_the_other())]
    worm = "riddle2023" if evidence.effort == "full" else "riddle2023-fast"
    first, second = held.holds[0].elongation_mean_m, held.holds[1].elongation_mean_m
    # Shape (n_runs, 3, n_readings).
    lifts = np.array([_lifts(run) for _, run in evidence.runs])
    seen = [measure_propagation(run) for _, run in evidence.runs]
    nearby, far = (
        [now / rest - 1 for rest, now in lengths]
        for lengths in ([one.near.length_m for one in seen], [one.far.length_m for one in seen])
    )
    weight = float(main.data.attrs["total_mass_kg"]) * 9.81
    loads = [_load_N(run) for _, run in evidence.runs]
    return [
        _of_discussion(
            "Contraction deforms unactuated neighbours, even with a rhombus between the rings, and leaves far ones "
            "alone (Fig. 8).",
            "sections 3, 4",
            "Fig. 8",
            f"near rhombus {span(nearby, 100, 0)} % longer, far rhombus {span(far, 100, 0)} %",
            f"It holds if the near rhombus changes by more than five times as much; both are those that our "
            f"figure 8 shows. Segment 2 contracted at {seen[0].time_s:.2f} s; figure 8 shows how the deformation "
            "decays with distance.",
            MAIN.command,
            *judged((abs(one) > 5 * abs(other) for one, other in zip(nearby, far, strict=True)), "the run"),
        ),
        _of_discussion(
            "When segment 1 contracts, segment 2 lengthens slightly; when segment 2 contracts, segments 1 and 3 do.",
            "section 4",
            "slightly longer",
            "; ".join(
                f"{which}: {span(lifts[:, i], 1e3, 0)} mm"
                for i, which in enumerate(("2 while 1", "1 while 2", "3 while 2"))
            ),
            "Largest reading of the neighbour during the contraction, against rest, over the six springs and their "
            f"mean; it holds if all are above {1e3 * SLIGHT_M:g} mm. Once settled in open loop "
            f"({worm}) little of it is left: {1e3 * first[1]:+.1f} mm in segment 2 while 1 is held, "
            f"{1e3 * second[0]:+.1f} and {1e3 * second[2]:+.1f} mm in 1 and 3 while 2 is held.",
            MAIN.command,
            *judged((lifts > SLIGHT_M).ravel(), "how the elongation is read"),
        ),
        *_middle_claims(evidence),
        _robot_claim(evidence),
        _of_discussion(
            "On flat ground the contact forces are produced by gravity.",
            "section 4",
            "gravity",
            f"mean load on the floor {span(loads)} N, weight {weight:.2f} N",
            "Mean of the vertical contact force from 0.5 s on, at samples of 10 ms, between which short impacts are "
            "missed or counted double.",
            MAIN.command,
            *near(loads, weight, "the run"),
        ),
        _speed_claim(evidence, main),
    ]


def _load_N(run: Run) -> float:
    """Mean vertical force of the floor on the worm once it has settled, N."""
    settled = run.data["time"].values > 0.5
    return float(run.data["contact_force"].sel(axis="z").values[settled].sum(axis=1).mean())


def _speed_claim(evidence: Evidence, main: Run) -> Claim:
    body_m = float(main.data.attrs["body_length_m"])
    ours = [_travel_in_a_cycle(run, outcome.rhythm.period_s or nan) for outcome, run in evidence.runs]
    others = {
        case.preset: _travel_in_a_cycle(evidence.store.run(case), evidence.store[case].rhythm.period_s or nan)
        for case in (fast(), rods())
    }
    listed = ", ".join(f"{1e3 * travel:+.0f} mm ({name})" for name, travel in others.items())
    return _of_discussion(
        "Net speed is negligible.",
        "section 5",
        "negligibly small",
        f"{span(ours, 1e3, 0)} mm forwards in the last cycle, {span(ours, 100 / body_m, 1)} % of the body",
        f"Centre of mass over one period. Negligible means below {100 * NEGLIGIBLE:.0f} % of the body here; the paper "
        f"gives no number. Other worms in the same gait: {listed}. Travel depends on pins, contact settings and time "
        "step more than on anything the paper states; friction and time step are examined.",
        MAIN.command,
        *judged((abs(travel) < NEGLIGIBLE * body_m for travel in ours), "the run"),
    )


def _travel_in_a_cycle(run: Run, period_s: float) -> float:
    """Displacement of the centre of mass over the last period of a run, m; forwards positive."""
    time, ahead = run.data["time"].values, forward_position(run)
    return float(ahead[-1] - np.interp(time[-1] - period_s, time, ahead))


def _lifts(run: Run) -> np.ndarray:
    """Largest elongation of segment 2 while 1 first contracts, and of 1 and 3 while 2 does after 1 has relaxed, m.

    Returns:
        By every spring of the segment and by their mean, shape ``(3, n_readings)``.
    """
    data = run.data
    springs = data["stretch_length"].values - data["stretch_rest_length"].values
    above = np.concatenate([springs, springs.mean(axis=2, keepdims=True)], axis=2)
    active = data["activation"].values > 0.5
    time = data["time"].values
    began = [float(time[np.argmax(active[:, segment])]) for segment in range(3)]
    first = active[:, 0] & (time < began[1])
    second = active[:, 1] & (time < began[2])
    # Segment 1 still relaxes from its own contraction at first: its last third says what its neighbour does to it.
    late = second & (time > began[2] - (began[2] - began[1]) / 3)
    # A run in which a segment never contracts has no lift of its neighbours.
    largest = (above[mask, other].max(axis=0, initial=-np.inf) for mask, other in ((first, 1), (late, 0), (second, 2)))
    return np.array([*largest])


def _middle_claims(evidence: Evidence) -> list[Claim]:
    held = {(n, worm): _own(evidence.store.run(longer_worm(n, worm))) for n, worm in longer_worms(evidence.effort)}
    shortfalls = {key: 1 - own[1:-1] / np.minimum(own[0], own[-1]) for key, own in held.items()}
    below = judged(
        (one > 0 for shortfall in shortfalls.values() for one in shortfall.ravel()), "how the elongation is read"
    )
    share = float(np.mean(np.concatenate([shortfall.ravel() for shortfall in shortfalls.values()]) > 0))
    per_worm = {
        worm: [float(shortfall[:, -1].mean()) for (_, name), shortfall in shortfalls.items() if name == worm]
        for worm in LABELS
    }
    listed = "; ".join(
        f"{LABELS[worm]} {100 * min(means):.1f} to {100 * max(means):.1f} %"
        for worm, means in per_worm.items()
        if means
    )
    return [
        _of_discussion(
            "In longer worms all interior segments elongate less than the ends (N = 4, 5, 6).",
            "section 4",
            "all of 2 .. N-1",
            f"interior below the lower end by {listed}",
            "Every segment contracted alone, one after the other, with equal muscles: position is all that differs. "
            f"Each of the {sum(map(len, shortfalls.values()))} interior segments of {len(held)} worms is compared with "
            f"the lower end, by each spring and by their mean; {100 * share:.0f} % of these readings are below. The "
            "numbers are those of the mean of the springs.",
            longer_worm(6, "rods").command,
            *below,
        ),
        cause_claim(evidence),
    ]


def _own(run: Run) -> np.ndarray:
    """Elongation of each segment at the end of its own contraction in open loop, m.

    Returns:
        By every spring of the segment and by their mean, shape ``(n_segments, n_readings)``.
    """
    times = run.data["time"].values
    own = np.full((run.config.body.n_segments, run.data.sizes["sensor"]), np.nan)
    for contraction in run.config.controller.scheduled:
        last = np.flatnonzero(times <= contraction.stop_s + 1e-9)[-1]
        at_end = (run.data["stretch_length"][last] - run.data["stretch_rest_length"]).values
        own[contraction.segment - 1] = at_end[contraction.segment - 1]
    return np.column_stack([own, own.mean(axis=1)])


def cause_claim(evidence: Evidence) -> Claim:
    """Judges the claim about what holds the middle back."""
    parts = {}
    for worm in ("fast", "rods"):
        compiled, equal = (
            evidence.number("ranges", f"deficit_mean_open_{which}_{worm}") for which in ("compiled", "equal")
        )
        slippery, rough = (
            evidence.number("friction", f"deficit_open_mean_friction_{friction:g}_{worm}")
            for friction in (SLIPPERY, PAPERS_FRICTION)
        )
        parts[worm] = compiled, compiled - equal, rough - slippery
    return _of_discussion(
        "Segment 2's smaller elongation is due to contact friction and its central place.",
        "section 4",
        "friction and place",
        "; ".join(
            f"{LABELS[worm]}: of {100 * whole:.1f} % in open loop, {100 * ranges:.1f} points go with equal length "
            f"ranges of the muscles, {100 * friction:.1f} with the friction"
            for worm, (whole, ranges, friction) in parts.items()
        ),
        "It holds if more of the deficit is left with equal length ranges, which friction and place make, than goes "
        "with them (each segment held by itself, mean of its springs). The compiler of the paper's time gave each ring "
        "another operating range, and the middle one the range that ends earliest. Friction and place have their "
        "share, but the muscle's range is in the model for a reason that has nothing to do with the worm.",
        "annelid paper --only ranges --only friction",
        *judged((whole - ranges > ranges for whole, ranges, _ in parts.values()), "the pins"),
    )


def _robot_claim(evidence: Evidence) -> Claim:
    robot = np.divide(ROBOT_ELONGATION_M, ROBOT_ELONGATION_M[0])
    worms = [worm for n, worm in longer_worms(evidence.effort) if n == 4]
    held = {worm: _own(evidence.store.run(longer_worm(4, worm))) for worm in worms}
    ours = {worm: own[:, -1] / own[0, -1] for worm, own in held.items()}
    weak = [middle_deficit(of_reading) for own in held.values() for of_reading in own.T]
    return _of_discussion(
        "The model closely emulates the robot: ends alike, middle segments clearly weaker.",
        "section 4, Fig. 9",
        " / ".join(f"{value:.2f}" for value in robot) + " relative to segment 1",
        "; ".join(f"{LABELS[worm]} {' / '.join(f'{value:.2f}' for value in values)}" for worm, values in ours.items()),
        f"Compared is by how much the middle falls short: {span(weak, 100, 0)} % by the springs and their mean "
        f"in our worms of four segments with equal muscles, {100 * middle_deficit(ROBOT_ELONGATION_M):.0f} % in the "
        "robot. A muscle that stops by its length hides the load; the robot's motors stop by their force. Fig. 9 shows "
        "the robot's lengths over time as a graph; the text gives numbers of their maxima only, and these are what we "
        "compare with.",
        longer_worm(4, "fast").command,
        *near(weak, middle_deficit(ROBOT_ELONGATION_M), "the worm and how its elongation is read"),
    )


_of_outlook = partial(Claim, "Future work")
RELIABLE = 0.9
"""Precision and recall from which we call a detector reliable."""
MUCH = 2.0
"""From so many times the travel, or the rate, on we call a difference large."""


def outlook_claims(evidence: Evidence) -> list[Claim]:
    """Judges the claims about noise, friction and what is to come."""
    rhythms = {tau: evidence.store[case].rhythm for tau, case in PLANAR_CASES.items()}
    periods = {tau: rhythm.period_s or nan for tau, rhythm in rhythms.items()}
    factor = max(periods.values()) / min(periods.values())
    adaptive = judged([*(rhythm.is_one_wave for rhythm in rhythms.values()), factor > MUCH], "the time constant")
    return [
        noise_claim(evidence),
        friction_claim(evidence),
        _of_outlook(
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
    return _of_outlook(
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
    return _of_outlook(
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
    cases = {name: slip.CASES[name] for name in slip_runs(evidence.effort)}
    found = [score_detections([detect_slip(evidence.store.run(case))], slip.LIMIT_M_PER_S) for case in cases.values()]
    return _of_outlook(
        "Pressure and stretch sensors together detect slip reliably.",
        "section 5",
        "shown by Wang on the robot",
        f"precision {span((one.precision for one in found), digits=2)}, recall "
        f"{span((one.recall for one in found), digits=2)} over {len(found)} runs ({'; '.join(cases)})",
        "Our detector reads stretch and load only, and is judged by the slip that the simulator knows of; it holds if "
        f"precision and recall are at least {RELIABLE:g}. It tells {span((one.found for one in found), 100, 0)} % of "
        "the slips sooner or later, and is seldom late, but its constants were chosen on one of these runs, and "
        "another detector may do better. The worm is the later six-segment one (riddle2025-muscles).",
        "annelid experiment slip-detector",
        *judged((min(one.precision, one.recall) >= RELIABLE for one in found), "the gait and the friction"),
    )

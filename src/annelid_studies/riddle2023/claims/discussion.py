"""Results, discussion and future work: rhythm, elongation, propagation, weak middle, robot, travel; what is to come."""

from __future__ import annotations

from functools import partial
from math import nan

import numpy as np

from annelid.analysis import (
    PAPER_ELONGATION_M,
    PAPER_END_DIFFERENCE,
    PAPER_MIDDLE_DEFICIT,
    ROBOT_ELONGATION_M,
    end_difference,
    forward_position,
    middle_deficit,
)
from annelid.experiment import Case
from annelid.simulation import Run
from annelid_studies import slip
from annelid_studies.riddle2023.claims.evidence import (
    LABELS,
    MAIN,
    NEGLIGIBLE,
    PAPER_STEPS,
    PAPER_WALL_S,
    PLANAR_CASES,
    Evidence,
    judged,
    longer_worm,
    longer_worms,
    near,
    order_of,
    readings_m,
    slip_runs,
)
from annelid_studies.riddle2023.contents import Claim
from annelid_studies.riddle2023.examinations.design import WORMS
from annelid_studies.riddle2023.examinations.friction import PAPERS_FRICTION, SLIPPERY, frictions_of
from annelid_studies.riddle2023.figures.propagation import measure_propagation
from annelid_studies.riddle2023.words import capitalised, in_unit, span
from annelid_studies.slip_detector import detect_slip, score_detections
from annelid_studies.worms import FAST, chain, fast, one_after_the_other, rods

_of_results = partial(Claim, "Results")


def result_claims(evidence: Evidence) -> list[Claim]:
    """Judges the claims about order, period, elongations and cost."""
    first = evidence.runs[0][0]
    walks = [outcome.rhythm.is_one_wave for outcome, _ in evidence.runs]
    periods = [outcome.rhythm.period_s or nan for outcome, _ in evidence.runs]
    return [
        _of_results(
            "The wave runs from segment 1 to 3 and repeats, as in 2D.",
            "section 3, Fig. 7",
            "1-2-3",
            f"{order_of(first)}; {sum(walks)} of {len(walks)} runs in one wave 1-2-3",
            f"{capitalised(first.rhythm.reason)}.",
            MAIN.command,
            *judged(walks, "the run"),
        ),
        _of_results(
            "A cycle of the three-segment worm takes about 2.6 s.",
            "Fig. 7",
            "about 2.6 s, read off Fig. 7",
            f"{span(periods, digits=3)} s",
            "The text gives no number. The network sets the period: 875 ms a segment at a gate time constant of 300 "
            "ms; the paper's network alone gives 2.631 s in the toolbox's update order.",
            MAIN.command,
            *near(periods, 2.6, "the run"),
        ),
        *_elongation_claims(evidence),
        cost_claim(evidence),
    ]


def _elongation_claims(evidence: Evidence) -> list[Claim]:
    """Judges numbers that depend on how an elongation is read: each spring and their mean count alike."""
    # Shape (n_runs, n_segments, n_readings): the springs in the order of their helices, and their mean.
    read = np.array([readings_m(run) for _, run in evidence.runs])
    deficits, differences = (
        np.array([[measure(of_reading) for of_reading in of_run.T] for of_run in read])
        for measure in (middle_deficit, end_difference)
    )
    rows = [
        (
            f"Segment {i} elongates by at most {100 * paper_m:.2f} cm.",
            paper_m,
            f"{100 * paper_m:.2f} cm",
            read[:, i - 1],
            "No reading is the right one: the paper does not say how it read its figure. The spring on the first "
            "helix comes nearest in all three segments together, and stands in the main table for that reason.",
        )
        for i, paper_m in enumerate(PAPER_ELONGATION_M, start=1)
    ]
    rows += [
        (
            "Segment 2 elongates 39.4 % less than segment 1.",
            PAPER_MIDDLE_DEFICIT,
            "39.4 %",
            deficits,
            "What it comes from is claimed, and examined, further below.",
        ),
        (
            "Segments 1 and 3 differ by 4.45 %.",
            PAPER_END_DIFFERENCE,
            "4.45 %",
            differences,
            "A difference of two large numbers is sensitive: it changes with the spring, the time step and the "
            "contacts. Negative: segment 3 elongates more.",
        ),
    ]
    claims = []
    for claim, paper, stated, ours, why in rows:
        unit, digits = ("cm", 2) if stated.endswith("cm") else ("%", 1)
        # Of the first run, and the range over all runs.
        *springs, mean = (in_unit(value, 100, digits) for value in ours[0])
        text = f"{', '.join(springs)} {unit} by the six springs, {mean} {unit} in the mean"
        if len(ours) > 1:
            text += f"; {span(ours.ravel(), 100, digits)} {unit} over all runs"
        verdict = near(ours.ravel(), paper, "how the elongation is read")
        claims.append(_of_results(claim, "section 3", stated, text, why, MAIN.command, *verdict))
    return claims


def cost_claim(evidence: Evidence) -> Claim:
    """Judges the claim about the cost of computing."""
    spent, fast = evidence.runs[0][0].cpu_time_s, evidence.store[Case(FAST)].cpu_time_s
    return _of_results(
        f"{PAPER_STEPS} steps take 3.5 minutes.",
        "section 3",
        f"{1e3 * PAPER_WALL_S / PAPER_STEPS:.0f} ms a step",
        f"{1e3 * spent / PAPER_STEPS:.0f} ms a step, {spent:.0f} s of one core; riddle2023-fast {fast:.0f} s",
        "Not judged by decision: a time of computing says as much about the machine as about the model. Ours is what "
        "the process computed, whatever else the machine did. The same formulation and step; rooting each strand in "
        "its middle halves the cost.",
        MAIN.command,
        "not testable here",
    )


_of_discussion = partial(Claim, "Discussion")
SLIGHT_M = 0.001


def discussion_claims(evidence: Evidence) -> list[Claim]:
    """Judges the claims about propagation, the weak middle, the robot and travel."""
    settled = (chain if evidence.effort == "full" else fast)(one_after_the_other())
    first, second = (hold.elongation_mean_m for hold in evidence.store[settled].holds[:2])
    # Shape (n_runs, 3, n_readings).
    lifts = np.array([_lifts(run) for _, run in evidence.runs])
    seen = [measure_propagation(run) for _, run in evidence.runs]
    nearby = [one.near.length_m[1] / one.near.length_m[0] - 1 for one in seen]
    far = [one.far.length_m[1] / one.far.length_m[0] - 1 for one in seen]
    weight = float(evidence.runs[0][1].data.attrs["total_mass_kg"]) * 9.81
    upward = [(run.data["contact_force"].sel(axis="z").values, run.data["time"].values) for _, run in evidence.runs]
    loads = [float(force[time > 0.5].sum(axis=1).mean()) for force, time in upward]
    return [
        _of_discussion(
            "Contraction deforms unactuated neighbours, even with a rhombus between the rings, and leaves far ones "
            "alone (Fig. 8).",
            "sections 3, 4",
            "Fig. 8",
            f"near rhombus {span(nearby, 100, 0)} % longer, far rhombus {span(far, 100, 0)} %",
            "It holds if the near rhombus changes by more than five times as much; both are those that our figure 8 "
            f"shows. Segment 2 contracted at {seen[0].posture.time_s:.2f} s; figure 8 shows how the deformation decays "
            "with distance.",
            MAIN.command,
            *judged((abs(one) > 5 * abs(other) for one, other in zip(nearby, far, strict=True)), "the run"),
        ),
        _of_discussion(
            "When segment 1 contracts, segment 2 lengthens slightly; when segment 2 contracts, segments 1 and 3 do.",
            "section 4",
            "slightly longer",
            f"2 while 1: {span(lifts[:, 0], 1e3, 0)} mm; 1 while 2: {span(lifts[:, 1], 1e3, 0)} mm; 3 while 2: "
            f"{span(lifts[:, 2], 1e3, 0)} mm",
            "Largest reading of the neighbour during the contraction, against rest, over the six springs and their "
            f"mean; it holds if all are above {1e3 * SLIGHT_M:g} mm. Once settled in open loop "
            f"({settled.preset}) little of it is left: {1e3 * first[1]:+.1f} mm in segment 2 while 1 is held, "
            f"{1e3 * second[0]:+.1f} and {1e3 * second[2]:+.1f} mm in 1 and 3 while 2 is held.",
            MAIN.command,
            *judged((lifts > SLIGHT_M).ravel(), "how the elongation is read"),
        ),
        _middle_claim(evidence),
        cause_claim(evidence),
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
        _speed_claim(evidence),
    ]


def _speed_claim(evidence: Evidence) -> Claim:
    body_m = float(evidence.runs[0][1].data.attrs["body_length_m"])
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


def _middle_claim(evidence: Evidence) -> Claim:
    shortfalls: dict[tuple[int, str], np.ndarray] = {}
    for n, worm in longer_worms(evidence.effort):
        own = _own(evidence.store.run(longer_worm(n, worm)))
        shortfalls[n, worm] = 1 - own[1:-1] / np.minimum(own[0], own[-1])
    below = np.concatenate([shortfall.ravel() for shortfall in shortfalls.values()]) > 0
    listed = []
    for worm, label in LABELS.items():
        means = [100 * float(short[:, -1].mean()) for (_, name), short in shortfalls.items() if name == worm]
        listed += [f"{label} {min(means):.1f} to {max(means):.1f} %"] if means else []
    return _of_discussion(
        "In longer worms all interior segments elongate less than the ends (N = 4, 5, 6).",
        "section 4",
        "all of 2 .. N-1",
        f"interior below the lower end by {'; '.join(listed)}",
        "Every segment contracted alone, one after the other, with equal muscles: position is all that differs. Each "
        f"of the {sum(map(len, shortfalls.values()))} interior segments of {len(shortfalls)} worms is compared with "
        f"the lower end, by each spring and by their mean; {100 * below.mean():.0f} % of these readings are below. The "
        "numbers are those of the mean of the springs.",
        longer_worm(6, "rods").command,
        *judged(below, "how the elongation is read"),
    )


def _own(run: Run) -> np.ndarray:
    """Elongation of each segment, m, at the end of its own open-loop contraction, by every spring and by their mean."""
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
            *judged([*(one.is_one_wave for one in rhythms.values()), factor > MUCH], "the time constant"),
        ),
        _slip_claim(evidence),
    ]


def noise_claim(evidence: Evidence) -> Claim:
    """Judges the claim about noise and thresholds."""
    tested = {worm: evidence.number("noise", f"noise_tested_{worm}") for worm in LABELS}
    handled = {worm: evidence.number("noise", f"noise_handled_{worm}") for worm in LABELS}
    noisy = [worm for worm in LABELS if tested[worm] > 0]
    listed = "; ".join(f"{1e3 * handled[worm]:g} of {1e3 * tested[worm]:g} mm ({LABELS[worm]})" for worm in noisy)
    windows = ", ".join(f"{evidence.words('noise', f'window_{worm}')} ({LABELS[worm]})" for worm in LABELS)
    own = ""
    if evidence.effort == "full":
        share = evidence.number("noise", "walking_share_noisy_papers_step")
        own = f" At the paper's own step and threshold {100 * share:.0f} % of the runs keep it at 2 mm."
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
    travels, gains = [], []
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
        travels.append(
            f"{worm.label}: {1e3 * travel[PAPERS_FRICTION]:+.0f} mm at friction 1, at most {1e3 * travel[best]:+.0f} "
            f"mm at {best:g}"
        )
    walk = ", ".join(f"{evidence.words('friction', f'frictions_that_walk_{w.name}')} ({w.label})" for w in WORMS)
    return _of_outlook(
        "The small speed is largely due to an unoptimised coefficient of friction.",
        "section 5",
        "friction 1 is not optimal",
        "; ".join(travels),
        f"Travel forwards in 5 s, all other things as they are. It holds for a worm if some friction makes it travel "
        f"more than {MUCH:g} times as far, forwards and in the order 1-2-3, as friction 1 does either way; each worm "
        f"counts alike. Worms keep that order at frictions {walk}.",
        "annelid paper --only friction",
        *judged(gains, "the worm"),
    )


def _slip_claim(evidence: Evidence) -> Claim:
    names = slip_runs(evidence.effort)
    detections = [detect_slip(evidence.store.run(slip.CASES[name])) for name in names]
    found = [score_detections([one], slip.LIMIT_M_PER_S) for one in detections]
    return _of_outlook(
        "Pressure and stretch sensors together detect slip reliably.",
        "section 5",
        "shown by Wang on the robot",
        f"precision {span((one.precision for one in found), digits=2)}, recall "
        f"{span((one.recall for one in found), digits=2)} over {len(found)} runs ({'; '.join(names)})",
        "Our detector reads stretch and load only, and is judged by the slip that the simulator knows of; it holds if "
        f"precision and recall are at least {RELIABLE:g}. It reports {span((one.found for one in found), 100, 0)} % of "
        "the slips sooner or later, and is seldom late, but its constants were chosen on one of these runs, and "
        "another detector may do better. The worm is the later six-segment one (riddle2025-muscles).",
        "annelid study slip-detector",
        *judged((min(one.precision, one.recall) >= RELIABLE for one in found), "the gait and the friction"),
    )

"""Discussion: propagation, the weak middle, the robot, travel."""

from __future__ import annotations

from math import nan

import numpy as np

from annelid.analysis.elongation import middle_deficit
from annelid.analysis.robot import ROBOT_ELONGATION_M, relative_to_first
from annelid.analysis.travel import way_ahead
from annelid.control.program import Program
from annelid.simulation.runfile import Run
from annelid_studies.riddle2023.claims.evidence import (
    LABELS,
    MAIN,
    NEGLIGIBLE,
    Evidence,
    between,
    judged,
    longer_worm,
    longer_worms,
    near,
)
from annelid_studies.riddle2023.contents import Claim
from annelid_studies.riddle2023.examinations.friction import PAPERS_FRICTION, SLIPPERY
from annelid_studies.worms import chain, fast, one_after_the_other, rods

SLIGHT_M = 0.001


def discussion_claims(evidence: Evidence, main: Run) -> list[Claim]:
    """Judges the claims about propagation, the weak middle, the robot and travel."""
    from annelid_studies.riddle2023.figures.propagation import measure_propagation

    held = evidence.results[chain(one_after_the_other())] if evidence.effort == "full" else None
    held = held or evidence.results[fast(one_after_the_other())]
    worm = "riddle2023" if evidence.effort == "full" else "riddle2023-fast"
    first, second = held.holds[0].elongation_mean_m, held.holds[1].elongation_mean_m
    # Shape (n_runs, 3, n_readings).
    lifts = np.array([_lifts(run) for _, run in evidence.runs])
    lifted = judged((lifts > SLIGHT_M).ravel(), "how the elongation is read")
    seen = [measure_propagation(run) for _, run in evidence.runs]
    nearby, far = (
        [now / rest - 1 for rest, now in lengths]
        for lengths in ([one.near.length_m for one in seen], [one.far.length_m for one in seen])
    )
    spreads = judged((abs(one) > 5 * abs(other) for one, other in zip(nearby, far, strict=True)), "the run")
    weight = float(main.data.attrs["total_mass_kg"]) * 9.81
    loads = [_load_N(run) for _, run in evidence.runs]
    loaded = near(loads, weight, "the run")
    return [
        Claim(
            "Discussion",
            "Contraction deforms unactuated neighbours, even with a rhombus between the rings, and leaves far ones "
            "alone (Fig. 8).",
            "sections 3, 4",
            spreads[0],
            "Fig. 8",
            f"near rhombus {between(nearby, 100, 0)} % longer, far rhombus {between(far, 100, 0)} %",
            f"It holds if the near rhombus changes by more than five times as much; both are those that our "
            f"figure 8 shows. Segment 2 contracted at {seen[0].time_s:.2f} s; figure 8 shows how the deformation "
            "decays with distance.",
            MAIN.command,
            spreads[1],
        ),
        Claim(
            "Discussion",
            "When segment 1 contracts, segment 2 lengthens slightly; when segment 2 contracts, segments 1 and 3 do.",
            "section 4",
            lifted[0],
            "slightly longer",
            "; ".join(
                f"{which}: {between(lifts[:, i], 1e3, 0)} mm"
                for i, which in enumerate(("2 while 1", "1 while 2", "3 while 2"))
            ),
            "Largest reading of the neighbour during the contraction, against rest, over the six springs and their "
            f"mean; it holds if all are above {1e3 * SLIGHT_M:g} mm. Once settled in open loop "
            f"({worm}) little of it is left: {1e3 * first[1]:+.1f} mm in segment 2 while 1 is held, "
            f"{1e3 * second[0]:+.1f} and {1e3 * second[2]:+.1f} mm in 1 and 3 while 2 is held.",
            MAIN.command,
            lifted[1],
        ),
        *_middle_claims(evidence),
        _robot_claim(evidence),
        Claim(
            "Discussion",
            "On flat ground the contact forces are produced by gravity.",
            "section 4",
            loaded[0],
            "gravity",
            f"mean load on the floor {between(loads)} N, weight {weight:.2f} N",
            "Mean of the vertical contact force from 0.5 s on, at samples of 10 ms, between which short impacts are "
            "missed or counted double.",
            MAIN.command,
            loaded[1],
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
    verdict, on = judged((abs(travel) < NEGLIGIBLE * body_m for travel in ours), "the run")
    others = {
        case.preset: _travel_in_a_cycle(evidence.store.run(case), evidence.results[case].rhythm.period_s or nan)
        for case in (fast(), rods())
    }
    listed = ", ".join(f"{1e3 * travel:+.0f} mm ({name})" for name, travel in others.items())
    return Claim(
        "Discussion",
        "Net speed is negligible.",
        "section 5",
        verdict,
        "negligibly small",
        f"{between(ours, 1e3, 0)} mm forwards in the last cycle, {between(ours, 100 / body_m, 1)} % of the body",
        f"Centre of mass over one period. Negligible means below "
        f"{100 * NEGLIGIBLE:.0f} % of the body here; the paper gives no number. Other worms in the same gait: "
        f"{listed}. Travel depends on pins, contact settings and time step more than on anything the paper states; "
        "friction and time step are examined.",
        MAIN.command,
        on,
    )


def _travel_in_a_cycle(run: Run, period_s: float) -> float:
    """Displacement of the centre of mass over the last period of a run, m; forwards positive."""
    time, ahead = run.data["time"].values, way_ahead(run)
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
    below, on = judged(
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
        Claim(
            "Discussion",
            "In longer worms all interior segments elongate less than the ends (N = 4, 5, 6).",
            "section 4",
            below,
            "all of 2 .. N-1",
            f"interior below the lower end by {listed}",
            "Every segment contracted alone, one after the other, with equal muscles: position is all that differs. "
            f"Each of the {sum(map(len, shortfalls.values()))} interior segments of {len(held)} worms is compared with "
            f"the lower end, by each spring and by their mean; {100 * share:.0f} % of these readings are below. The "
            "numbers are those of the mean of the springs.",
            longer_worm(6, "rods").command,
            on,
        ),
        cause_claim(evidence),
    ]


def _own(run: Run) -> np.ndarray:
    """Elongation of each segment at the end of its own contraction in open loop, m.

    Returns:
        By every spring of the segment and by their mean, shape ``(n_segments, n_readings)``.
    """
    program, times = run.config.controller, run.data["time"].values
    assert isinstance(program, Program)
    own = np.full((run.config.body.n_segments, run.data.sizes["sensor"]), np.nan)
    for contraction in program.contractions:
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
    verdict, on = judged((whole - ranges > ranges for whole, ranges, _ in parts.values()), "the pins")
    return Claim(
        "Discussion",
        "Segment 2's smaller elongation is due to contact friction and its central place.",
        "section 4",
        verdict,
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
        on,
    )


def _robot_claim(evidence: Evidence) -> Claim:
    robot = relative_to_first(ROBOT_ELONGATION_M)
    worms = [worm for n, worm in longer_worms(evidence.effort) if n == 4]
    held = {worm: _own(evidence.store.run(longer_worm(4, worm))) for worm in worms}
    ours = {worm: relative_to_first(own[:, -1]) for worm, own in held.items()}
    weak = [middle_deficit(of_reading) for own in held.values() for of_reading in own.T]
    verdict, within = near(weak, middle_deficit(ROBOT_ELONGATION_M), "the worm and how its elongation is read")
    return Claim(
        "Discussion",
        "The model closely emulates the robot: ends alike, middle segments clearly weaker.",
        "section 4, Fig. 9",
        verdict,
        " / ".join(f"{value:.2f}" for value in robot) + " relative to segment 1",
        "; ".join(f"{LABELS[worm]} {' / '.join(f'{value:.2f}' for value in values)}" for worm, values in ours.items()),
        f"Compared is by how much the middle falls short: {between(weak, 100, 0)} % by the springs and their mean "
        f"in our worms of four segments with equal muscles, {100 * middle_deficit(ROBOT_ELONGATION_M):.0f} % in the "
        "robot. A muscle that stops by its length hides the load; the robot's motors stop by their force. Fig. 9 shows "
        "the robot's lengths over time as a graph; the text gives numbers of their maxima only, and these are what we "
        "compare with.",
        longer_worm(4, "fast").command,
        within,
    )

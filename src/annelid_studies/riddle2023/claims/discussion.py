"""Claims of the discussion: propagation, the weak middle, the robot, contact and travel."""

from __future__ import annotations

from math import nan

import numpy as np

from annelid.analysis import ROBOT_ELONGATION_M, forward_position, middle_deficit
from annelid.morphology import Array
from annelid.simulation import Run
from annelid_studies.papers.judging import Judgement, judged, near
from annelid_studies.riddle2023.claims.evidence import LABELS, NEGLIGIBLE, Evidence, judges, longer_worm, longer_worms
from annelid_studies.riddle2023.examinations.friction import PAPERS_FRICTION, SLIPPERY
from annelid_studies.riddle2023.figures.propagation import measure_propagation
from annelid_studies.standard_cases import chain, fast, one_after_the_other, rods

SLIGHT_M = 0.001


@judges
def propagation(evidence: Evidence) -> Judgement:
    """The near rhombus changes by more than five times as much as the far one."""
    seen = [measure_propagation(run) for _, run in evidence.runs]
    nearby, far = (
        [rhombus.length_m[1] / rhombus.length_m[0] - 1 for rhombus in which]
        for which in ([one.near for one in seen], [one.far for one in seen])
    )
    return judged((abs(one) > 5 * abs(other) for one, other in zip(nearby, far, strict=True)), "the run"), {
        "near": nearby,
        "far": far,
        "time_s": seen[0].posture.time_s,
    }


@judges
def neighbours(evidence: Evidence) -> Judgement:
    """Every reading of a neighbour is above rest while a segment contracts."""
    settled = (chain if evidence.effort == "full" else fast)(one_after_the_other())
    first, second = (hold.elongation_mean_m for hold in evidence.store[settled].holds[:2])
    # Shape (n_runs, 3, n_readings).
    lifts = np.array([_lifts(run) for _, run in evidence.runs])
    return judged((lifts > SLIGHT_M).ravel(), "how the elongation is read"), {
        "lifts": [lifts[:, i] for i in range(3)],
        "slight_mm": 1e3 * SLIGHT_M,
        "settled": settled.preset,
        "second_mm": 1e3 * first[1],
        "first_mm": 1e3 * second[0],
        "third_mm": 1e3 * second[2],
    }


def _lifts(run: Run) -> Array:
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


@judges
def interior(evidence: Evidence) -> Judgement:
    """Every interior segment elongates less than the lower end, by each spring and by their mean."""
    shortfalls: dict[tuple[int, str], Array] = {}
    for n, worm in longer_worms(evidence.effort):
        own = _own(evidence.store.run(longer_worm(n, worm)))
        shortfalls[n, worm] = 1 - own[1:-1] / np.minimum(own[0], own[-1])
    below = np.concatenate([shortfall.ravel() for shortfall in shortfalls.values()]) > 0
    listed = []
    for worm, label in LABELS.items():
        means = [100 * float(short[:, -1].mean()) for (_, name), short in shortfalls.items() if name == worm]
        listed += [f"{label} {min(means):.1f} to {max(means):.1f} %"] if means else []
    return judged(below, "how the elongation is read"), {
        "shortfalls": "; ".join(listed),
        "segments": sum(map(len, shortfalls.values())),
        "worms": len(shortfalls),
        "below": below.mean(),
        "longest": longer_worm(6, "rods").command,
    }


def _own(run: Run) -> Array:
    """Elongation of each segment, m, at the end of its own open-loop contraction, by every spring and by their mean."""
    times = run.data["time"].values
    own = np.full((run.config.body.n_segments, run.data.sizes["sensor"]), np.nan)
    for contraction in run.config.controller.scheduled:
        last = np.flatnonzero(times <= contraction.stop_s + 1e-9)[-1]
        at_end = (run.data["stretch_length"][last] - run.data["stretch_rest_length"]).values
        own[contraction.segment - 1] = at_end[contraction.segment - 1]
    return np.column_stack([own, own.mean(axis=1)])


@judges
def cause(evidence: Evidence) -> Judgement:
    """More of the deficit is left with equal ranges of the muscles than goes with them."""
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
    listed = "; ".join(
        f"{LABELS[worm]}: of {100 * whole:.1f} % in open loop, {100 * ranges:.1f} points go with equal length "
        f"ranges of the muscles, {100 * friction:.1f} with the friction"
        for worm, (whole, ranges, friction) in parts.items()
    )
    return judged((whole - ranges > ranges for whole, ranges, _ in parts.values()), "the pins"), {"parts": listed}


@judges
def robot(evidence: Evidence) -> Judgement:
    """The middle of worms of four segments falls short as the robot's does."""
    worms = [worm for n, worm in longer_worms(evidence.effort) if n == 4]
    held = {worm: _own(evidence.store.run(longer_worm(4, worm))) for worm in worms}
    weak = [middle_deficit(of_reading) for own in held.values() for of_reading in own.T]
    verdict = near(weak, middle_deficit(ROBOT_ELONGATION_M), "the worm and how its elongation is read")
    return verdict, {
        "robot": _relative(ROBOT_ELONGATION_M),
        "worms": "; ".join(f"{LABELS[worm]} {_relative(own[:, -1])}" for worm, own in held.items()),
        "weak": weak,
        "robots_deficit": middle_deficit(ROBOT_ELONGATION_M),
        "four_segments": longer_worm(4, "fast").command,
    }


def _relative(elongations_m: Array | tuple[float, ...]) -> str:
    return " / ".join(f"{value:.2f}" for value in np.divide(elongations_m, elongations_m[0]))


@judges
def gravity(evidence: Evidence) -> Judgement:
    """The floor bears the worm's weight."""
    weight_N = float(evidence.runs[0][1].data.attrs["total_mass_kg"]) * 9.81
    upward = [(run.data["contact_force"].sel(axis="z").values, run.data["time"].values) for _, run in evidence.runs]
    loads = [float(force[time > 0.5].sum(axis=1).mean()) for force, time in upward]
    return near(loads, weight_N, "the run"), {"loads": loads, "weight_N": weight_N}


@judges
def speed(evidence: Evidence) -> Judgement:
    """A cycle takes the worm less than a hundredth of its length."""
    body_m = float(evidence.runs[0][1].data.attrs["body_length_m"])
    ours = [_travel_in_a_cycle(run, outcome.rhythm.period_s or nan) for outcome, run in evidence.runs]
    others = {
        case.preset: _travel_in_a_cycle(evidence.store.run(case), evidence.store[case].rhythm.period_s or nan)
        for case in (fast(), rods())
    }
    return judged((abs(travel) < NEGLIGIBLE * body_m for travel in ours), "the run"), {
        "travels": ours,
        "shares": np.divide(ours, body_m),
        "negligible": NEGLIGIBLE,
        "others": ", ".join(f"{1e3 * travel:+.0f} mm ({name})" for name, travel in others.items()),
    }


def _travel_in_a_cycle(run: Run, period_s: float) -> float:
    """Displacement of the centre of mass over the last period of a run, m; forwards positive."""
    time, ahead = run.data["time"].values, forward_position(run)
    return float(ahead[-1] - np.interp(time[-1] - period_s, time, ahead))

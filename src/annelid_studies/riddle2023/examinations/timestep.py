"""Time step: what of the walk, and of a contraction's first instants, is converged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from annelid.body import worm_of
from annelid.config import RunConfig
from annelid.draw import canvas, save_both
from annelid.experiment import Case, Outcome, Store
from annelid.morphology import Array
from annelid.simulation import open_run
from annelid_studies.riddle2023 import words
from annelid_studies.riddle2023.contents import Findings, Number, examination, findings
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, SOFT, Columns, Point, Reading, Worm
from annelid_studies.riddle2023.words import CM, MS
from annelid_studies.tables import tabulated
from annelid_studies.worms import Effort, one_after_the_other

TRANSIENT_S = 0.1
"""How much of a contraction's beginning is resolved, s."""
EARLY_S = 0.02
"""When the ring's length is compared with the muscle's limit, s."""
PAPERS_STEP_MS = 1.0

# Curves that end nearer than this share one label.
_LABEL_SPAN_M = 0.05

WALKS: Mapping[Effort, Mapping[Worm, Sequence[float]]] = {
    "quick": {PAPERS: (0.001, 0.002), SOFT: (0.010, 0.020), RIGID: (0.005, 0.010, 0.020)},
    "full": {
        PAPERS: (0.0005, 0.001, 0.002, 0.004),
        SOFT: (0.002, 0.005, 0.010, 0.020),
        RIGID: (0.001, 0.002, 0.005, 0.010, 0.020),
    },
}
"""Steps, s, at which each worm walks."""
STARTS: Mapping[Effort, Mapping[Worm, Sequence[float]]] = {
    "quick": {PAPERS: (0.002, 0.001, 0.0005), RIGID: (0.005, 0.0005)},
    "full": {PAPERS: (0.002, 0.001, 0.0005, 0.00025), RIGID: (0.005, 0.002, 0.0005)},
}
"""Steps, s, at which the beginning of a contraction is resolved."""


def start_case(worm: Worm, step_s: float) -> Case:
    """Returns the run that resolves the beginning of the first segment's contraction at a time step."""
    contraction = one_after_the_other(n_segments=1, hold_s=TRANSIENT_S, rest_s=0.0)
    sampled = {"record.signals_interval_s": max(step_s, 0.001)}
    return worm.case({"clock.physics_timestep_s": step_s, **contraction, **sampled})


def _points(effort: Effort) -> list[Point]:
    """Walks, then beginnings of a contraction in open loop, by their steps in ms."""
    walks = [(worm, step) for worm, steps in WALKS[effort].items() for step in steps]
    starts = [(worm, step) for worm, steps in STARTS[effort].items() for step in steps]
    return [
        *(Point(worm, MS * step, walk=worm.case({"clock.physics_timestep_s": step})) for worm, step in walks),
        *(Point(worm, MS * step, hold=start_case(worm, step)) for worm, step in starts),
    ]


def velocity_limit(config: RunConfig, segment: int = 0) -> float:
    """Returns the speed at which a ring muscle's force vanishes: vmax L0, with L0 = (r1 - r0) / 0.3, m/s."""
    body = worm_of(config)
    rings = body.muscles
    low, high = rings.length_ranges(body.n_segments)[segment]
    return rings.maximum_velocity * (high - low) / 0.3


class Start(NamedTuple):
    """The beginning of the first segment's contraction."""

    time_s: Array  # Sample times, s
    ring_m: Array  # Length of its ring, m, same shape
    limit_m_per_s: float  # Speed at which its force vanishes, m/s

    def at(self, time_s: float) -> float:
        """Length of the ring at a time, m; NaN where the run ended before."""
        return float(np.interp(time_s, self.time_s, self.ring_m, right=np.nan))

    def times_limit(self, time_s: float) -> float:
        """How far the ring has shortened by a time, relative to what its muscle's limit of velocity allows."""
        return (float(self.ring_m[0]) - self.at(time_s)) / (self.limit_m_per_s * time_s)


def read_start(outcome: Outcome) -> Start:
    """Reads the beginning of a contraction from its run."""
    run = open_run(outcome.path)
    ring = run.data["ring_length"].values
    n_rings = ring.shape[1] // run.config.body.n_segments
    return Start(run.data["time"].values, ring[:, :n_rings].sum(axis=1), velocity_limit(run.config))


Starts = Mapping[Worm, Mapping[float, Start]]
"""Beginnings of a contraction by worm and step, ms."""


def _examine(store: Store, effort: Effort, stem: Path) -> Findings:
    readings = design.read(_points(effort), store)
    walks = [one for one in readings if one.walk]
    starts: dict[Worm, dict[float, Start]] = {}
    for one in readings:
        if one.hold:
            starts.setdefault(one.worm, {})[one.value] = read_start(one.hold)
    _draw(walks, starts, stem)
    own_walks = design.by_worm(walks)
    numbers: dict[str, Number] = {}
    early = []
    for worm, row in starts.items():
        for step, start in row.items():
            numbers[f"times_velocity_limit_{worm.name}_{step:g}ms"] = start.times_limit(EARLY_S)
        reached = {step: start for step, start in row.items() if np.isfinite(start.at(EARLY_S))}
        factors = words.listed(words.in_unit(start.times_limit(EARLY_S), digits=1) for start in reached.values())
        early.append(f"{factors} times as far in {worm.label} at {_steps(reached)} ms")
    largest = [
        max((one for one in own if one.walks), key=lambda one: one.value, default=None) for own in own_walks.values()
    ]
    speeds = [
        f"{words.in_unit(_speed(one))} times real time ({one.worm.label}, {one.value:g} ms)" for one in largest if one
    ]
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "step, ms": lambda one: f"{one.value:g}",
        "rhythm": lambda one: "flies apart" if _verdict(one) == "flies apart" else words.rhythm(one.rhythm),
        "onsets": lambda one: "-".join(map(str, one.closed.rhythm.order)) or words.DASH,
        "first helix peak to peak (cm)": lambda one: words.all_in_cm(one.walked_helix_m),
        "mean of six springs (cm)": lambda one: words.all_in_cm(one.walked_m),
        "travel forwards (cm)": lambda one: words.in_cm(one.travel_m, 1),
        "times real time": lambda one: words.in_unit(_speed(one)),
    }
    lengths, papers_step = _settling_in_words(starts)
    found = {
        "walks": " ".join(map(_walks_in_words, own_walks.values())),
        "early": words.listed(early),
        "early_ms": MS * EARLY_S,
        "transient_ms": MS * TRANSIENT_S,
        "n_walks": len(walks),
        "n_starts": sum(map(len, starts.values())),
        "lengths": lengths,
        "papers_step": papers_step,
        "speeds": words.listed(speeds),
    }
    return findings("timestep", found, tabulated(walks, columns), ["lengths", "speeds"], numbers)


def _steps(steps_ms: Iterable[float]) -> str:
    return words.listed(f"{step:g}" for step in steps_ms)


def _verdict(one: Reading) -> str:
    if one.closed.summary.status == "stopped_by_guard":
        return "flies apart"
    kind = words.kind(one.closed.rhythm)
    return {"other order": "another wave", "too short": "too few contractions"}.get(kind, kind)


def _speed(one: Reading) -> float | None:
    """Simulated time over processor time; None where that is not known."""
    return (one.closed.summary.duration_s or 0.0) / one.closed.cpu_time_s if one.closed.cpu_time_s else None


def _walks_in_words(own: Sequence[Reading]) -> str:
    good = [one for one in own if one.walks]
    bad = words.listed(f"{one.value:g} ms ({_verdict(one)})" for one in own if not one.walks)
    mean, helix = (
        words.in_percent(np.ptp(values) / float(np.mean(values)) if len(values) > 1 else None)
        for values in ([one.walked_m[0] for one in good], [one.walked_helix_m[0] for one in good])
    )
    return (
        f"{words.capitalised(own[0].worm.label)}: walks 1-2-3 at {_steps(one.value for one in good)} ms "
        f"(elongation of segment 1 within {mean} %, on its first helix within {helix} %) and fails at {bad}."
    )


def _settling_in_words(starts: Starts) -> tuple[str, str]:
    """Lengths of the rings early and late in a contraction, and whether its beginning is converged at 1 ms."""

    def lengths(row: Mapping[float, Start], time_s: float) -> str:
        return words.listed(f"{words.in_unit(start.at(time_s))} m at {step:g} ms" for step, start in row.items())

    listed = " ".join(
        f"{words.capitalised(worm.label)}: ring of segment 1 {MS * EARLY_S:g} ms after the onset "
        f"{lengths(row, EARLY_S)}; after {MS * TRANSIENT_S:g} ms {lengths(row, TRANSIENT_S)}."
        for worm, row in starts.items()
    )
    paper = starts[PAPERS]
    finest = paper[min(paper)].at(EARLY_S)
    gap = paper[PAPERS_STEP_MS].at(EARLY_S) - finest
    if abs(gap) <= 0.02 * finest:
        return listed, f"At the paper's step of {PAPERS_STEP_MS:g} ms the beginning is converged within 2 %."
    return listed, (
        f"So at the paper's step of {PAPERS_STEP_MS:g} ms the beginning of a contraction is not converged: the "
        f"ring is {words.in_cm(abs(gap), 0)} cm {'shorter' if gap < 0 else 'longer'} than at {min(paper):g} ms. "
        "An explicit step holds the muscle's force while the light pins gather speed, and so misses the steep fall "
        "of the force with velocity."
    )


def _draw(walks: Sequence[Reading], starts: Starts, stem: Path) -> None:
    with canvas(3.5) as figure:
        left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.15])
        for own in design.by_worm(walks).values():
            design.draw_over(left, own, lambda one: CM * one.walked_m[0])
        design.cross_out(left, walks, lambda one: CM * one.walked_m[0])
        steps = sorted({one.value for one in walks})
        step, elongation = "physics time step (ms)", "elongation of segment 1 (cm)"
        design.label_panel(left, "In closed loop", step, elongation, steps, logarithmic=True)
        left.set_ylim(bottom=0.0)
        _draw_starts(right, starts)
        time, ring = "time after the onset (ms)", "ring of segment 1 (m)"
        design.label_panel(right, "Beginning of the first contraction", time, ring)
        handles = [design.look_handle(**worm.look) for worm in design.by_worm(walks)]
        crossed = design.look_handle("does not walk 1-2-3", linestyle="none", marker="x", color="black", markersize=9.0)
        design.legend_below(figure, [*handles, crossed], columns=3)
        save_both(figure, stem)


def _draw_starts(axes: Axes, starts: Starts) -> None:
    thinnest = max(max(map(len, starts.values())) - 1, 1)
    for worm, row in starts.items():
        ordered = sorted(row, reverse=True)
        for i, step in enumerate(ordered):
            look = {"color": worm.color, "linestyle": worm.line, "linewidth": 2.2 - 1.4 * i / thinnest}
            axes.plot(MS * row[step].time_s, row[step].ring_m, **look)
        ends = {f"{step:g} ms": float(row[step].ring_m[-1]) for step in ordered}
        if np.ptp(list(ends.values())) < _LABEL_SPAN_M:
            ends = {f"{ordered[-1]:g} to {ordered[0]:g} ms": float(np.mean(list(ends.values())))}
        beside = {"xytext": (4, 0), "textcoords": "offset points", "va": "center", "annotation_clip": False}
        for text, end in ends.items():
            axes.annotate(text, (MS * TRANSIENT_S, end), **beside, fontsize=7.5, color=worm.color)
    every = [start for row in starts.values() for start in row.values()]
    times = np.array([0.0, TRANSIENT_S])
    limit = every[0].ring_m[0] - every[0].limit_m_per_s * times
    axes.fill_between(MS * times, limit, 0.0, color="0.9", linewidth=0.0)
    axes.plot(MS * times, limit, color="0.4", linewidth=1.0)
    axes.set_xlim(0.0, MS * TRANSIENT_S)
    axes.set_ylim(0.9 * min(start.ring_m.min() for start in every), 1.03 * every[0].ring_m[0])


TIMESTEP = examination("timestep", lambda effort: design.cases_of(_points(effort)), _examine)

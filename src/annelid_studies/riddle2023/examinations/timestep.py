"""Time step: what of the walk, and of a contraction's first instants, is converged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from annelid.body import worm_of
from annelid.config import RunConfig
from annelid.experiment import Case, Outcome, Store
from annelid.morphology import Array
from annelid.simulation import open_run
from annelid_studies.papers import words
from annelid_studies.papers.report_parts import Findings, Number
from annelid_studies.papers.words import MS
from annelid_studies.riddle2023.examinations import design
from annelid_studies.riddle2023.examinations.design import PAPERS, RIGID, SOFT, Columns, Point, Reading, Worm
from annelid_studies.standard_cases import Effort, one_after_the_other
from annelid_studies.tables import tabulated

TRANSIENT_S = 0.1
"""How much of a contraction's beginning is resolved, s."""
EARLY_S = 0.02
"""When the ring's length is compared with the muscle's limit, s."""

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


def _examine(store: Store, effort: Effort) -> Findings:
    readings = design.read(_points(effort), store)
    walks = [one for one in readings if one.walk]
    starts: dict[Worm, dict[float, Start]] = {}
    for one in readings:
        if one.hold:
            starts.setdefault(one.worm, {})[one.value] = read_start(one.hold)
    own_walks = design.by_worm(walks)
    numbers: dict[str, Number] = {}
    early = []
    for worm, row in starts.items():
        for step, start in row.items():
            numbers[f"times_velocity_limit_{worm.name}_{step:g}ms"] = start.times_limit(EARLY_S)
        reached = {step: start for step, start in row.items() if np.isfinite(start.at(EARLY_S))}
        factors = words.listed(words.in_unit(start.times_limit(EARLY_S), digits=1) for start in reached.values())
        early.append(f"{factors} times as far in {worm.label} at {_steps(reached)} ms")
    columns: Columns = {
        "worm": lambda one: one.worm.label,
        "step, ms": lambda one: f"{one.value:g}",
        "rhythm": lambda one: "flies apart" if _verdict(one) == "flies apart" else words.rhythm(one.rhythm),
        "onsets": lambda one: "-".join(map(str, one.closed.rhythm.order)) or words.DASH,
        "first helix peak to peak (cm)": lambda one: words.all_in_cm(one.walked_helix_m),
        "mean of six springs (cm)": lambda one: words.all_in_cm(one.walked_m),
        "travel forwards (cm)": lambda one: words.in_cm(one.travel_m, 1),
    }
    found = {
        "walks": " ".join(map(_walks_in_words, own_walks.values())),
        "early": words.listed(early),
        "early_ms": MS * EARLY_S,
    }
    return design.findings("timestep", found, tabulated(walks, columns), numbers=numbers)


def _steps(steps_ms: Iterable[float]) -> str:
    return words.listed(f"{step:g}" for step in steps_ms)


def _verdict(one: Reading) -> str:
    if one.closed.summary.status == "stopped_by_guard":
        return "flies apart"
    kind = words.kind(one.closed.rhythm)
    return {"other order": "another wave", "too short": "too few contractions"}.get(kind, kind)


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


TIMESTEP = design.examination("timestep", lambda effort: design.cases_of(_points(effort)), _examine)

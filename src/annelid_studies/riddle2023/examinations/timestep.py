"""Integrator and time step: what of the walk, and of a contraction's first instants, is converged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from annelid.body.worm import WormBody
from annelid.config import RunConfig
from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import panel_title
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid.simulation.runfile import open_run
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.side_by_side import (
    CM,
    NOTHING,
    PAPERS,
    SPRUNG,
    TIGHT,
    Worm,
    all_in_cm,
    capitalised,
    in_cm,
    in_percent,
    in_unit,
    kept,
    legend_below,
    listed,
    parameter_ticks,
    rhythm_kind,
    rhythm_words,
    walked_elongation,
)
from annelid_studies.worms import CHAIN, FAST, PAPERS_MESH, RODS, one_after_the_other

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MS = 1000.0
TRANSIENT_S = 0.1
"""How much of a contraction's beginning is resolved, s."""
EARLY_S = 0.02
"""When the ring's length is compared with the muscle's limit, s."""
PAPERS_STEP_S = 0.001

# Curves that end nearer than this share one label.
_LABEL_SPAN_M = 0.05


@dataclass(frozen=True)
class Stepping:
    """A worm with an integrator.

    Attributes:
        worm: The worm.
        preset: Its preset.
        label: For legends and tables.
        changes: What makes the integrator.
        hollow: Whether its markers are empty.
    """

    worm: Worm
    preset: str
    label: str
    changes: Mapping[str, Any]
    hollow: bool = False

    def walk(self, step_s: float) -> Case:
        """Returns the closed-loop run at a time step."""
        return Case(self.preset, {"clock.physics_timestep_s": step_s, **self.changes})

    def start(self, step_s: float) -> Case:
        """Returns the run that resolves the beginning of the first segment's contraction."""
        return self.walk(step_s).but(
            {
                **one_after_the_other(n_segments=1, hold_s=TRANSIENT_S, rest_s=0.0),
                "record.signals_interval_s": max(step_s, 0.001),
            }
        )


RK4 = Stepping(PAPERS, CHAIN, "the paper's chain, RK4", {})
EULER = Stepping(PAPERS, CHAIN, "the paper's chain, Euler", {"body.formulation.integrator": "Euler"}, hollow=True)
SOFT = Stepping(SPRUNG, FAST, SPRUNG.label, {})
HARD = Stepping(TIGHT, RODS, TIGHT.label, PAPERS_MESH)

WALKS: Mapping[Effort, Sequence[tuple[Stepping, Sequence[float]]]] = {
    "quick": (
        (RK4, (0.001, 0.002)),
        (SOFT, (0.010, 0.020)),
        (HARD, (0.005, 0.010, 0.020)),
    ),
    "full": (
        (RK4, (0.0005, 0.001, 0.002, 0.004)),
        (EULER, (0.001, 0.002)),
        (SOFT, (0.002, 0.005, 0.010, 0.020)),
        (HARD, (0.001, 0.002, 0.005, 0.010, 0.020)),
    ),
}
STARTS: Mapping[Effort, Sequence[tuple[Stepping, Sequence[float]]]] = {
    "quick": ((RK4, (0.002, 0.001, 0.0005)), (HARD, (0.005, 0.0005))),
    "full": ((RK4, (0.002, 0.001, 0.0005, 0.00025)), (HARD, (0.005, 0.002, 0.0005))),
}


def cases(effort: Effort) -> list[Case]:
    """Returns the closed-loop runs and the beginnings of a contraction."""
    walks = [stepping.walk(step) for stepping, steps in WALKS[effort] for step in steps]
    return [*walks, *(stepping.start(step) for stepping, steps in STARTS[effort] for step in steps)]


def velocity_limit(config: RunConfig, segment: int = 0) -> float:
    """Returns the speed at which a ring muscle's force vanishes: vmax L0, with L0 = (r1 - r0) / 0.3, m/s.

    Args:
        config: Configuration of a 3D worm.
        segment: Counted from 0.

    Raises:
        ValueError: The worm is planar.
    """
    if not isinstance(config.body, WormBody):
        raise ValueError("a planar worm has no ring muscles")
    rings = config.body.muscles
    low, high = rings.length_ranges(config.body.n_segments)[segment]
    return rings.maximum_velocity * (high - low) / 0.3


@dataclass(frozen=True)
class Start:
    """The beginning of the first segment's contraction.

    Attributes:
        time_s: Sample times, s.
        ring_m: Length of its ring, m, same shape.
        limit_m_per_s: Speed at which its force vanishes, m/s.
        message: Why the run ended before its time; empty if it did not.
    """

    time_s: NDArray[np.float64]
    ring_m: NDArray[np.float64]
    limit_m_per_s: float
    message: str

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
    return Start(run.data["time"].values, ring[:, :n_rings].sum(axis=1), velocity_limit(run.config), outcome.message)


Walks = Sequence[tuple[Stepping, Sequence[tuple[float, Outcome]]]]
Starts = Sequence[tuple[Stepping, Sequence[tuple[float, Start]]]]


def examine(results: Results, effort: Effort, stem: Path) -> Findings:
    """Draws rhythm and elongation over the time step, and the beginning of a contraction."""
    walks: Walks = [
        (stepping, [(step, results[stepping.walk(step)]) for step in steps]) for stepping, steps in WALKS[effort]
    ]
    starts: Starts = [
        (stepping, [(step, read_start(results[stepping.start(step)])) for step in steps])
        for stepping, steps in STARTS[effort]
    ]
    _draw(walks, starts, stem)
    return Findings(
        answer=" ".join([*(_walks_in_words(*row) for row in walks), _starts_in_words(starts)]),
        caption=_caption(walks, starts),
        table=_table(walks),
        remarks=[_settling_in_words(starts), _speed_in_words(walks)],
        numbers=_numbers(walks, starts),
    )


def _ms(step_s: float) -> str:
    return f"{MS * step_s:g}"


def _walks_in_words(stepping: Stepping, row: Sequence[tuple[float, Outcome]]) -> str:
    good = [(step, outcome) for step, outcome in row if outcome.rhythm.is_one_wave]
    bad = [f"{_fate(outcome)} at {_ms(step)} ms" for step, outcome in row if not outcome.rhythm.is_one_wave]
    label = capitalised(stepping.label)
    if not good:
        return f"{label}: no walk ({listed(bad)})."
    text = f"{label}: walks 1-2-3 at {listed([_ms(step) for step, _ in good])} ms"
    if len(good) > 1:
        mean, first = (
            _spread([float(walked_elongation(outcome, first_helix=one)[0]) for _, outcome in good])
            for one in (False, True)
        )
        text += (
            f" (elongation of segment 1 within {in_percent(mean)} %, on its first helix within {in_percent(first)} %)"
        )
    return f"{text}{f'; {listed(bad)}' if bad else ''}."


def _fate(outcome: Outcome) -> str:
    if outcome.summary.status == "stopped_by_guard":
        return "flies apart"
    kind = rhythm_kind(outcome.rhythm)
    return {"other order": "another wave", "too short": "too few contractions"}.get(kind, kind)


def _spread(values: Sequence[float]) -> float:
    return (max(values) - min(values)) / float(np.mean(values))


def _starts_in_words(starts: Starts) -> str:
    parts = []
    for stepping, row in starts:
        times = [(step, start.times_limit(EARLY_S)) for step, start in row if np.isfinite(start.at(EARLY_S))]
        if not times:
            continue
        steps = listed([_ms(step) for step, _ in times])
        factors = listed([in_unit(factor, digits=1) for _, factor in times])
        parts.append(f"{factors} times as far as that in {stepping.label} at {steps} ms")
    return (
        f"A muscle has no force beyond its limit of velocity, yet in the first {_ms(EARLY_S)} ms of a contraction the "
        f"ring shortens {listed(parts)}."
        if any(start.times_limit(EARLY_S) > 1.0 for _, row in starts for _, start in row)
        else f"In the first {_ms(EARLY_S)} ms of a contraction every ring keeps within its muscle's limit of velocity."
    )


def _settling_in_words(starts: Starts) -> str:
    sentences = []
    for stepping, row in starts:
        ends = [(step, start.at(TRANSIENT_S)) for step, start in row]
        lengths = listed([f"{in_unit(length)} m at {_ms(step)} ms" for step, length in ends])
        early = listed([f"{in_unit(start.at(EARLY_S))} m at {_ms(step)} ms" for step, start in row])
        sentences.append(
            f"{capitalised(stepping.label)}: ring of segment 1 {_ms(EARLY_S)} ms after the onset "
            f"{early}; after {_ms(TRANSIENT_S)} ms {lengths}."
        )
    rk4 = next((row for stepping, row in starts if stepping is RK4), ())
    papers = next((start for step, start in rk4 if step == PAPERS_STEP_S), None)
    finest = min(rk4, key=lambda pair: pair[0], default=None)
    if papers is not None and finest is not None:
        gap = papers.at(EARLY_S) - finest[1].at(EARLY_S)
        if abs(gap) > 0.02 * finest[1].at(EARLY_S):
            sentences.append(
                f"So at the paper's step of {_ms(PAPERS_STEP_S)} ms the beginning of a contraction is not converged: "
                f"the ring is {in_cm(abs(gap), 0)} cm {'shorter' if gap < 0 else 'longer'} than at {_ms(finest[0])} "
                "ms. An explicit step holds the muscle's force while the light pins gather speed, and so misses the "
                "steep fall of the force with velocity."
            )
        else:
            sentences.append(f"At the paper's step of {_ms(PAPERS_STEP_S)} ms the beginning is converged within 2 %.")
    return " ".join(sentences)


def _speed_in_words(walks: Walks) -> str:
    best = []
    for stepping, row in walks:
        good = [pair for pair in row if pair[1].rhythm.is_one_wave]
        if good:
            step, outcome = max(good, key=lambda pair: pair[0])
            factor = in_unit(_speed(outcome), digits=2)
            best.append(f"{factor} times real time ({stepping.label}, {_ms(step)} ms)")
    return f"At the largest step that walks, one core computes {listed(best)}, by the processor time of each run."


def _speed(outcome: Outcome) -> float | None:
    """Simulated time over processor time; None where that is not known."""
    return (outcome.summary.duration_s or 0.0) / outcome.cpu_time_s if outcome.cpu_time_s else None


def _numbers(walks: Walks, starts: Starts) -> dict[str, float | str | None]:
    numbers: dict[str, float | str | None] = {}
    names = {id(RK4): "chain_rk4", id(EULER): "chain_euler", id(SOFT): "fast", id(HARD): "rods"}
    for stepping, row in walks:
        name = names[id(stepping)]
        good = [step for step, outcome in row if outcome.rhythm.is_one_wave]
        numbers[f"largest_walking_step_{name}_s"] = max(good, default=None)
        for step, outcome in row:
            tag = f"{name}_{_ms(step)}ms"
            numbers[f"verdict_{tag}"] = _fate(outcome)
            numbers[f"period_{tag}_s"] = outcome.summary.period_s
            numbers[f"elongation_first_helix_{tag}_m"] = kept(float(walked_elongation(outcome, first_helix=True)[0]))
            numbers[f"elongation_mean_{tag}_m"] = kept(float(walked_elongation(outcome)[0]))
            numbers[f"real_time_factor_{tag}"] = _speed(outcome)
    for stepping, row in starts:
        for step, start in row:
            tag = f"{names[id(stepping)]}_{_ms(step)}ms"
            numbers[f"ring_at_20ms_{tag}_m"] = kept(start.at(EARLY_S))
            numbers[f"times_velocity_limit_{tag}"] = kept(start.times_limit(EARLY_S))
        numbers[f"velocity_limit_{names[id(stepping)]}_m_per_s"] = row[0][1].limit_m_per_s
    return numbers


def _caption(walks: Walks, starts: Starts) -> str:
    n_starts = sum(len(row) for _, row in starts)
    return (
        "Left: largest elongation of segment 1 (mean of its springs) in closed loop over the physics time step, one "
        f"run a marker, {sum(len(row) for _, row in walks)} in all; a cross: the run does not walk 1-2-3. Right: "
        f"ring of segment 1 over the first {_ms(TRANSIENT_S)} ms of its contraction in open loop, {n_starts} runs; the "
        "grey region cannot be reached by a muscle that has no force beyond its limit of velocity."
    )


def _table(walks: Walks) -> Table:
    rows = [
        [
            stepping.label,
            _ms(step),
            "flies apart" if outcome.summary.status == "stopped_by_guard" else rhythm_words(outcome.rhythm),
            "-".join(map(str, outcome.rhythm.order)) or NOTHING,
            all_in_cm(walked_elongation(outcome, first_helix=True)),
            all_in_cm(walked_elongation(outcome)),
            in_cm(outcome.summary.travel_m, 1),
            in_unit(_speed(outcome)),
        ]
        for stepping, row in walks
        for step, outcome in row
    ]
    return Table(
        (
            "worm and integrator",
            "step, ms",
            "rhythm",
            "onsets",
            "first helix peak to peak (cm)",
            "mean of six springs (cm)",
            "travel forwards (cm)",
            "times real time",
        ),
        rows,
    )


def _draw(walks: Walks, starts: Starts, stem: Path) -> None:
    from matplotlib.lines import Line2D

    with canvas(3.5) as figure:
        left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.15])
        for stepping, row in walks:
            _draw_walks(left, stepping, row)
        parameter_ticks(left, sorted({MS * step for _, row in walks for step, _ in row}))
        left.set(xlabel="physics time step (ms)", ylabel="elongation of segment 1 (cm)")
        left.set_ylim(bottom=0.0)
        panel_title(left, "In closed loop")
        _draw_starts(right, starts)
        panel_title(right, "Beginning of the first contraction")
        handles = [Line2D([], [], **_look(stepping), label=stepping.label) for stepping, _ in walks]
        crossed = Line2D(
            [], [], linestyle="none", marker="x", color="black", markersize=9.0, label="does not walk 1-2-3"
        )
        legend_below(figure, [*handles, crossed], columns=3)
        save_both(figure, stem)


def _look(stepping: Stepping) -> dict[str, Any]:
    look = {key: value for key, value in stepping.worm.look.items() if key != "label"}
    return {**look, "linestyle": "-.", "markerfacecolor": "white"} if stepping.hollow else look


def _draw_walks(axes: Axes, stepping: Stepping, row: Sequence[tuple[float, Outcome]]) -> None:
    steps = [MS * step for step, _ in row]
    values = [CM * float(walked_elongation(outcome)[0]) for _, outcome in row]
    axes.plot(steps, values, **_look(stepping))
    for x, y, (_, outcome) in zip(steps, values, row, strict=True):
        if not outcome.rhythm.is_one_wave:
            axes.plot([x], [y], linestyle="none", marker="x", color="black", markersize=9.0)


def _draw_starts(axes: Axes, starts: Starts) -> None:
    n_steps = max(len(row) for _, row in starts)
    for stepping, row in starts:
        ordered = sorted(row, key=lambda pair: -pair[0])
        look = stepping.worm.look
        for i, (_, start) in enumerate(ordered):
            width = 2.2 - 1.4 * i / max(n_steps - 1, 1)
            axes.plot(
                MS * start.time_s, start.ring_m, color=look["color"], linestyle=look["linestyle"], linewidth=width
            )
        ends = [float(start.ring_m[-1]) for _, start in ordered]
        labels = [(f"{_ms(step)} ms", end) for (step, _), end in zip(ordered, ends, strict=True)]
        if max(ends) - min(ends) < _LABEL_SPAN_M:
            labels = [(f"{_ms(ordered[-1][0])} to {_ms(ordered[0][0])} ms", float(np.mean(ends)))]
        for text, end in labels:
            axes.annotate(
                text,
                (MS * TRANSIENT_S, end),
                xytext=(4, 0),
                textcoords="offset points",
                fontsize=7.5,
                va="center",
                color=look["color"],
                annotation_clip=False,
            )
    first = starts[0][1][0][1]
    low = min(float(start.ring_m.min()) for _, row in starts for _, start in row)
    times = np.array([0.0, TRANSIENT_S])
    limit = float(first.ring_m[0]) - first.limit_m_per_s * times
    axes.fill_between(MS * times, limit, 0.0, color="0.9", linewidth=0.0)
    axes.plot(MS * times, limit, color="0.4", linewidth=1.0)
    axes.set_xlim(0.0, MS * TRANSIENT_S)
    axes.set_ylim(0.9 * low, 1.03 * float(first.ring_m[0]))
    axes.set(xlabel="time after the onset (ms)", ylabel="ring of segment 1 (m)")


TIMESTEP = Examination(
    name="timestep",
    title="Integrator and time step",
    question=(
        "Do order, period and elongation depend on the integrator and its step, and are the first instants of a "
        "contraction resolved?"
    ),
    cases=cases,
    examine=examine,
)

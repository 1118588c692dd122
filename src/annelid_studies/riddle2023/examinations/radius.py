"""The strands' radius at the same mass: elongation, force and rhythm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from annelid.draw.canvas import canvas, save_both
from annelid.draw.markdown import Table
from annelid.draw.style import panel_title
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome
from annelid_studies.riddle2023.examination import Effort, Examination, Findings, Results
from annelid_studies.riddle2023.examinations.side_by_side import (
    CM,
    PAPERS,
    SPRUNG,
    TIGHT,
    WORMS,
    Worm,
    all_in_cm,
    capitalised,
    draw_rhythms,
    draw_segments,
    held_elongation,
    in_cm,
    in_percent,
    in_unit,
    kept,
    legend_below,
    listed,
    look_handle,
    number,
    rhythm_words,
    segment_handles,
    walked_elongation,
)
from annelid_studies.worms import one_after_the_other

RADII_M = (0.002, 0.00233, 0.00299)
"""The paper's strands, and the two radii of the authors' later files."""

_FIELD = "body.strands.radius_m"
_MM = 1e3


def _walking(worm: Worm, radius_m: float) -> Case:
    return worm.case({_FIELD: radius_m})


def _held(worm: Worm, radius_m: float) -> Case:
    return worm.case({**one_after_the_other(), _FIELD: radius_m})


def _radii(worm: Worm, effort: Effort) -> Sequence[float]:
    if effort == "full":
        return RADII_M
    return RADII_M[:1] if worm is PAPERS else RADII_M[::2]


def _cases(effort: Effort) -> Sequence[Case]:
    walking = [_walking(worm, radius) for worm in WORMS for radius in _radii(worm, effort)]
    held = [_held(worm, radius) for worm in (SPRUNG, TIGHT) for radius in _radii(worm, effort)]
    return [*walking, *held, _held(PAPERS, RADII_M[0])]


class _Series(NamedTuple):
    """One worm over the radii: closed-loop outcomes, and open-loop elongations, m, where they were run."""

    worm: Worm
    radii: Sequence[float]
    outcomes: Sequence[Outcome]
    held_m: NDArray[np.float64]

    @property
    def walked_m(self) -> NDArray[np.float64]:
        return np.array([walked_elongation(outcome) for outcome in self.outcomes])

    @property
    def force_N(self) -> NDArray[np.float64]:
        return np.array([number(outcome.summary.contraction_force_median_N) for outcome in self.outcomes])


def _series(results: Results, worm: Worm, effort: Effort) -> _Series:
    radii = _radii(worm, effort)
    held = radii[:1] if worm is PAPERS else radii
    return _Series(
        worm,
        radii,
        [results[_walking(worm, radius)] for radius in radii],
        np.array([held_elongation(results[_held(worm, radius)]) for radius in held]),
    )


def _examine(results: Results, effort: Effort, stem: Path) -> Findings:
    every = [_series(results, worm, effort) for worm in WORMS]
    _draw(every, stem)
    stiffer = (RADII_M[-1] / RADII_M[0]) ** 4
    varied = [series for series in every if len(series.radii) > 1]
    held = [
        f"from {in_cm(series.held_m[0, 0])} to {in_cm(series.held_m[-1, 0])} cm ({series.worm.label})"
        for series in varied
        if len(series.held_m) > 1
    ]
    forces = [
        f"from {in_unit(series.force_N[0])} to {in_unit(series.force_N[-1])} N ({series.worm.label})"
        for series in varied
    ]
    fates = [f"{series.worm.label}: {rhythm_words(series.outcomes[-1].rhythm)}" for series in varied]
    walks = [series for series in varied if series.outcomes[-1].rhythm.is_one_wave]
    verdict = (
        "all keep the order 1-2-3"
        if len(walks) == len(varied)
        else "none keeps the order 1-2-3"
        if not walks
        else f"only {listed([series.worm.label for series in walks])} {_keep(walks)} the order 1-2-3"
    )
    numbers: dict[str, float | str | None] = {"bending_stiffness_ratio": stiffer}
    for series in every:
        for radius, outcome in zip(series.radii, series.outcomes, strict=True):
            kind = f"{radius * 1e5:.0f}um_{series.worm.name}".replace("um", "0um")
            numbers[f"verdict_{kind}"] = rhythm_words(outcome.rhythm)
            numbers[f"force_{kind}_N"] = outcome.summary.contraction_force_median_N
            numbers[f"elongation_closed_first_{kind}_m"] = kept(walked_elongation(outcome)[0])
        for radius, elongation in zip(series.radii, series.held_m, strict=False):
            kind = f"{radius * 1e5:.0f}um_{series.worm.name}".replace("um", "0um")
            numbers[f"elongation_open_first_{kind}_m"] = kept(elongation[0])
    remarks = [
        f"At {RADII_M[-1] * _MM:g} mm: {'; '.join(fates)}. The sensor tolerances are those of the presets, "
        + listed([f"{w.case(None).config.sensor.tolerance_m * _MM:g} mm ({w.label})" for w in WORMS])
        + ", which were found for the paper's radius."
    ]
    if effort == "quick":
        remarks.append(f"The quick effort varies the radius of {listed([s.worm.label for s in varied])} only.")
    return Findings(
        answer=(
            f"Strands of {RADII_M[-1] * _MM:g} in place of {RADII_M[0] * _MM:g} mm are {stiffer:.1f} times as stiff in "
            f"bending. The elongation of segment 1 in open loop goes {listed(held)}. The median force in closed loop "
            f"goes {listed(forces)}. At {RADII_M[-1] * _MM:g} mm, {verdict}."
        ),
        caption=(
            "Top: elongation (mean of six springs) over the strands' radius at the same mass, in closed loop (filled, "
            "largest in 5 s) and in open loop (empty, each segment held by itself). Bottom: median muscle force while "
            "contracted, and the rhythm, both in closed loop. One run a point. Bending stiffness goes with the fourth "
            "power of the radius."
        ),
        table=_table(every),
        remarks=remarks,
        numbers=numbers,
    )


def _keep(every: Sequence[_Series]) -> str:
    return "keeps" if [series.worm for series in every] == [PAPERS] else "keep"


def _table(every: Sequence[_Series]) -> Table:
    rows = []
    for series in every:
        for i, (radius, outcome) in enumerate(zip(series.radii, series.outcomes, strict=True)):
            rows.append(
                [
                    series.worm.label,
                    f"{radius * _MM:g}",
                    f"{(radius / RADII_M[0]) ** 4:.2f}",
                    all_in_cm(series.held_m[i]) if i < len(series.held_m) else "–",
                    all_in_cm(series.walked_m[i]),
                    in_percent(outcome.summary.middle_deficit),
                    in_unit(outcome.summary.contraction_force_median_N),
                    rhythm_words(outcome.rhythm),
                ]
            )
    header = [
        "worm",
        "radius (mm)",
        "bending stiffness (1)",
        "open loop (cm)",
        "closed loop (cm)",
        "deficit, first helix (%)",
        "median force (N)",
        "rhythm",
    ]
    return Table(header, rows)


def _draw(every: Sequence[_Series], stem: Path) -> None:
    n_segments = every[0].walked_m.shape[1]
    walked = np.concatenate([series.walked_m.ravel() for series in every])
    top = 1.1 * CM * max(walked[np.isfinite(walked)], default=0.1)
    ticks = [radius * _MM for radius in RADII_M]
    with canvas(5.0) as figure:
        panels = figure.subplot_mosaic("abc;frr", height_ratios=[3.0, 2.2])
        tops = [panels[name] for name in "abc"]
        for axes, series in zip(tops, every, strict=True):
            x = [radius * _MM for radius in series.radii]
            draw_segments(axes, x, CM * series.walked_m, marker=series.worm.marker)
            draw_segments(
                axes,
                x[: len(series.held_m)],
                CM * series.held_m,
                hollow=True,
                marker=series.worm.marker,
                linestyle="--",
                linewidth=1.0,
            )
            panel_title(axes, capitalised(series.worm.label))
            axes.set_ylim(0.0, top)
        tops[0].set_ylabel("elongation (cm)")
        force, rhythms = panels["f"], panels["r"]
        for series in every:
            force.plot([radius * _MM for radius in series.radii], series.force_N, **series.worm.look)
        force.set_ylim(bottom=0.0)
        panel_title(force, "Force")
        panel_title(rhythms, "Rhythm")
        force.set_ylabel("median force (N)")
        rows = [(s.worm.short, [(r * _MM, o.rhythm) for r, o in zip(s.radii, s.outcomes, strict=True)]) for s in every]
        kinds = draw_rhythms(rhythms, rows)
        for axes in (*tops, force, rhythms):
            axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
            axes.set_xlim(ticks[0] - 0.1, ticks[-1] + 0.1)
            axes.set_xlabel("strand radius (mm)")
        loops = [
            look_handle("closed loop", marker="o"),
            look_handle("open loop", hollow=True, marker="o", linestyle="--"),
        ]
        worms = [look_handle(w.label, color=w.color, marker=w.marker, linestyle=w.line) for w in WORMS]
        legend_below(figure, [*segment_handles(n_segments), *loops, *worms, *kinds], 4)
        save_both(figure, stem)


RADIUS = Examination(
    name="radius",
    title="Radius of the strands",
    question="Thicker strands of the same mass resist bending more. What becomes of elongation, force and rhythm?",
    cases=_cases,
    examine=_examine,
)

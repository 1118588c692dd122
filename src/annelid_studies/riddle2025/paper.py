"""Riddle et al. 2025, examined: runs everything, draws the speeds, and gathers the report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from annelid.analysis import mean_and_interval
from annelid.draw import canvas, line_looks, panel_title, save_both
from annelid.experiment import Case, Store, StudyProgress
from annelid.markdown import Table
from annelid.simulation import locks
from annelid_lab.calibration import load_frame
from annelid_studies.papers.report_parts import Figure, Paper, Report, provenance
from annelid_studies.papers.words import CM, DASH, PERCENT, filled, in_unit, span, texts
from annelid_studies.riddle2025 import claims as judging
from annelid_studies.riddle2025 import runs
from annelid_studies.riddle2025.runs import Point, Reading
from annelid_studies.standard_cases import Effort
from annelid_studies.tables import grouped, tabulated, write_fields

PAPER = Paper(
    name="A 3D model predicts behavior of a soft bodied worm robot performing peristaltic locomotion",
    authors="Riddle et al. 2025",
    title="The paper of 2025, examined",
    heading="The claims of the paper of 2025",
    command="annelid study paper riddle2025 --claims docs/evidence/riddle2025.md",
    leading=(1,),
)
FRAME_DISPLACEMENT_M = 0.326
"""How far the cable is wound where the measured and the simulated forces of the authors are largest."""


@locks("folder")
def reproduce(
    folder: Path,
    effort: Effort = "full",
    *,
    executor: Executor | None = None,
    progress: StudyProgress | None = None,
) -> Report:
    """Runs what the claims need, as far as it has not been run into the folder before.

    Args:
        folder: The report's folder: it has ``runs``, ``figures``, and ``riddle2025.csv`` with a row for each run.
        effort: ``"quick"`` for one run of a few points, ``"full"`` for all.
        executor: Who computes the runs; None for a process of this machine on every core.
        progress: Called as the work goes on.

    Returns:
        The report, whose picture is drawn.
    """
    store = Store(folder / "runs", executor, progress=progress)
    cases = [case for point in runs.points(effort) for case in runs.cases(point, runs.DRAWS[effort])]
    outcomes = store.compute(cases, "running worms")
    readings = list(runs.readings(store, effort))
    evidence = judging.Evidence(readings, peaks_N())
    claims = judging.claims(evidence)
    words = texts(judging.CLAIMS_TOML)
    stem = folder / "figures" / "riddle2025"
    stem.parent.mkdir(exist_ok=True)
    picture = Figure(
        1, words["figure"]["title"], speeds_picture(readings, stem), filled(words["figure"]["caption"], {})
    )
    lengths = {"bend_s": runs.BEND_S, "bend_s_per_m": runs.BEND_S_PER_M}
    return Report(
        PAPER,
        effort=effort,
        summary=[filled(text, lengths) for text in words["summary"]],
        main_table=main_table(evidence),
        variants=points_table(readings),
        figures=[picture],
        claims=claims,
        examinations=[],
        provenance=provenance(outcomes.values()),
        rule=judging.rule(evidence, effort),
        files=[write_fields(Reading, readings, folder / "riddle2025.csv")],
    )


def peaks_N() -> dict[tuple[float, float], float]:
    """Closes our load frame, and returns its largest force, N, by Young's modulus, GPa, and friction of a pin, N m."""
    peaks = {}
    for modulus, friction in {*product(runs.MODULI_GPA, [0.0]), *product([runs.STIFF], judging.PIN_FRICTIONS_NM)}:
        changes = {**runs.stiffness(modulus), "body.joints.dry_friction_Nm": friction}
        loop = load_frame(Case("riddle2025-muscles", changes).config, displacement_m=FRAME_DISPLACEMENT_M)
        peaks[modulus, friction] = float(loop.force_N.max())
    return peaks


def main_table(evidence: judging.Evidence) -> Table:
    """Our numbers beside the published ones."""
    rows = []
    for rings in runs.RINGS:
        found = [
            evidence.speed(one)[0]
            for one in evidence.points(gait="3x1", rings=rings, modulus_GPa=runs.STIFF, bore_m=0.0)
        ]
        low, high = (in_unit(speed, CM, 1) for speed in judging.FLAT_M_PER_S)
        rows.append(
            [f"speed on flat ground, 3x1, 2 GPa, {rings} (cm/s)", f"{low} to {high} (secondary)", span(found, CM), ""]
        )
    straight = evidence.speed(Point("3x1, as in 2026", bore_m=runs.WIDE_M))[0]
    for quantity, paper, ours, scale in (
        ("speed in the straight wide pipe, a label (cm/s)", judging.STRAIGHT_LABEL_M_PER_S, straight, CM),
        *(
            (f"load frame at {E:g} GPa (N)", paper, evidence.peaks_N[E, 0.0], 1.0)
            for E, paper in judging.FRAME_N.items()
        ),
    ):
        off = in_unit(ours / paper - 1.0, PERCENT, 1, sign="+")
        rows.append([quantity, in_unit(paper, scale), in_unit(ours, scale), off if off == DASH else f"{off} %"])
    return Table(["quantity", "paper", "ours", "deviation"], rows)


def points_table(readings: Sequence[Reading]) -> Table:
    """What the runs of every point say."""
    columns: Mapping[str, Callable[[tuple[Point, list[Reading]]], str]] = {
        "ground": lambda one: one[0].ground,
        "worm": lambda one: one[0].worm,
        "friction": lambda one: f"{one[0].friction:g}",
        "runs": lambda one: str(len(one[1])),
        "speed (cm/s), 95 % interval": lambda one: judging.shown(
            mean_and_interval([run.speed_m_per_s for run in one[1]])
        ),
        "ring 1 out": lambda one: str(sum(run.came_out for run in one[1])) if one[0].radius_m else "",
        "farthest (m)": lambda one: span(run.front_m for run in one[1]),
        "doubts": lambda one: _doubts(one[1]),
    }
    return tabulated(grouped(readings, lambda one: one.point).items(), columns)


def _doubts(of: Sequence[Reading]) -> str:
    problems = [one.problem for one in of if one.problem]
    return f"{len(problems)} of {len(of)} runs: {problems[0]}" if problems else ""


def speeds_picture(readings: Sequence[Reading], stem: Path) -> Path:
    """Draws speed over friction and over the bends' radius, with what is published."""
    flat, narrow, wide = ([one for one in readings if one.bore_m == bore] for bore in (0.0, runs.NARROW_M, runs.WIDE_M))
    with canvas(6.0) as figure:
        (servos, muscles), (bends, axis) = figure.subplots(2, 2)
        for axes, rings in ((servos, "servos"), (muscles, "muscles")):
            _draw(axes, f"flat ground, {rings}", [one for one in flat if one.rings == rings], "friction")
            axes.axhspan(*(CM * speed for speed in judging.FLAT_M_PER_S), color="0.9", zorder=0)
        _draw(bends, "bends of a pipe of 0.16 m", [one for one in narrow if one.radius_m], "radius_m")
        _draw(axis, "bends of a pipe of 0.20 m", [one for one in wide if one.radius_m], "radius_m")
        axis.axhspan(*(CM * speed for speed in judging.AXIS_M_PER_S), color="0.9", zorder=0)
        axis.axhline(
            CM * judging.STRAIGHT_LABEL_M_PER_S, color="0.6", linestyle="dotted", label="published: straight pipe"
        )
        for height, (gait, least) in zip((0.97, 0.92), judging.SMALLEST_DRAWN_M.items(), strict=True):
            line = axis.get_xaxis_transform()
            axis.plot([least, 1.3], [height, height], color="0.4", linewidth=2.0, transform=line)
            axis.text(least - 0.02, height, f"published: {gait}", transform=line, ha="right", va="center", fontsize=6.0)
        axis.set_xlim(0.1, 1.4)
        for axes in (servos, muscles, bends, axis):
            axes.set_ylim(0.0, 1.35 * axes.get_ylim()[1])
            if axes.get_legend_handles_labels()[0]:
                axes.legend(fontsize=6.0, loc="lower right" if axes is axis else "upper left", ncols=2)
        return save_both(figure, stem)


def _draw(axes: Axes, title: str, readings: Sequence[Reading], over: str) -> None:
    panel_title(axes, f"{title}: speed (cm/s)")
    axes.set_xlabel("friction of the ground" if over == "friction" else "radius of the centre line (m)")
    worms = grouped([one for one in readings if not one.half_step], lambda one: one.point.worm)
    for (worm, own), look, marker in zip(worms.items(), line_looks(max(len(worms), 1)), "os^vDP", strict=False):
        places = grouped(own, lambda one: getattr(one, over))
        speeds = [mean_and_interval([run.speed_m_per_s for run in of]) for of in places.values()]
        mean, low, high = CM * np.array(speeds).T
        axes.errorbar([*places], mean, [mean - low, high - mean], **look, marker=marker, capsize=2.0, label=worm)

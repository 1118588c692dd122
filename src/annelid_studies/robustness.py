"""How wide the range is in which a controller walks: a designed sample of worms, each walked by every controller.

The sample is a Latin hypercube of 300 points over sensor noise, friction, physics step, number of segments, stiffness
and seeds. It was drawn once and lies in ``robustness.csv``; how it was drawn is in its test. The worms are rods with
rigid crossings. A point is *walked* if the rhythm is ordered, in one wave from front to rear, and *in time* if its
period is also within 10 % of design. The robust controller's network starts from its design, from silence, and from
random states in turn; the paper's from its own start, its best case. The first two turns are not judged.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from annelid.analysis import DESIGN_INTERVAL_S, RhythmScore, lengthening_score, rhythm_score
from annelid.errors import ConfigError, suggest
from annelid.experiment import SHEAR_OVER_YOUNG, Case, Store, StudyProgress
from annelid.markdown import Table, plain_table
from annelid.output import write_text
from annelid.simulation import locks
from annelid_studies.standard_cases import PAPERS_RODS, RODS
from annelid_studies.tables import grouped

CONTROLLERS = ("sns", "sns-tolerance", "sns-robust", "timed")
"""The paper's with the preset's tolerance, and with the tolerance that the body needs; ours; a wave without sensing."""
TABLE = "robustness.csv"
RESULTS = "robustness.json"
SETTLING_S = 2.0 * DESIGN_INTERVAL_S
"""Not judged at the start of a run: within two turns the robust network has found its rhythm from any state, s."""
CYCLES = 2.3
"""How long a run is judged, in design periods: the score needs two cycles of every segment."""
STARTS = ("design", "silent", "random")
"""How the robust network starts, in turn."""
PERIOD_TOLERANCE = 0.1
TIMED = {"kind": "timed", "rise_s": 0.0, "hold_s": DESIGN_INTERVAL_S, "fall_s": 0.0, "interval_s": DESIGN_INTERVAL_S}
"""A wave of the paper's turns: its muscles' rhythm is in time by construction, its segments' lengthening is not."""


@dataclass(frozen=True, slots=True)
class Point:
    """One point of the sample."""

    noise_m: float  # Standard deviation of the noise on every reading of a stretch sensor, m
    friction: float  # Friction of the floor
    physics_timestep_ms: int  # Step of the body, whole ms
    n_segments: int  # Number of segments
    young_modulus_Pa: float  # Of the strands, Pa
    seed: int  # Of the noise, and of how the network starts
    tolerance_m: float  # Of the stretch sensors: the middle of the window, as estimated when the sample was drawn, m

    @property
    def design_period_s(self) -> float:
        """The period by design, s."""
        return self.n_segments * DESIGN_INTERVAL_S

    @property
    def start(self) -> str:
        """How the robust network starts."""
        return STARTS[self.seed % len(STARTS)]

    def case(self, controller: str) -> Case:
        """Returns the run of this point under a controller, one of `CONTROLLERS`."""
        case = Case(
            RODS,
            {
                **PAPERS_RODS,
                "sensor.noise_m": self.noise_m,
                "arena.friction": self.friction,
                "clock.physics_timestep_s": self.physics_timestep_ms / 1e3,
                "body.mesh.n_segments": self.n_segments,
                "body.strands.young_modulus_Pa": self.young_modulus_Pa,
                "body.strands.shear_modulus_Pa": SHEAR_OVER_YOUNG * self.young_modulus_Pa,
                "seed": self.seed,
                "duration_s": round(SETTLING_S + CYCLES * self.design_period_s, 1),
            },
        )
        if controller == "sns-robust":
            return case.but({"controller": {"kind": "sns-robust", "start": self.start}})
        if controller == "timed":
            return case.but({"controller": TIMED})
        if controller == "sns-tolerance":
            return case.but({"sensor.tolerance_m": self.tolerance_m})
        return case


@dataclass(frozen=True, slots=True)
class Judged:
    """How one point went under one controller."""

    point: int  # Number of the point, from 0 in the order drawn
    controller: str  # One of `CONTROLLERS`
    n_segments: int  # Segments of the worm that was run
    reason: str  # What the score says, or why the run ended before its time
    period_s: float | None  # Mean period, s; None if no segment repeats
    walked: bool  # Ordered, in one wave from front to rear, to the end
    in_time: bool  # Walked, with a period within 10 % of design
    lengthened: bool  # The segments lengthened in one wave from front to rear as well


def points() -> tuple[Point, ...]:
    """Returns the sample as it was drawn once."""
    lines = files("annelid_studies").joinpath(TABLE).read_text(encoding="utf-8").splitlines()
    return tuple(Point(*row) for row in np.genfromtxt(lines, delimiter=",", names=True, dtype=None).tolist())


def judge(
    number: int, point: Point, controller: str, rhythm: RhythmScore, lengthening: RhythmScore, message: str = ""
) -> Judged:
    """Judges one run by the scores of its activation and of its segments' lengthening, and why it ended too early."""
    walked, period = not message and rhythm.is_one_wave, rhythm.period_s
    return Judged(
        point=number,
        controller=controller,
        n_segments=point.n_segments,
        reason=message or rhythm.reason,
        period_s=period,
        walked=walked,
        in_time=walked and period is not None and abs(period / point.design_period_s - 1.0) <= PERIOD_TOLERANCE,
        lengthened=not message and lengthening.is_one_wave,
    )


@locks("folder")
def robustness(
    folder: Path,
    n_points: int,
    *,
    controllers: Sequence[str] = CONTROLLERS,
    n_segments: int | None = None,
    executor: Executor | None = None,
    progress: StudyProgress | None = None,
) -> list[Judged]:
    """Walks the first points of the sample under each controller, as far as the folder does not have their runs.

    Args:
        folder: Folder of the results; runs go to ``runs`` within it. ``robustness.json`` and ``robustness.md`` are of
            all of the sample's runs that are there, also those of other calls, and are written also when interrupted.
        n_points: How many points, in the order drawn.
        controllers: Some of `CONTROLLERS`.
        n_segments: Gives every worm this many segments in place of its own, for a sample of the other quantities
            that costs less; None for the sample as it is.
        executor: Who computes the runs; None for a process of this machine on every core.
        progress: Called before the first and after every run.

    Returns:
        The judgements of all of the sample's runs that the folder holds now, by controller and point.

    Raises:
        ConfigError: No points, more than the sample has, or an unknown controller.
        AnnelidError: A run cannot be built or written.
    """
    sample = points()
    if not 1 <= n_points <= len(sample):
        raise ConfigError(f"points must be in 1 .. {len(sample)}, the size of the sample, not {n_points}")
    for controller in controllers:
        if controller not in CONTROLLERS:
            raise ConfigError(f"unknown controller {controller!r}: {suggest(controller, CONTROLLERS)}")
    if n_segments is not None:
        sample = tuple(replace(point, n_segments=n_segments) for point in sample)
    store = Store(folder / "runs", executor, progress=progress)
    try:
        store.compute([point.case(kind) for kind in controllers for point in sample[:n_points]], "robustness")
    finally:
        if judged := _judged(store, sample):
            found = shares(judged)
            content = {"shares": found, "judged": [*map(asdict, judged)]}
            write_text(folder / RESULTS, json.dumps(content, indent=1) + "\n")
            write_text(folder / "robustness.md", shares_table(found) + "\n")
    return judged


def _judged(store: Store, sample: Sequence[Point]) -> list[Judged]:
    """Judges every run of the sample that the store has."""
    judged = []
    for kind in CONTROLLERS:
        for i, point in enumerate(sample):
            if (case := point.case(kind)) in store:
                run = store.run(case)
                scores = rhythm_score(run, SETTLING_S), lengthening_score(run, SETTLING_S)
                judged.append(judge(i, point, kind, *scores, store[case].message))
    return judged


def shares(judged: Sequence[Judged]) -> dict[str, dict[str, Any]]:
    """Counts by controller.

    Returns:
        For every controller the number of points, of those walked, in time, and in time with their segments lengthening
        in the same order, and the share in time with its 95 % interval after Wilson 1927.
    """
    found: dict[str, dict[str, Any]] = {}
    for controller, own in grouped(judged, lambda one: one.controller).items():
        n, good = len(own), sum(one.in_time for one in own)
        found[controller] = {
            "points": n,
            "walked": sum(one.walked for one in own),
            "in_time": good,
            "lengthened": sum(one.in_time and one.lengthened for one in own),
            "share": good / n,
            "interval": [*map(float, binomtest(good, n).proportion_ci(method="wilson"))],
        }
    return found


def shares_table(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Returns what `shares` counted as a Markdown table."""
    rows = []
    for controller, of in found.items():
        share, low, high = (100 * share for share in (of["share"], *of["interval"]))
        counts = [str(of[name]) for name in ("points", "walked", "in_time", "lengthened")]
        rows.append([f"`{controller}`", *counts, f"{share:.0f} ({low:.0f} .. {high:.0f})"])
    counted = ["points", "walked 1-2-..-N", "in time: within 10 % of the period", "and so lengthened"]
    return plain_table(Table(["controller", *counted, "share in time (%)"], rows))

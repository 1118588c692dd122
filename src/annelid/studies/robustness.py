"""How wide the range is in which a controller walks: a designed sample of worms, each walked by every controller.

The sample is a Latin hypercube of 300 points over sensor noise, friction, physics step, number of segments, stiffness
and seeds. It was drawn once, by `draw`, and lies in ``robustness.csv``. The worms are the tight rods. A point is
*walked* if the rhythm is ordered, in one wave from front to rear, and *in time* if its period is also within 10 % of
design.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from importlib.resources import files
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

from annelid.analysis.score import DESIGN_INTERVAL_S, RhythmScore
from annelid.errors import ConfigError
from annelid.studies.case import RODS, Case
from annelid.studies.markdown import table
from annelid.studies.store import Store, case_key
from annelid.view.output import whole_file

CONTROLLERS = ("sns", "sns-robust")
"""The paper's and ours, by their kinds."""
TABLE = "robustness.csv"
CYCLES = 2.6
"""Length of a run in design periods: the score needs two cycles of every segment."""
PERIOD_TOLERANCE = 0.1
SHEAR_OVER_YOUNG = 2.0 / 3.0
"""The paper's ratio of the strands' shear and Young's moduli."""

Progress = Callable[[str, int, int, float], object]
"""Called with the stage, the number of points done, their total, and the share of the work that is done."""


@dataclass(frozen=True, slots=True)
class Point:
    """One point of the sample.

    Attributes:
        noise_m: Standard deviation of the noise on every reading of a stretch sensor, m.
        friction: Friction of the floor.
        physics_timestep_ms: Step of the body, whole ms.
        n_segments: Number of segments.
        young_modulus_Pa: Of the strands, Pa.
        seed: Of the noise.
    """

    noise_m: float
    friction: float
    physics_timestep_ms: int
    n_segments: int
    young_modulus_Pa: float
    seed: int

    @property
    def design_period_s(self) -> float:
        """The period by design, s."""
        return self.n_segments * DESIGN_INTERVAL_S

    def case(self, controller: str) -> Case:
        """Returns the run of this point under a controller, given by its kind."""
        return Case(
            RODS,
            {
                "sensor.noise_m": self.noise_m,
                "arena.friction": self.friction,
                "clock.physics_timestep_s": self.physics_timestep_ms / 1e3,
                "body.mesh.n_segments": self.n_segments,
                "body.strands.young_modulus_Pa": self.young_modulus_Pa,
                "body.strands.shear_modulus_Pa": SHEAR_OVER_YOUNG * self.young_modulus_Pa,
                "seed": self.seed,
                "duration_s": round(CYCLES * self.design_period_s, 1),
                **({} if controller == "sns" else {"controller": {"kind": controller}}),
            },
        )


@dataclass(frozen=True, slots=True)
class Judged:
    """How one point went under one controller.

    Attributes:
        point: Number of the point, from 0 in the order drawn.
        controller: Kind of the controller.
        reason: What the score says, or why the run ended before its time.
        period_s: Mean period, s; None if no segment repeats.
        walked: Ordered, in one wave from front to rear, to the end.
        in_time: Walked, with a period within 10 % of design.
    """

    point: int
    controller: str
    reason: str
    period_s: float | None
    walked: bool
    in_time: bool


def draw(n_points: int = 300, seed: int = 6) -> list[Point]:
    """Draws a Latin hypercube: every quantity has one point in each of ``n_points`` strata of equal weight.

    Noise is spread evenly over 0 .. 5 mm; friction over 0.05 .. 1.5, step over 1 .. 10 ms and stiffness over 0.3 .. 2
    GPa evenly in the logarithm; segments evenly over 3 .. 24. Steps are rounded to whole ms.

    Args:
        n_points: Number of points.
        seed: Of the draw.
    """
    rng = np.random.default_rng(seed)
    unit = np.column_stack([(rng.permutation(n_points) + rng.random(n_points)) / n_points for _ in range(5)])

    def log_spread(share: float, low: float, high: float) -> float:
        return low * (high / low) ** share

    return [
        Point(
            noise_m=round(0.005 * noise, 6),
            friction=round(log_spread(friction, 0.05, 1.5), 4),
            physics_timestep_ms=round(log_spread(step, 1.0, 10.0)),
            n_segments=3 + int(22 * segments),
            young_modulus_Pa=round(log_spread(stiffness, 0.3e9, 2.0e9), -5),
            seed=i,
        )
        for i, (noise, friction, step, segments, stiffness) in enumerate(unit.tolist())
    ]


def write_points(points: Sequence[Point], path: Path) -> None:
    """Writes a sample as CSV with a header."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Point)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(point) for point in points)


def points() -> tuple[Point, ...]:
    """Returns the sample as it was drawn once."""
    text = files("annelid.studies").joinpath(TABLE).read_text(encoding="utf-8")
    return tuple(
        Point(
            noise_m=float(row["noise_m"]),
            friction=float(row["friction"]),
            physics_timestep_ms=int(row["physics_timestep_ms"]),
            n_segments=int(row["n_segments"]),
            young_modulus_Pa=float(row["young_modulus_Pa"]),
            seed=int(row["seed"]),
        )
        for row in csv.DictReader(text.splitlines())
    )


def judge(number: int, point: Point, controller: str, rhythm: RhythmScore, message: str = "") -> Judged:
    """Judges the score of one run.

    Args:
        number: Number of the point.
        point: The point.
        controller: Kind of the controller.
        rhythm: The score of its run.
        message: Why the run ended before its time; empty if it did not.
    """
    walked = not message and rhythm.verdict == "ordered" and rhythm.direction == 1 and rhythm.wave_fronts == 1
    period = rhythm.period_s
    in_time = walked and period is not None and abs(period / point.design_period_s - 1.0) <= PERIOD_TOLERANCE
    return Judged(number, controller, message or rhythm.reason, period, walked, in_time)


def robustness(
    folder: Path,
    n_points: int,
    *,
    n_segments: int | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> list[Judged]:
    """Walks the first points of the sample under every controller, as far as they are not in the folder.

    Args:
        folder: Folder of the results; runs go to ``runs`` within it. Written after every point, so that a stopped study
            shows what it has: ``robustness.json`` and ``robustness.md``.
        n_points: How many points, in the order drawn.
        n_segments: Gives every worm this many segments in place of its own, for a sample of the other quantities
            that costs less; None for the sample as it is.
        jobs: Processes; default: one a core.
        progress: Called before the first and after every point.

    Returns:
        The judgements, point by point.

    Raises:
        ConfigError: No points, or more than the sample has.
        AnnelidError: A run cannot be built or written.
    """
    sample = points()
    if not 1 <= n_points <= len(sample):
        raise ConfigError(f"points must be in 1 .. {len(sample)}, the size of the sample, not {n_points}")
    store, chosen = Store(folder / "runs"), sample[:n_points]
    if n_segments is not None:
        chosen = tuple(replace(point, n_segments=n_segments) for point in chosen)
    cases = {(i, controller): point.case(controller) for i, point in enumerate(chosen) for controller in CONTROLLERS}
    costs = [sum(cases[i, controller].cost_s for controller in CONTROLLERS) for i in range(n_points)]
    # As many points together as keep all processes busy.
    together = max(1, (jobs or os.cpu_count() or 1) // len(CONTROLLERS))
    judged: list[Judged] = []
    for first in range(0, n_points, together):
        if progress is not None:
            progress("robustness", first, n_points, sum(costs[:first]) / sum(costs))
        batch = {key: case for key, case in cases.items() if first <= key[0] < first + together}
        found = store.compute(batch.values(), jobs=jobs)
        for (i, controller), case in batch.items():
            outcome = found[case_key(case)]
            judged.append(judge(i, chosen[i], controller, outcome.rhythm, outcome.message))
        _write(judged, folder)
    return judged


def shares(judged: Sequence[Judged]) -> dict[str, dict[str, Any]]:
    """Counts by controller.

    Returns:
        For every controller the number of points, of those walked and of those in time, and the share in time with its
        95 % interval after Wilson.
    """
    found: dict[str, dict[str, Any]] = {}
    for controller in dict.fromkeys(one.controller for one in judged):
        of_it = [one for one in judged if one.controller == controller]
        n, good = len(of_it), sum(one.in_time for one in of_it)
        low, high = wilson(good, n)
        walked = sum(one.walked for one in of_it)
        found[controller] = {"points": n, "walked": walked, "in_time": good, "share": good / n, "interval": [low, high]}
    return found


def wilson(successes: int, n: int, z: float = 1.959964) -> tuple[float, float]:
    """Interval of a share of ``successes`` out of ``n``, after Wilson 1927; by default of 95 %."""
    share, z2 = successes / n, z * z / n
    middle = (share + z2 / 2.0) / (1.0 + z2)
    half = z * sqrt(share * (1.0 - share) / n + z2 / (4.0 * n)) / (1.0 + z2)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def shares_table(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Returns what `shares` counted as a Markdown table."""
    rows = [
        [
            f"`{controller}`",
            str(of["points"]),
            str(of["walked"]),
            str(of["in_time"]),
            f"{100 * of['share']:.0f} ({100 * of['interval'][0]:.0f} .. {100 * of['interval'][1]:.0f})",
        ]
        for controller, of in found.items()
    ]
    return table(["controller", "points", "walked 1-2-..-N", "and within 10 % of the period", "share (%)"], rows)


def _write(judged: Sequence[Judged], folder: Path) -> None:
    found = shares(judged)
    content = {"shares": found, "judged": [asdict(one) for one in judged]}
    folder.mkdir(parents=True, exist_ok=True)
    texts = {"robustness.json": json.dumps(content, indent=1), "robustness.md": shares_table(found)}
    for name, text in texts.items():
        with whole_file(folder / name) as draft:
            draft.write_text(text + "\n", encoding="utf-8")

"""The runs that Riddle et al. 2025 is examined by: worms on flat ground and in pipes, and what is read from each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from math import ceil, nan
from typing import Any, NamedTuple

import numpy as np

from annelid.analysis import Track, passage_of, track_of
from annelid.experiment import Case, Outcome, Store
from annelid.morphology import Array
from annelid.simulation import Run
from annelid_studies.standard_cases import Effort, drawn_frictions

GAITS: Mapping[str, Mapping[str, Any]] = {
    "3x1": {},
    "2x1": {"controller.interval_s": 2.0},
    "3x1, touch": {"turning": {"kind": "touch"}},
    "3x1, as in 2026": {"body.springs.stiffness_N_per_m": 75.0, "body.rings.force_limit_N": 100.0},
}
"""Segments that contract at once times waves, as the authors' scripts name them, and what each changes of 3x1.

`touch` turns away from contact as they published it; the last has the springs and the servos' force limit of 2026."""
RINGS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "servos": ("riddle2025-3x1", {}),
    "muscles": (
        "riddle2025-muscles",
        {"controller": {"kind": "timed"}, "body.rings.length_range_m": [0.62, 0.96], "body.rings.minimum_length": 0.5},
    ),
}
"""Preset and changes. The model of 2025 has muscles of these lengths and the engine's default lmin; servos on
half-rings are those of 2026, and keep to these lengths."""
MODULI_GPA: Mapping[float, float] = {2.0: 1.33, 1.0: 0.667, 0.3: 0.2}
"""Young's and shear modulus of the strands in the authors' files."""
STIFF, SOFT = 2.0, 0.3
FRICTIONS = (0.1, 0.3, 0.7, 1.0)
"""Of flat ground; the authors have 0.01 and 0.1, 0.2, .. 1.0."""
NARROW_M, WIDE_M = 0.16, 0.20
"""Radii of the authors' pipes of 2025 and of 2026."""
RADII_M: Mapping[str, tuple[float, ...]] = {"servos": (0.3, 0.5, 0.7), "muscles": (0.3, 0.5)}
"""Of the bends' centre lines in the narrow pipe; the authors have 0.2, 0.3, .. 0.9 m."""
TIGHT_M = 0.3
"""Radius of the bend that the paper has soft worms pass alone."""
WIDE_RADII_M = (0.5, 0.7, 1.3)
"""In the wide one; the authors have 0.5, 0.6, .. 1.3 m."""
STRAIGHT_M = 0.25
PIPE: Mapping[str, Any] = {
    "kind": "pipe",
    "contact_time_constant_s": 0.01,
    "contact_impedance": [0.99, 0.999, 0.001],
}
"""Straight for 0.25 m before a bend; contacts as in the catalogue."""
CYCLES, AUTHORS_FLAT_S = 2, 80.0
"""Complete cycles without a bend, of which the last is repeated up to the 80 s that the authors simulate."""
BEND_S, BEND_S_PER_M = 36.0, 25.0
"""Runs in bends last so long, and longer with the radius: enough for a worm that does not get stuck; the authors'
last 100 s."""
DRAWS: Mapping[Effort, int] = {"quick": 1, "full": 8}
"""Runs of each point, with frictions drawn within one percent."""


class Point(NamedTuple):
    """A worm on one ground."""

    gait: str = "3x1"  # One of `GAITS`
    rings: str = "servos"  # One of `RINGS`
    modulus_GPa: float = STIFF  # Young's modulus of the strands
    friction: float = 0.3
    bore_m: float = 0.0  # Radius of the pipe; 0 for flat ground
    radius_m: float = 0.0  # Of the bend's centre line; 0 without one
    half_step: bool = False  # Whether the physics step is half the preset's

    @property
    def ground(self) -> str:
        """What tables call its ground."""
        if not self.bore_m:
            return "flat"
        return f"{f'bend of {self.radius_m:g} m' if self.radius_m else 'straight pipe'}, bore {self.bore_m:g} m"

    @property
    def worm(self) -> str:
        """What tables call its worm."""
        return f"{self.gait}, {self.rings}, {self.modulus_GPa:g} GPa{', half the step' if self.half_step else ''}"


@dataclass(frozen=True, slots=True)
class Reading:
    """What one run says."""

    gait: str  # As the point's
    rings: str  # As the point's
    modulus_GPa: float  # As the point's
    friction: float  # As the point's
    bore_m: float  # As the point's
    radius_m: float  # As the point's
    half_step: bool  # As the point's
    drawn_friction: float  # The run's own
    speed_m_per_s: float  # Of the foremost ring, as the authors define it; NaN for a run that a guard stopped
    front_m: float  # The farthest arc length that the foremost ring came to in a bend, or distance elsewhere
    came_out: bool  # Whether it left the bend
    problem: str  # Why the run was stopped, or is doubtful

    @property
    def point(self) -> Point:
        """The point that it is a run of."""
        return Point(*(getattr(self, name) for name in Point._fields))


def points(effort: Effort) -> list[Point]:
    """Lays out the points; in a full report every fourth, and all tight bends, once more at half the step."""
    if effort == "quick":
        flat = [Point(modulus_GPa=modulus, friction=mu) for modulus in (STIFF, SOFT) for mu in (0.1, 1.0)]
        bends = [
            Point(modulus_GPa=modulus, bore_m=NARROW_M, radius_m=r) for modulus in (STIFF, SOFT) for r in (0.3, 0.5)
        ]
        return [*flat, Point("2x1", friction=1.0), *bends, Point("3x1, as in 2026", bore_m=WIDE_M)]
    whole = [Point("3x1", *worm) for worm in product(RINGS, (STIFF, SOFT), FRICTIONS)]
    whole += [Point("2x1", *worm) for worm in product(RINGS, (STIFF, SOFT), (0.3, 0.7))]
    for rings, radii in RADII_M.items():
        whole += [Point("3x1", rings, E, 0.3, NARROW_M, r) for E, r in product((STIFF, SOFT), radii)]
    whole += [Point(modulus_GPa=1.0, bore_m=NARROW_M, radius_m=TIGHT_M)]
    whole += [Point(gait, bore_m=WIDE_M) for gait in ("3x1", "3x1, as in 2026")]
    whole += [Point(bore_m=WIDE_M, radius_m=r) for r in WIDE_RADII_M]
    whole += [Point("3x1, touch", bore_m=WIDE_M, radius_m=0.5)]
    finer = [one for i, one in enumerate(whole) if i % 4 == 0 or one.radius_m == TIGHT_M]
    return [*whole, *(point._replace(half_step=True) for point in finer)]


def stiffness(modulus_GPa: float) -> dict[str, float]:
    """Returns what gives the presets' strands another Young's modulus of the authors' files, with its shear modulus."""
    if modulus_GPa == STIFF:
        return {}
    moduli = {"young_modulus_Pa": modulus_GPa, "shear_modulus_Pa": MODULI_GPA[modulus_GPa]}
    return {f"body.strands.{name}": 1e9 * value for name, value in moduli.items()}


def cycle_s(point: Point) -> float:
    """Returns the time of a cycle of a point's gait, s."""
    return 12.0 if point.gait == "2x1" else 6.0


def cases(point: Point, draws: int) -> list[Case]:
    """Returns the runs of a point; at half the step that of the first draw alone."""
    preset, own = RINGS[point.rings]
    changes = {**own, **GAITS[point.gait], **stiffness(point.modulus_GPa), "duration_s": CYCLES * cycle_s(point)}
    if point.bore_m:
        changes["arena"] = {**PIPE, "bore_m": point.bore_m}
    if point.radius_m:
        changes["arena"] |= {"course": "bend", "straight_m": STRAIGHT_M, "radius_m": point.radius_m}
        changes["duration_s"] = round(BEND_S + BEND_S_PER_M * point.radius_m, 0)
    changes |= {"record.frames_interval_s": 0.1, "record.signals_interval_s": 0.02}
    if point.half_step:
        changes["clock.physics_timestep_s"] = Case(preset).config.clock.physics_timestep_s / 2
    drawn = drawn_frictions(point.friction, draws)
    return [Case(preset, {**changes, **one}) for one in (drawn[:1] if point.half_step else drawn)]


def readings(store: Store, effort: Effort) -> Iterator[Reading]:
    """Reads every run of a store that has computed them."""
    for point in points(effort):
        for case in cases(point, DRAWS[effort]):
            yield _read(point, case, store[case], store.run(case))


def _read(point: Point, case: Case, outcome: Outcome, run: Run) -> Reading:
    friction = case.changes["arena.friction"]
    if outcome.message:
        return Reading(*point, friction, nan, nan, False, f"stopped: {outcome.message}")
    if point.radius_m:
        passage = passage_of(run)
        farthest = float(passage.front_m.max())
        found = passage.speed_m_per_s(), farthest, farthest >= passage.reach_m[1]
    else:
        track = track_of(run)
        place = ahead_m(track)
        speed = speed_of_line(*repeated(track.time_s, place, cycle_s(point), AUTHORS_FLAT_S))
        found = speed, float(place[-1]), False
    return Reading(*point, friction, *found, "; ".join(outcome.summary.warnings))


def ahead_m(track: Track) -> Array:
    """Returns how far the foremost ring has come along the initial heading, m, ``(n,)``."""
    heading = track.heading_rad[0]
    along: Array = -(track.front_m - track.front_m[0]) @ np.array([np.cos(heading), np.sin(heading)])
    return along


def repeated(time_s: Array, place_m: Array, cycle_s: float, until_s: float) -> tuple[Array, Array]:
    """Goes on with a path by repeating its last cycle; times are evenly spaced, and a cycle is a whole number of them.

    Returns:
        Times, s, and places, m, ``(n,)`` each.
    """
    per_cycle = round(cycle_s / (time_s[1] - time_s[0]))
    stride, last = place_m[-1] - place_m[-1 - per_cycle], place_m[-per_cycle:]
    n = ceil((until_s - time_s[-1]) / cycle_s)
    further_time = time_s[-per_cycle:] + cycle_s * np.arange(1, n + 1)[:, np.newaxis]
    further = last + stride * np.arange(1, n + 1)[:, np.newaxis]
    time, place = np.append(time_s, further_time), np.append(place_m, further)
    kept = time <= until_s + 1e-9
    return time[kept], place[kept]


def speed_of_line(time_s: Array, place_m: Array) -> float:
    """Speed on flat ground as the authors read it: the slope of a line through the path up to its farthest point, m/s.

    A path that ends behind its start is read up to the point farthest back.
    """
    end = int(place_m.argmin() if place_m[-1] < 0 else place_m.argmax())
    return float(np.polyfit(time_s[:end], place_m[:end], 1)[0]) if end > 1 else 0.0

"""The sweeps: one quantity of the worm or its ground at a time, every kind of actuator at every value.

Beside them stands what it would take that two interior segments differ as the robot's do, which its model's do not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from annelid.analysis import ROBOT_ELONGATION_M, interior_deficit
from annelid.errors import ConfigError
from annelid.experiment import Case, Store
from annelid.morphology import Array
from annelid_studies.standard_cases import Effort
from annelid_studies.tables import grouped
from annelid_studies.weak_middle.pulls import (
    GUESSES_M,
    Actuator,
    Key,
    Pulled,
    Setting,
    base_body,
    force_limited,
    pull,
    read_pull,
    settings,
)


class Quantity(NamedTuple):
    """What one sweep varies."""

    name: str  # In one word, for the CSV
    label: str  # For the axis of a panel and the head of a table, with its unit
    values: tuple[float, ...]  # Values of the full study, in that unit
    changes: Callable[[float], dict[str, Any]]  # Fields of the base worm for a value
    quick: tuple[float, ...] = ()  # Values of the quick study
    title: str = ""  # In a few words, for a panel


def stiffness_changes(young_GPa: float) -> dict[str, Any]:
    """Fields for a Young's modulus, GPa.

    The shear modulus keeps its ratio to it and the damping its time: soft rods come to rest as soon as stiff ones.
    """
    strands = base_body().strands
    share = young_GPa * 1e9 / strands.one_number("young_modulus_Pa")
    return {
        "body.strands.young_modulus_Pa": young_GPa * 1e9,
        "body.strands.shear_modulus_Pa": round(share * strands.one_number("shear_modulus_Pa")),
    }


def weight_changes(mass_kg: float) -> dict[str, Any]:
    """Fields for a mass of the worm, kg, that its pins carry; 0 is a worm of the base worm's mass without weight."""
    if mass_kg == 0:
        return {"arena.gravity_m_per_s2": 0.0}
    body = base_body()
    mesh = body.geometry()
    strands_kg = mesh.n_strands * mesh.strand_length_m * body.strands.one_number("linear_density_kg_per_m")
    if mass_kg <= strands_kg:
        raise ConfigError(f"mass_kg = {mass_kg:g} must be above {strands_kg:.3f}, which the strands weigh alone")
    return {"body.pins.mass_kg": round((mass_kg - strands_kg) / mesh.n_crossings, 9)}


SEGMENTS = Quantity(
    "segments",
    "number of segments",
    (3, 4, 6, 8),
    lambda n_segments: {"body.mesh.n_segments": int(n_segments)},
    (3, 4),
    "Length of the worm",
)
STIFFNESS = Quantity(
    "stiffness",
    "Young's modulus (GPa)",
    (0.3, 0.8, 2.0),
    stiffness_changes,
    (0.8, 2.0),
    "Stiffness of the rods",
)
WEIGHT = Quantity("weight", "mass of the worm (kg)", (0.0, 0.77, 1.87, 3.0), weight_changes, (0.0, 1.87), "Weight")
FRICTION = Quantity(
    "friction",
    "friction of the ground",
    (0.05, 0.2, 0.7, 1.0),
    lambda friction: {"arena.friction": friction},
    (0.2, 0.7),
    "Friction",
)
QUANTITIES = (SEGMENTS, STIFFNESS, WEIGHT, FRICTION)
"""The sweeps. Every one passes through the base worm."""
BASE = {"segments": 4.0, "stiffness": 2.0, "weight": 1.87, "friction": 0.7}
"""The base worm's values, to the digits in which the sweeps state theirs."""
BASE_KEY: Key = ("base", 0.0)

CHECKS: Mapping[str, dict[str, Any]] = {
    "half the step": {"clock.control_timestep_s": 0.005, "clock.physics_timestep_s": 0.005},
    "four elements a side, half the step": {
        "body.mesh.elements_per_side": 4,
        "clock.control_timestep_s": 0.005,
        "clock.physics_timestep_s": 0.005,
    },
}
"""Resolutions at which some readings are taken again."""
CHECKED_KG = (0.77, 1.87, 3.0)
"""Masses of the worms whose readings they are, force-limited."""


@dataclass(frozen=True)
class Point:
    """One worm with one kind of actuator."""

    quantity: str  # Name of the quantity that is varied
    value: float
    n_segments: int  # Number of segments
    actuator: Actuator  # What pulls
    # Fields in which worm, ground and resolution differ from the base
    changes: Mapping[str, Any] = field(default_factory=dict)
    resolution: str = ""  # The resolution in words; empty for the study's own
    # Segments that are pulled; empty for the front half, of which the rear half is the mirror image
    only: tuple[int, ...] = ()

    @property
    def cases(self) -> dict[int, Case]:
        """The runs by the segment that is pulled alone."""
        segments = self.only or range(1, (self.n_segments + 1) // 2 + 1)
        return {segment: pull(segment, self.actuator, self.changes) for segment in segments}


@dataclass(frozen=True)
class Reading:
    """What was found at a point, one reading a pulled segment."""

    point: Point
    pulled: tuple[Pulled, ...]

    @property
    def problem(self) -> str:
        """Why there is no deficit; empty if there is one."""
        return "; ".join(f"segment {one.segment} {one.problem}" for one in self.pulled if one.problem)

    @property
    def elongation_m(self) -> list[float]:
        """Elongation of every segment when pulled alone, m; of the chosen segments where not all were."""
        read = [one.elongation_m for one in self.pulled]
        return read if self.point.only else read + read[: self.point.n_segments // 2][::-1]

    @property
    def deficit(self) -> float:
        """How far the interior stays below the ends, a fraction; NaN where not every segment has a reading."""
        return nan if self.problem or self.point.only else interior_deficit(self.elongation_m)


def compute(store: Store, points: Sequence[Point], stage: str) -> list[Reading]:
    """Pulls the segments of points, as far as the store does not have it."""
    store.compute([case for point in points for case in point.cases.values()], stage)
    return [Reading(one, tuple(read_pull(i, store[case]) for i, case in one.cases.items())) for one in points]


def values_of(quantity: Quantity, effort: Effort) -> tuple[float, ...]:
    """Returns the values of a quantity that are swept at an effort."""
    return quantity.values if effort == "full" else quantity.quick


def worm_key(quantity: Quantity, value: float) -> Key:
    """Names the worm that the actuators of a point are set for; longer worms have those of the base worm."""
    longer = quantity is SEGMENTS and value > BASE[SEGMENTS.name]
    return BASE_KEY if longer or value == BASE[quantity.name] else (quantity.name, value)


def sweep_points(quantity: Quantity, effort: Effort, set_to: Mapping[Key, Setting]) -> list[Point]:
    """Returns the points of a sweep.

    Force, cable length and activation are set anew for every worm, by its `worm_key`, so that an end always elongates
    alike, but for longer worms, which have those of the base worm. The servo is the base worm's everywhere.
    """
    points = []
    for value in values_of(quantity, effort):
        actuators = set_to[worm_key(quantity, value)].actuators().values()
        n_segments = int(value) if quantity is SEGMENTS else base_body().n_segments
        changes = {} if value == BASE[quantity.name] else quantity.changes(value)
        points += [Point(quantity.name, value, n_segments, one, changes) for one in actuators]
    return points


def check_points(set_to: Mapping[Key, Setting]) -> list[Point]:
    """Returns the points at which the resolution is varied: force-limited, at several weights."""
    usual = [one for one in sweep_points(WEIGHT, "full", set_to) if one.actuator.kind == "force-limited"]
    return [
        replace(one, changes={**one.changes, **resolution}, resolution=words)
        for one in usual
        if one.value in CHECKED_KG
        for words, resolution in CHECKS.items()
    ]


def weak_middle(store: Store, effort: Effort) -> tuple[dict[Key, Setting], list[Reading]]:
    """Runs the sweeps: quick (N = 3 and 4, two values each, no check of the resolution) or full.

    Returns:
        The settings by `worm_key`, the base worm's first, and the readings of all sweeps, then of the checks.
    """
    set_to = settings(store, {BASE_KEY: {}}, {BASE_KEY: GUESSES_M})
    # Softer rods sag; elsewhere the base worm's length is nearly right.
    near = (set_to[BASE_KEY].length_m,)
    worms, guesses = {}, {}
    for quantity in QUANTITIES:
        for value in values_of(quantity, effort):
            key = worm_key(quantity, value)
            if key != BASE_KEY:
                worms[key], guesses[key] = quantity.changes(value), GUESSES_M if quantity is STIFFNESS else near
    set_to |= settings(store, worms, guesses)
    points = [point for quantity in QUANTITIES for point in sweep_points(quantity, effort, set_to)]
    if effort == "full":
        points += check_points(set_to)
    return set_to, compute(store, points, "pulling")


def deficits(readings: Sequence[Reading], quantity: Quantity, kind: str) -> tuple[Array, Array]:
    """Returns values and deficits of one sweep with one kind of actuator, NaN where there is none, each ``(n,)``."""
    wanted = (quantity.name, kind, "")
    own = [one for one in readings if (one.point.quantity, one.point.actuator.kind, one.point.resolution) == wanted]
    return np.array([one.point.value for one in own]), np.array([one.deficit for one in own])


FORCE = Quantity("force", "force limit of its servo (N)", (12.0, 12.6, 13.2, 13.8, 14.4, 15.0), lambda _: {})
SPRINGS = Quantity(
    "springs",
    "rate of the springs (N/m)",
    (14.0, 17.0, 20.0, 24.5, 29.0, 32.0),
    lambda rate: {"body.springs.stiffness_N_per_m": rate},
)
CAUSES = (
    SPRINGS,
    WEIGHT._replace(values=(0.6, 0.77, 1.3, 1.87, 2.4, 3.0)),
    FRICTION._replace(values=(0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0)),
)
"""Quantities of the whole worm: what they do is a bound to what the same difference in one segment could do."""
END_FORCES_N = (12.8, 13.1, 13.4, 13.7, 13.8)


@dataclass(frozen=True, slots=True)
class Answer:
    """What one cause alone would have to be."""

    label: str  # The cause in words, with its unit
    weak: float  # Its value where an interior segment elongates as the robot's weaker one; NaN if none was found
    strong: float  # The same for the stronger one
    extremes_m: tuple[float, float]  # Smallest and largest elongation of the interior segment over the values tried, m

    @property
    def difference(self) -> float:
        """The larger value above the smaller one, a fraction; NaN if one is missing."""
        low, high = sorted((self.weak, self.strong))
        return high / low - 1.0


@dataclass(frozen=True, slots=True)
class Asymmetry:
    """What the robot's differences between segments would take."""

    # For every cause, the servo's force first, then the length that the ring has at that force
    answers: tuple[Answer, ...]
    # Force limits of the four servos at which the worm elongates as the robot; NaN where none was found
    limits_N: tuple[float, ...]
    confirmed: Reading | None  # The four segments of that one worm, each pulled alone; None without all limits
    readings: tuple[Reading, ...]  # All pulls


def value_at(values: ArrayLike, elongation_m: ArrayLike, wanted_m: float) -> float:
    """Returns the value at which an elongation that rises or falls steadily with it has a wanted size.

    By straight lines between the readings, of which some may be NaN; NaN where the wanted elongation lies outside them
    or they are not in order.
    """
    points = np.array([values, elongation_m], dtype=float)
    x, y = points[:, np.isfinite(points[1])]
    order = np.argsort(x)
    x, y = x[order], y[order]
    if len(y) > 1 and y[0] > y[-1]:
        x, y = x[::-1], y[::-1]
    if len(y) < 2 or (np.diff(y) <= 0).any() or not y[0] <= wanted_m <= y[-1]:
        return nan
    return float(np.interp(wanted_m, y, x))


def asymmetry(store: Store, force_N: float) -> Asymmetry:
    """Finds what makes an interior segment elongate as the robot's weaker and as its stronger one.

    Segment 2 of the base worm is pulled alone, force-limited, at several values of every cause; then the four segments
    of one worm with the four force limits that were found, each alone.

    The force limit of all causes but the force itself is ``force_N``.
    """
    n_segments, stage = base_body().n_segments, "two interior segments"
    points = [
        Point(FORCE.name, one, n_segments, force_limited(one), only=(segment,))
        for segment, values in ((2, FORCE.values), (1, END_FORCES_N))
        for one in values
    ]
    points += [
        Point(cause.name, one, n_segments, force_limited(force_N), cause.changes(one), only=(2,))
        for cause in CAUSES
        for one in cause.values
    ]
    found = compute(store, points, stage)
    interior, ends, *caused = grouped(found, lambda one: (one.point.quantity, one.point.only)).values()
    limits = tuple(
        round(value_at([one.point.value for one in of], _elongations(of), wanted), 2)
        for of, wanted in zip((ends, interior, interior, ends), ROBOT_ELONGATION_M, strict=True)
    )
    answers = (
        _answer(FORCE.label, FORCE.values, interior),
        _answer("length of its ring when wound (m)", [one.pulled[0].ring_length_m for one in interior], interior),
        *(_answer(cause.label, cause.values, of) for cause, of in zip(CAUSES, caused, strict=True)),
    )
    if not np.isfinite(limits).all():
        return Asymmetry(answers, limits, None, tuple(found))
    together = Point("robot", 0.0, n_segments, force_limited(*limits), only=tuple(range(1, n_segments + 1)))
    [confirmed] = compute(store, [together], stage)
    return Asymmetry(answers, limits, confirmed, (*found, confirmed))


def _answer(label: str, values: Sequence[float], readings: Sequence[Reading]) -> Answer:
    elongations = _elongations(readings)
    weak, strong = (value_at(values, elongations, one) for one in ROBOT_ELONGATION_M[1:-1])
    return Answer(label, weak, strong, (float(np.nanmin(elongations)), float(np.nanmax(elongations))))


def _elongations(readings: Sequence[Reading]) -> list[float]:
    return [nan if one.problem else one.pulled[0].elongation_m for one in readings]

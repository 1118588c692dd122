"""The sweeps: one quantity of the worm or its ground at a time, every kind of actuator at every value."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import nan
from typing import Any, NamedTuple

import numpy as np

from annelid.analysis import interior_deficit
from annelid.body import mesh_of
from annelid.errors import ConfigError
from annelid.experiment import Case, Store, StudyProgress, case_key, in_stage
from annelid.morphology import Array
from annelid_studies.weak_middle.pulls import (
    GUESSES_M,
    Actuator,
    Key,
    Pulled,
    Setting,
    base_body,
    pull,
    read_pull,
    settings,
)
from annelid_studies.worms import Effort


class Quantity(NamedTuple):
    """What one sweep varies.

    Attributes:
        name: In one word, for the CSV.
        label: For the axis of a panel and the head of a table, with its unit.
        values: Values of the full study, in that unit.
        changes: Fields of the base worm for a value.
        quick: Values of the quick study.
        title: In a few words, for a panel.
    """

    name: str
    label: str
    values: tuple[float, ...]
    changes: Callable[[float], dict[str, Any]]
    quick: tuple[float, ...] = ()
    title: str = ""


def segment_changes(n_segments: float) -> dict[str, Any]:
    """Fields for a number of segments."""
    return {"body.mesh.n_segments": int(n_segments)}


def stiffness_changes(young_GPa: float) -> dict[str, Any]:
    """Fields for a Young's modulus, GPa.

    Shear modulus and damping keep their ratios to it, so that soft rods come to rest as soon as stiff ones.
    """
    strands = base_body().strands
    share = young_GPa * 1e9 / strands.young_modulus_Pa
    return {
        "body.strands.young_modulus_Pa": young_GPa * 1e9,
        "body.strands.shear_modulus_Pa": round(share * strands.shear_modulus_Pa),
        "body.strands.joint_damping_Nms_per_rad": round(share * strands.joint_damping_Nms_per_rad, 6),
    }


def weight_changes(mass_kg: float) -> dict[str, Any]:
    """Fields for a mass of the worm, kg, that its pins carry; 0 is a worm of the base worm's mass without weight.

    Raises:
        ConfigError: The strands alone weigh more.
    """
    if mass_kg == 0:
        return {"arena.gravity_m_per_s2": 0.0}
    body = base_body()
    mesh = mesh_of(body.mesh)
    strands_kg = mesh.n_strands * mesh.strand_length_m * body.strands.linear_density_kg_per_m
    if mass_kg <= strands_kg:
        raise ConfigError(f"mass_kg = {mass_kg:g} must be above {strands_kg:.3f}, which the strands weigh alone")
    return {"body.pins.mass_kg": round((mass_kg - strands_kg) / mesh.n_crossings, 9)}


def friction_changes(friction: float) -> dict[str, Any]:
    """Fields for a coefficient of friction."""
    return {"arena.friction": friction}


SEGMENTS = Quantity("segments", "number of segments", (3, 4, 5, 6, 7, 8), segment_changes, (3, 4), "Length of the worm")
STIFFNESS = Quantity(
    "stiffness",
    "Young's modulus (GPa)",
    (0.3, 0.5, 0.8, 1.2, 2.0),
    stiffness_changes,
    (0.5, 2.0),
    "Stiffness of the rods",
)
WEIGHT = Quantity(
    "weight", "mass of the worm (kg)", (0.0, 0.77, 1.3, 1.87, 2.4, 3.0), weight_changes, (0.0, 1.87), "Weight"
)
FRICTION = Quantity(
    "friction", "friction of the ground", (0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5), friction_changes, (0.1, 0.7), "Friction"
)
QUANTITIES = (SEGMENTS, STIFFNESS, WEIGHT, FRICTION)
"""The sweeps. Every one passes through the base worm."""
BASE = {"segments": 4.0, "stiffness": 2.0, "weight": 1.87, "friction": 0.7}
"""The base worm's values, to the digits in which the sweeps state theirs."""
BASE_KEY: Key = ("base", 0.0)

CHECKS: Mapping[str, dict[str, Any]] = {
    "half the step": {"clock.control_timestep_s": 0.01, "clock.physics_timestep_s": 0.01},
    "four elements a side, half the step": {
        "body.mesh.elements_per_side": 4,
        "clock.control_timestep_s": 0.01,
        "clock.physics_timestep_s": 0.01,
    },
}
"""Resolutions at which some readings are taken again."""
CHECKED_KG = (0.77, 1.87, 3.0)
"""Masses of the worms whose readings they are, force-limited."""


@dataclass(frozen=True)
class Point:
    """One worm with one kind of actuator.

    Attributes:
        quantity: Name of the quantity that is varied.
        value: Its value.
        n_segments: Number of segments.
        actuator: What pulls.
        changes: Fields in which worm, ground and resolution differ from the base.
        resolution: The resolution in words; empty for the study's own.
        only: Segments that are pulled; empty for the front half, of which the rear half is the mirror image.
    """

    quantity: str
    value: float
    n_segments: int
    actuator: Actuator
    changes: Mapping[str, Any] = field(default_factory=dict)
    resolution: str = ""
    only: tuple[int, ...] = ()

    @property
    def segments(self) -> tuple[int, ...]:
        """The segments that are pulled, each alone."""
        return self.only or tuple(range(1, (self.n_segments + 1) // 2 + 1))

    @property
    def cases(self) -> list[Case]:
        """The runs, one a pulled segment."""
        return [pull(segment, self.actuator, self.changes) for segment in self.segments]


@dataclass(frozen=True)
class Reading:
    """What was found at a point.

    Attributes:
        point: The point.
        pulled: One reading a pulled segment.
    """

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


def compute(
    store: Store, points: Sequence[Point], stage: str, jobs: int | None, progress: StudyProgress | None
) -> list[Reading]:
    """Computes points, as far as the store does not hold their runs.

    Raises:
        AnnelidError: A run cannot be built or written.
        KeyboardInterrupt: Finished runs are kept.
    """
    cases = [case for point in points for case in point.cases]
    found = store.compute(cases, jobs=jobs, progress=in_stage(progress, stage))
    return [
        Reading(
            point,
            tuple(
                read_pull(segment, found[case_key(case)])
                for segment, case in zip(point.segments, point.cases, strict=True)
            ),
        )
        for point in points
    ]


def values_of(quantity: Quantity, effort: Effort) -> tuple[float, ...]:
    """Returns the values of a quantity that are swept at an effort."""
    return quantity.values if effort == "full" else quantity.quick


def worm_key(quantity: Quantity, value: float) -> Key:
    """Names the worm that the actuators of a point are set for; longer worms have those of the base worm."""
    longer = quantity is SEGMENTS and value > BASE[SEGMENTS.name]
    return BASE_KEY if longer or value == BASE[quantity.name] else (quantity.name, value)


def sweep_points(quantity: Quantity, effort: Effort, set_to: Mapping[Key, Setting]) -> list[Point]:
    """Returns the points of a sweep.

    Force, cable length and activation are set anew for every worm, so that an end always elongates alike, but for
    longer worms, which have those of the base worm. The servo is the base worm's everywhere.

    Args:
        quantity: What is varied.
        effort: Quick or full.
        set_to: Settings by `worm_key`.
    """
    points = []
    for value in values_of(quantity, effort):
        actuators = set_to[worm_key(quantity, value)].actuators().values()
        n_segments = int(value) if quantity is SEGMENTS else base_body().n_segments
        changes = {} if value == BASE[quantity.name] else quantity.changes(value)
        points += [Point(quantity.name, value, n_segments, one, changes) for one in actuators]
    return points


def all_settings(store: Store, effort: Effort, jobs: int | None, progress: StudyProgress | None) -> dict[Key, Setting]:
    """Sets the actuators for the worms of all sweeps, by `worm_key`; the base worm comes first."""
    found = settings(store, {BASE_KEY: {}}, {BASE_KEY: GUESSES_M}, jobs, progress)
    # Softer rods sag; elsewhere the base worm's length is nearly right.
    near = (found[BASE_KEY].length_m,)
    worms, guesses = {}, {}
    for quantity in QUANTITIES:
        for value in values_of(quantity, effort):
            key = worm_key(quantity, value)
            if key != BASE_KEY:
                worms[key], guesses[key] = quantity.changes(value), GUESSES_M if quantity is STIFFNESS else near
    return found | settings(store, worms, guesses, jobs, progress)


def check_points(set_to: Mapping[Key, Setting]) -> list[Point]:
    """Returns the points at which the resolution is varied: force-limited, at several weights."""
    return [
        Point(WEIGHT.name, mass, base_body().n_segments, actuator, {**worm, **resolution}, words)
        for mass in CHECKED_KG
        for worm in ({} if mass == BASE[WEIGHT.name] else weight_changes(mass),)
        for actuator in (set_to[worm_key(WEIGHT, mass)].actuators()["force-limited"],)
        for words, resolution in CHECKS.items()
    ]


def weak_middle(
    store: Store, effort: Effort, *, jobs: int | None = None, progress: StudyProgress | None = None
) -> tuple[dict[Key, Setting], list[Reading]]:
    """Runs the study.

    Args:
        store: Where runs are kept.
        effort: Quick (N = 3 and 4, two values a sweep, no check of the resolution) or full.
        jobs: Processes; default: one a core.
        progress: Called as runs finish.

    Returns:
        The settings by `worm_key`, and the readings of all sweeps, then of the checks.

    Raises:
        AnnelidError: A run cannot be built or written.
        KeyboardInterrupt: Finished runs are kept.
    """
    set_to = all_settings(store, effort, jobs, progress)
    points = [point for quantity in QUANTITIES for point in sweep_points(quantity, effort, set_to)]
    if effort == "full":
        points += check_points(set_to)
    return set_to, compute(store, points, "pulling", jobs, progress)


def deficits(readings: Sequence[Reading], quantity: Quantity, kind: str) -> tuple[Array, Array]:
    """Returns values and deficits of one sweep with one kind of actuator, NaN where there is none, each ``(n,)``."""
    own = [
        one
        for one in readings
        if (one.point.quantity, one.point.actuator.kind, one.point.resolution) == (quantity.name, kind, "")
    ]
    return np.array([one.point.value for one in own]), np.array([one.deficit for one in own])

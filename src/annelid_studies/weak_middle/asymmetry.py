"""What it would take that two interior segments differ as the robot's do, which its model's do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from annelid.analysis import ROBOT_ELONGATION_M
from annelid.experiment import Store, StudyProgress
from annelid_studies.weak_middle.pulls import base_body, force_limited
from annelid_studies.weak_middle.sweeps import (
    FRICTION,
    WEIGHT,
    Point,
    Quantity,
    Reading,
    compute,
)

STAGE = "two interior segments"
_ENDS = "ends"


def spring_changes(stiffness_N_per_m: float) -> dict[str, Any]:
    """Fields for the rate of all axial springs, N/m."""
    return {"body.springs.stiffness_N_per_m": stiffness_N_per_m}


FORCE = Quantity("force", "force limit of its servo (N)", (12.0, 12.6, 13.2, 13.8, 14.4, 15.0), lambda _: {})
CAUSES = (
    Quantity("springs", "rate of the springs (N/m)", (14.0, 17.0, 20.0, 24.5, 29.0, 32.0), spring_changes),
    WEIGHT._replace(values=(0.6, *WEIGHT.values[1:])),
    FRICTION._replace(values=(*FRICTION.values, 2.0)),
)
"""Quantities of the whole worm: what they do is a bound to what the same difference in one segment could do."""
END_FORCES_N = (12.8, 13.1, 13.4)


@dataclass(frozen=True, slots=True)
class Answer:
    """What one cause alone would have to be.

    Attributes:
        label: The cause in words, with its unit.
        weak: Its value where an interior segment elongates as the robot's weaker one; NaN if none was found.
        strong: The same for the stronger one.
        tried: Smallest and largest elongation of the interior segment over the values tried, m.
    """

    label: str
    weak: float
    strong: float
    tried: tuple[float, float]

    @property
    def difference(self) -> float:
        """The larger value above the smaller one, a fraction; NaN if one is missing."""
        low, high = sorted((self.weak, self.strong))
        return high / low - 1.0


@dataclass(frozen=True, slots=True)
class Asymmetry:
    """What the robot's differences between segments would take.

    Attributes:
        answers: For every cause, the servo's force first, then the length that the ring has at that force.
        limits_N: Force limits of the four servos at which the worm elongates as the robot; NaN where none was found.
        confirmed: The four segments of that one worm, each pulled alone; None without all limits.
        readings: All pulls.
    """

    answers: tuple[Answer, ...]
    limits_N: tuple[float, ...]
    confirmed: Reading | None
    readings: tuple[Reading, ...]


def value_at(values: ArrayLike, elongation_m: ArrayLike, wanted_m: float) -> float:
    """Returns the value at which an elongation that rises or falls steadily with it has a wanted size.

    Args:
        values: Shape ``(n,)``.
        elongation_m: Shape ``(n,)``, m; NaN where there is no reading.
        wanted_m: Within the readings, m.

    Returns:
        By straight lines between the readings; NaN where the wanted elongation lies outside them or they are not
        in order.
    """
    x, y = np.asarray(values, dtype=float), np.asarray(elongation_m, dtype=float)
    x, y = x[np.isfinite(y)], y[np.isfinite(y)]
    order = np.argsort(x)
    x, y = x[order], y[order]
    if len(y) > 1 and y[0] > y[-1]:
        x, y = x[::-1], y[::-1]
    if len(y) < 2 or (np.diff(y) <= 0).any() or not y[0] <= wanted_m <= y[-1]:
        return float("nan")
    return float(np.interp(wanted_m, y, x))


def asymmetry(
    store: Store, force_N: float, *, jobs: int | None = None, progress: StudyProgress | None = None
) -> Asymmetry:
    """Finds what makes an interior segment elongate as the robot's weaker and as its stronger one.

    Segment 2 of the base worm is pulled alone, force-limited, at several values of every cause; then the four segments
    of one worm with the four force limits that were found, each alone.

    Args:
        store: Where runs are kept.
        force_N: Force limit of all causes but the force itself, N.
        jobs: Processes; default: one a core.
        progress: Called as runs finish.

    Raises:
        AnnelidError: A run cannot be built or written.
        KeyboardInterrupt: Finished runs are kept.
    """
    n_segments = base_body().n_segments
    usual = force_limited(force_N)

    def forced(values: Sequence[float], segment: int) -> list[Point]:
        return [Point(FORCE.name, one, n_segments, force_limited(one), only=(segment,)) for one in values]

    groups = {FORCE.name: forced(FORCE.values, 2), _ENDS: forced(END_FORCES_N, 1)}
    for cause in CAUSES:
        groups[cause.name] = [
            Point(cause.name, one, n_segments, usual, cause.changes(one), only=(2,)) for one in cause.values
        ]
    found = compute(store, [point for some in groups.values() for point in some], STAGE, jobs, progress)
    left = iter(found)
    read = {name: list(islice(left, len(some))) for name, some in groups.items()}
    ends, interior = _elongations(read[_ENDS]), _elongations(read[FORCE.name])
    of_end, of_interior = partial(value_at, END_FORCES_N, ends), partial(value_at, FORCE.values, interior)
    first, *middle, last = ROBOT_ELONGATION_M
    limits = tuple(round(one, 2) for one in (of_end(first), *map(of_interior, middle), of_end(last)))
    rings = [one.pulled[0].ring_length_m for one in read[FORCE.name]]
    answers = (
        _answer(FORCE.label, FORCE.values, read[FORCE.name]),
        _answer("length of its ring when wound (m)", rings, read[FORCE.name]),
        *(_answer(cause.label, cause.values, read[cause.name]) for cause in CAUSES),
    )
    if not np.isfinite(limits).all():
        return Asymmetry(answers, limits, None, tuple(found))
    together = Point("robot", 0.0, n_segments, force_limited(limits), only=tuple(range(1, n_segments + 1)))
    confirmed = compute(store, [together], STAGE, jobs, progress)[0]
    return Asymmetry(answers, limits, confirmed, (*found, confirmed))


def _answer(label: str, values: Sequence[float], readings: Sequence[Reading]) -> Answer:
    elongations = _elongations(readings)
    weak, strong = (value_at(values, elongations, one) for one in ROBOT_ELONGATION_M[1:-1])
    return Answer(label, weak, strong, (float(np.nanmin(elongations)), float(np.nanmax(elongations))))


def _elongations(readings: Sequence[Reading]) -> list[float]:
    return [float("nan") if one.problem else one.pulled[0].elongation_m for one in readings]

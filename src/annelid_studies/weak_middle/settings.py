"""How strongly the kinds of actuators pull, so that they can be compared: each moves an end as far as the robot's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import isfinite
from typing import Any

from annelid.analysis.robot import ROBOT_ELONGATION_M
from annelid.errors import ConfigError
from annelid.experiment.progress import StudyProgress, in_stage
from annelid.experiment.store import Store, case_key
from annelid_studies.weak_middle.pulls import (
    ACTUATORS,
    Actuator,
    Pulled,
    force_limited,
    length_limited,
    muscle,
    muscle_activation,
    pull,
    read_pull,
    servo,
)

END_M = (ROBOT_ELONGATION_M[0] + ROBOT_ELONGATION_M[-1]) / 2
"""An end of the base worm elongates as the robot's two ends do on average, m."""
GUESSES_M = (0.70, 0.67)
"""Cable lengths that a search begins with where nothing is known, m."""
LARGEST_ERROR_M = 0.0003
FORCE_ERROR_M = 0.0015
"""Largest distance of an end from `END_M` with which a search for a length and for a force is done, m."""
ROUNDS = 5
STEP_BACK = 0.015
SLOPE_M = 0.2
"""A force is raised by its share of this that the end is to elongate further, before there are two readings, m."""
Key = tuple[str, float]
"""Names a worm: the quantity in which it differs from the base worm, and its value."""


@dataclass(frozen=True, slots=True)
class Setting:
    """How strongly the kinds of actuators pull where an end is to elongate by `END_M`.

    Attributes:
        length_m: Cable of the length-limited actuator, m.
        ring_length_m: Length of the ring that this gives, m.
        force_N: Limit of the force-limited actuator, N.
        activation: Activation of the muscle that has the tension of the wound cable at the same length.
    """

    length_m: float
    ring_length_m: float
    force_N: float
    activation: float

    def actuators(self) -> dict[str, Actuator]:
        """Returns one actuator of each kind; the servo is the base worm's, whatever the setting."""
        made = (force_limited(self.force_N), servo(), muscle(self.activation), length_limited(self.length_m))
        return dict(zip(ACTUATORS, made, strict=True))


def settings(
    store: Store,
    worms: Mapping[Key, Mapping[str, Any]],
    guesses_m: Mapping[Key, Sequence[float]],
    jobs: int | None,
    progress: StudyProgress | None,
) -> dict[Key, Setting]:
    """Sets the actuators for several worms.

    A wound length is found at which an end elongates by `END_M`, by secants, which cannot collapse a ring. The tension
    of that cable sets the muscle, and the force limit is sought from there.

    Args:
        store: Where runs are kept.
        worms: Fields in which each worm differs from the base worm, by any key.
        guesses_m: Cable lengths that the search for each worm begins with, m.
        jobs: Processes; None for one a core.
        progress: Called as runs finish.

    Returns:
        A setting for every worm.

    Raises:
        ConfigError: An end does not come near `END_M`.
        AnnelidError: A run cannot be built or written.
        KeyboardInterrupt: Finished runs are kept.
    """
    search = partial(_search, store, worms, jobs, in_stage(progress, "setting the actuators"))
    lengths = search(length_limited, guesses_m, _next_lengths)
    for key, readings in lengths.items():
        if _next_lengths(readings):
            changes = ", ".join(f"{field} = {value:g}" for field, value in worms[key].items())
            raise ConfigError(
                f"with {changes or 'the base worm'} no cable length was found at which an end elongates by "
                f"{100 * END_M:.2f} cm"
            )
    found = {key: _setting(*nearest(readings)) for key, readings in lengths.items()}
    # An end near `END_M` is close to where a constant force collapses it, and friction holds it differently on the two
    # ways there, so that the tension of the wound cable may be a percent too high. Where the search does not end, the
    # force counts that comes nearest.
    forces = search(force_limited, {key: [one.force_N] for key, one in found.items()}, _next_forces)
    return {key: replace(one, force_N=nearest(forces[key])[0]) for key, one in found.items()}


Readings = dict[float, Pulled]
"""What was read of an end by the length (m) or the force (N) that was set."""


def _search(
    store: Store,
    worms: Mapping[Key, Mapping[str, Any]],
    jobs: int | None,
    report: Callable[[int, int, float], object] | None,
    actuator: Callable[[float], Actuator],
    first: Mapping[Key, Sequence[float]],
    following: Callable[[Readings], Sequence[float]],
) -> dict[Key, Readings]:
    """Pulls an end of every worm, from first values on, until nothing follows from what was read, or `ROUNDS` times."""
    tried: dict[Key, Readings] = {key: {} for key in worms}
    wanted = dict(first)
    for _ in range(ROUNDS):
        cases = {
            (key, value): pull(1, actuator(value), worms[key]) for key, values in wanted.items() for value in values
        }
        outcomes = store.compute(cases.values(), jobs=jobs, progress=report)
        for (key, value), case in cases.items():
            tried[key][value] = read_pull(1, outcomes[case_key(case)])
        wanted = {key: values for key, readings in tried.items() if (values := following(readings))}
        if not wanted:
            break
    return tried


def _next_lengths(readings: Readings) -> Sequence[float]:
    if _error(*nearest(readings)) <= LARGEST_ERROR_M:
        return ()
    return [next_length(readings)] if len(readings) > 1 else GUESSES_M


def _next_forces(readings: Readings) -> Sequence[float]:
    if _error(*nearest(readings)) <= FORCE_ERROR_M or next_force(readings) in readings:
        return ()
    return [next_force(readings)]


def next_force(readings: Mapping[float, Pulled]) -> float:
    """Returns the force, N, to try after these readings: on the secant, or below the least one without a reading."""
    good = {force: one for force, one in readings.items() if not one.problem}
    too_high = min((force for force, one in readings.items() if one.problem), default=float("inf"))
    if not good:
        return round((1.0 - STEP_BACK) * too_high, 2)
    force, reading = nearest(good)
    others = sorted((one for one in good if one != force), key=lambda one: _error(one, good[one]))
    slope = force / SLOPE_M
    if others and good[others[0]].elongation_m != reading.elongation_m:
        slope = (others[0] - force) / (good[others[0]].elongation_m - reading.elongation_m)
    step = (END_M - reading.elongation_m) * (slope if slope > 0 else force / SLOPE_M)
    if force + step >= too_high:
        return round((force + too_high) / 2.0, 2)
    return round(force + step, 2)


def nearest(readings: Mapping[float, Pulled]) -> tuple[float, Pulled]:
    """Returns the length, m, and the reading that come nearest to `END_M`."""
    return min(readings.items(), key=lambda item: _error(*item))


def next_length(readings: Mapping[float, Pulled]) -> float:
    """Returns the length, m, at which the secant through the two readings nearest to `END_M` reaches it."""
    (x1, one), (x2, two) = sorted(readings.items(), key=lambda item: _error(*item))[:2]
    slope = (two.elongation_m - one.elongation_m) / (x2 - x1)
    return round(x1 + (END_M - one.elongation_m) / slope, 4)


def _error(_: float, reading: Pulled) -> float:
    error = abs(reading.elongation_m - END_M)
    return error if isfinite(error) and not reading.problem else float("inf")


def _setting(length_m: float, reading: Pulled) -> Setting:
    force = round(reading.force_N, 2)
    return Setting(length_m, reading.ring_length_m, force, muscle_activation(force, reading.ring_length_m))

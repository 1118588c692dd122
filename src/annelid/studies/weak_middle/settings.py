"""How strongly the kinds of actuators pull, so that they can be compared: each moves an end as far as the robot's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite
from typing import Any

from annelid.analysis.robot import ROBOT_ELONGATION_M
from annelid.errors import ConfigError
from annelid.studies.progress import StudyProgress
from annelid.studies.store import Store, case_key
from annelid.studies.weak_middle.pulls import (
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
ROUNDS = 5
STAGE = "setting the actuators"

Key = tuple[str, float]
"""Names a worm: the quantity in which it differs from the base worm, and its value."""


@dataclass(frozen=True, slots=True)
class Setting:
    """How strongly the kinds of actuators pull where an end is to elongate by `END_M`.

    Attributes:
        length_m: Cable of the length-limited actuator, m.
        ring_length_m: Length of the ring that this gives, m.
        force_N: Tension that it takes: the limit of the force-limited actuator, N.
        activation: Activation of the muscle that has the same force at the same length.
    """

    length_m: float
    ring_length_m: float
    force_N: float
    activation: float

    def actuators(self) -> dict[str, Actuator]:
        """Returns one actuator of each kind; the servo is the preset's, whatever the setting."""
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

    A wound length is found at which an end elongates by `END_M`, by secants, which cannot collapse a ring; the tension
    of that cable is the force of the others.

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
    tried: dict[Key, dict[float, Pulled]] = {key: {} for key in worms}
    wanted = {key: list(guesses_m[key]) for key in worms}
    report = None if progress is None else partial(progress, STAGE)
    for _ in range(ROUNDS):
        cases = {
            (key, length): pull(1, length_limited(length), worms[key])
            for key, lengths in wanted.items()
            for length in lengths
        }
        found = store.compute(cases.values(), jobs=jobs, progress=report)
        for (key, length), case in cases.items():
            tried[key][length] = read_pull(1, found[case_key(case)])
        wanted = {
            key: [next_length(readings)] if len(readings) > 1 else list(GUESSES_M)
            for key, readings in tried.items()
            if _error(*nearest(readings)) > LARGEST_ERROR_M
        }
        if not wanted:
            return {key: _setting(*nearest(readings)) for key, readings in tried.items()}
    changes = ", ".join(f"{field} = {value:g}" for field, value in worms[next(iter(wanted))].items())
    raise ConfigError(
        f"with {changes or 'the preset'} no cable length was found at which an end elongates by {100 * END_M:.2f} cm"
    )


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

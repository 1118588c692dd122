"""How strongly the kinds of actuators pull, so that they can be compared: each moves an end as far as the robot's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import isfinite

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
from annelid.studies.weak_middle.worms import stiffness_changes

END_M = (ROBOT_ELONGATION_M[0] + ROBOT_ELONGATION_M[-1]) / 2
"""An end of the base worm elongates as the robot's two ends do on average, m."""
GUESSES_M = (0.70, 0.67)
"""Cable lengths that the search begins with."""
LARGEST_ERROR_M = 0.0003
ROUNDS = 5


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
    store: Store, stiffnesses_GPa: Sequence[float], jobs: int | None, progress: StudyProgress | None
) -> dict[float, Setting]:
    """Sets the actuators for worms of several stiffnesses.

    A wound length is found at which an end elongates by `END_M`, by secants, which cannot collapse a ring; the tension
    of that cable is the force of the others.

    Returns:
        A setting for every stiffness, GPa.

    Raises:
        ConfigError: An end does not come near `END_M`.
        AnnelidError: A run cannot be built or written.
    """
    tried: dict[float, dict[float, Pulled]] = {value: {} for value in stiffnesses_GPa}
    wanted = {value: list(GUESSES_M) for value in stiffnesses_GPa}
    for _ in range(ROUNDS):
        cases = {
            (value, length): pull(1, length_limited(length), stiffness_changes(value))
            for value, lengths in wanted.items()
            for length in lengths
        }
        report = None if progress is None else partial(progress, "setting the actuators")
        found = store.compute(cases.values(), jobs=jobs, progress=report)
        for (value, length), case in cases.items():
            tried[value][length] = read_pull(1, found[case_key(case)])
        wanted = {
            value: [next_length(readings)]
            for value, readings in tried.items()
            if _error(*nearest(readings)) > LARGEST_ERROR_M
        }
        if not wanted:
            return {value: _setting(*nearest(readings)) for value, readings in tried.items()}
    value = next(iter(wanted))
    raise ConfigError(
        f"body.strands.young_modulus_Pa = {value * 1e9:g}: no cable length was found at which an end elongates by "
        f"{100 * END_M:.2f} cm"
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

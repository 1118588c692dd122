"""Single segments of a resting worm pulled by several kinds of actuators, set so that each moves an end as far."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf, isfinite, nan
from typing import Any, NamedTuple

from annelid.analysis import ROBOT_ELONGATION_M
from annelid.body import Rings, WormBody, muscle_force, worm_of
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment import Case, Hold, Outcome, Store
from annelid_studies.riddle2023.figures.muscle_surface import scaled_length
from annelid_studies.standard_cases import RODS

PRESET = "riddle2025"
BASE_WORM: dict[str, Any] = {
    "body.mesh.n_segments": 4,
    "body.mesh.elements_per_side": 3,
    "body.mesh.planes_between_rings": 4,
    "body.mesh.free_planes_at_ends": 3,
    "body.mesh.rear_overhang_m": 0.0177013,
    "body.pins.mass_kg": 0.0135,
    "body.rings.force_limit_N": 13.2,
}
"""The preset with these is the base worm, which all others change in one quantity: the four-segment robot with rods and
springs of the authors' models, none of them tuned to its elongations, and servos of which one alone moves an end as the
robot's."""
RESOLUTION: dict[str, Any] = {
    "clock.control_timestep_s": 0.01,
    "clock.physics_timestep_s": 0.01,
    "record.signals_interval_s": 0.02,
    "record.frames_interval_s": 4.0,
}
STANDSTILL: dict[str, Any] = {"body.formulation.friction_impedance_ratio": 1e5}
"""With the preset's value, which is good for walking, a held worm creeps over the ground."""
DURATION_S = 6.0
READ_S = (DURATION_S - 0.5, DURATION_S)
"""Every pull is read twice, s: the second reading counts, and the first tells whether the worm still moves."""
RAMP_S = 1.0
"""Rise of a muscle's activation, s; a servo winds at its own limited speed."""
STILL_M = 0.0005
"""A segment that still lengthens by more than this between the two readings does not stand, m."""
CRUSHED = 0.5
"""A ring shorter than this share of its length at rest has collapsed."""
OUT_OF_REACH_N = 200.0
STIFF_N_PER_M = 1e4
"""Cables of length-limited actuators: they stretch by a millimetre or two, the preset's by a centimetre or two."""
SOFT_N_PER_M = 200.0
"""Cables of force-limited actuators: where a servo stalls does not depend on it, and winding after the ring in steps of
time damps it by stiffness times step."""
SHORTEST = 0.3
"""The cable of force-limited actuators when wound, as a share of the ring at rest: out of reach unless it collapses."""

ACTUATORS = ("force-limited", "servo", "muscle", "length-limited")
"""Kinds of actuators; all segments of a worm have the same."""


class Actuator(NamedTuple):
    """One of `ACTUATORS`, how strongly it pulls in words, and what of the base worm and its activation makes it so."""

    kind: str
    setting: str
    changes: Mapping[str, Any]
    activation: float = 1.0


@cache
def base_body() -> WormBody:
    """Returns the body of the base worm: four segments of the preset."""
    return worm_of(load_config(PRESET, BASE_WORM))


@cache
def papers_muscle() -> Rings:
    """Returns the paper's muscle in the base worm's layout."""
    return worm_of(load_config(RODS)).muscles.model_copy(update={"layout": base_body().rings.layout})


@cache
def rest_ring_m() -> float:
    """Length of a ring of the base worm at rest, m."""
    return round(float(base_body().geometry().ring_length_m[0]), 6)


# The cable's own damping delays the standstill and changes nothing of it.
_QUICK_CABLE = {"body.rings.damping_Ns_per_m": 1.0}


def _winding(force_N: float | list[float], stiffness_N_per_m: float, shortest_m: float) -> dict[str, Any]:
    return {
        **_QUICK_CABLE,
        "body.rings.force_limit_N": force_N,
        "body.rings.stiffness_N_per_m": stiffness_N_per_m,
        "body.rings.length_range_m": [shortest_m, rest_ring_m()],
    }


def force_limited(*force_N: float) -> Actuator:
    """A servo that winds until it stalls at a tension all round the ring, N, one for all segments or one a segment.

    Its shortest cable is out of reach.
    """
    first, *others = force_N
    forces = [first, *others] if others else first
    changes = _winding(forces, SOFT_N_PER_M, round(SHORTEST * rest_ring_m(), 6))
    return Actuator("force-limited", f"{' / '.join(f'{one:.2f}' for one in force_N)} N", changes)


def length_limited(length_m: float) -> Actuator:
    """A servo that winds a ring's whole cable to a slack length, m, whatever force that takes."""
    return Actuator("length-limited", f"{length_m:.4f} m", _winding(OUT_OF_REACH_N, STIFF_N_PER_M, length_m))


def servo() -> Actuator:
    """The base worm's servo: its force limit, its speed limit and its range of lengths."""
    servos = base_body().rings
    shortest = servos.length_ranges(1)[0][0]
    return Actuator("servo", f"{servos.forces(1)[0]:.2f} N, {shortest:g} m", _QUICK_CABLE)


def muscle(activation: float) -> Actuator:
    """The paper's muscle, whose force depends on its length, at an activation."""
    changes = {"body.rings": papers_muscle().model_dump()}
    return Actuator("muscle", f"activation {activation:.4f}", changes, round(activation, 6))


def muscle_activation(force_N: float, ring_length_m: float) -> float:
    """Activation at which the paper's muscle, standing still, pulls with a force at a length of its ring."""
    rings = papers_muscle()
    length = scaled_length(ring_length_m, rings.length_ranges(1)[0])
    return float(force_N / (rings.forces(1)[0] * muscle_force(length, 0.0, rings)))


def pull(segment: int, actuator: Actuator, changes: Mapping[str, Any] | None = None) -> Case:
    """Returns the run in which one segment, from 1, is pulled and all others rest.

    Worm, ground and resolution are the base worm's and this study's but for the changes.
    """
    contraction = {"segment": segment, "start_s": 0.0, "activation": actuator.activation}
    program = {
        "kind": "program",
        "ramp_s": RAMP_S if actuator.kind == "muscle" else 0.0,
        "contractions": [{**contraction, "stop_s": stop} for stop in READ_S],
    }
    own = {"duration_s": DURATION_S, "controller": program}
    return Case(PRESET, {**BASE_WORM, **RESOLUTION, **STANDSTILL, **actuator.changes, **(changes or {}), **own})


@dataclass(frozen=True, slots=True)
class Pulled:
    """What is read of one pulled segment."""

    segment: int  # The segment, from 1
    elongation_m: float  # Mean of its left and right sensor above their rest length, m; NaN where there is no reading
    ring_length_m: float  # Length of its ring, m
    force_N: float  # Tension all round its ring, N
    drift_m: float  # How much it lengthened in the last half second, m
    problem: str  # Why the reading does not count; empty if it does


def read_pull(segment: int, outcome: Outcome) -> Pulled:
    """Reads the outcome of a `pull`: a run that a guard ended, a moving segment and a collapsed ring do not count.

    Raises:
        ConfigError: The outcome is of another program.
    """
    if len(outcome.holds) < len(READ_S):
        if not outcome.message:
            raise ConfigError(f"the outcome in {outcome.path} is not that of one pulled segment")
        return Pulled(segment, nan, nan, nan, nan, outcome.message)
    before, last = outcome.holds
    drift = _elongation(last) - _elongation(before)
    force = nan if last.force_N is None else last.force_N
    problem = ""
    if last.ring_length_m < CRUSHED * rest_ring_m():
        problem = f"collapsed to {last.ring_length_m:.2f} m"
    elif abs(drift) > STILL_M:
        problem = f"still moves, {1e3 * drift:.1f} mm in half a second"
    return Pulled(segment, _elongation(last), last.ring_length_m, force, drift, problem)


def _elongation(hold: Hold) -> float:
    return hold.elongation_mean_m[hold.segment - 1]


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
    """How strongly the kinds of actuators pull where an end is to elongate by `END_M`."""

    length_m: float  # Cable of the length-limited actuator, m
    ring_length_m: float  # Length of the ring that this gives, m
    force_N: float  # Limit of the force-limited actuator, N
    activation: float  # Activation of the muscle that has the tension of the wound cable at the same length

    def actuators(self) -> dict[str, Actuator]:
        """Returns one actuator of each kind; the servo is the base worm's, whatever the setting."""
        made = (force_limited(self.force_N), servo(), muscle(self.activation), length_limited(self.length_m))
        return dict(zip(ACTUATORS, made, strict=True))


Readings = Mapping[float, Pulled]
"""What was read of an end by the length (m) or the force (N) that was set."""


def settings(
    store: Store, worms: Mapping[Key, Mapping[str, Any]], guesses_m: Mapping[Key, Sequence[float]]
) -> dict[Key, Setting]:
    """Sets the actuators for several worms.

    A wound length is found at which an end elongates by `END_M`, by secants, which cannot collapse a ring. The tension
    of that cable sets the muscle, and the force limit is sought from there.

    Args:
        store: Where runs are kept.
        worms: Fields in which each worm differs from the base worm, by any key.
        guesses_m: Cable lengths that the search for each worm begins with, m.

    Raises:
        ConfigError: An end does not come near `END_M`.
    """
    found = {}
    for key, readings in _search(store, worms, length_limited, guesses_m, _next_lengths).items():
        if _error(*nearest(readings)) > LARGEST_ERROR_M:
            changes = ", ".join(f"{field} = {value:g}" for field, value in worms[key].items())
            raise ConfigError(
                f"with {changes or 'the base worm'} no cable length was found at which an end elongates by "
                f"{100 * END_M:.2f} cm"
            )
        length_m, reading = nearest(readings)
        force = round(reading.force_N, 2)
        activation = muscle_activation(force, reading.ring_length_m)
        found[key] = Setting(length_m, reading.ring_length_m, force, activation)
    # An end near `END_M` is close to where a constant force collapses it, and friction holds it differently on the two
    # paths there, so that the tension of the wound cable may be a percent too high. Where the search does not end, the
    # force counts that comes nearest.
    forces = _search(store, worms, force_limited, {key: [one.force_N] for key, one in found.items()}, _next_forces)
    return {key: replace(one, force_N=nearest(forces[key])[0]) for key, one in found.items()}


def _search(
    store: Store,
    worms: Mapping[Key, Mapping[str, Any]],
    actuator: Callable[[float], Actuator],
    first: Mapping[Key, Sequence[float]],
    following: Callable[[Readings], Sequence[float]],
) -> dict[Key, Readings]:
    """Pulls an end of every worm, from first values on, until nothing follows from what was read, or `ROUNDS` times."""
    found: dict[Key, dict[float, Pulled]] = {key: {} for key in worms}
    wanted = dict(first)
    for _ in range(ROUNDS):
        cases = {
            (key, value): pull(1, actuator(value), worms[key]) for key, values in wanted.items() for value in values
        }
        store.compute(cases.values(), "setting the actuators")
        for (key, value), case in cases.items():
            found[key][value] = read_pull(1, store[case])
        wanted = {key: values for key, readings in found.items() if (values := following(readings))}
        if not wanted:
            break
    return dict(found)


def _next_lengths(readings: Readings) -> Sequence[float]:
    if _error(*nearest(readings)) <= LARGEST_ERROR_M:
        return ()
    if len(readings) < 2:
        return GUESSES_M
    # A secant takes two readings that count.
    return [next_length(readings)] if sum(not one.problem for one in readings.values()) > 1 else ()


def _next_forces(readings: Readings) -> Sequence[float]:
    done = _error(*nearest(readings)) <= FORCE_ERROR_M or next_force(readings) in readings
    return () if done else [next_force(readings)]


def next_force(readings: Readings) -> float:
    """Returns the force, N, to try after these readings: on the secant, or below the least one without a reading."""
    good = {force: one for force, one in readings.items() if not one.problem}
    too_high = min((force for force, one in readings.items() if one.problem), default=inf)
    if not good:
        return round((1.0 - STEP_BACK) * too_high, 2)
    (force, reading), *others = sorted(good.items(), key=lambda item: _error(*item))
    slope = force / SLOPE_M
    if others and others[0][1].elongation_m != reading.elongation_m:
        slope = (others[0][0] - force) / (others[0][1].elongation_m - reading.elongation_m)
    step = (END_M - reading.elongation_m) * (slope if slope > 0 else force / SLOPE_M)
    return round((force + too_high) / 2.0 if force + step >= too_high else force + step, 2)


def nearest(readings: Readings) -> tuple[float, Pulled]:
    """Returns the length, m, or force, N, and the reading that come nearest to `END_M`."""
    return min(readings.items(), key=lambda item: _error(*item))


def next_length(readings: Readings) -> float:
    """Returns the length, m, at which the secant through the two readings nearest to `END_M` reaches it."""
    (x1, one), (x2, two) = sorted(readings.items(), key=lambda item: _error(*item))[:2]
    slope = (two.elongation_m - one.elongation_m) / (x2 - x1)
    return round(x1 + (END_M - one.elongation_m) / slope, 4)


def _error(_: float, reading: Pulled) -> float:
    error = abs(reading.elongation_m - END_M)
    return error if isfinite(error) and not reading.problem else inf

"""One segment of a resting worm pulled alone by one kind of actuator, and what is read when it stands still."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from typing import Any

from annelid.body.actuators.muscle import Rings
from annelid.body.actuators.servo import ServoRings
from annelid.body.assemble import mesh_of
from annelid.body.worm import WormBody
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment.case import Case
from annelid.experiment.outcome import Hold, Outcome
from annelid_studies.riddle2023.figures.muscle_surface import closed_form_flv, scaled_length
from annelid_studies.worms import RODS

PRESET = "wang"
AUTHORS_MESH: dict[str, Any] = {
    "body.strands.young_modulus_Pa": 2.0e9,
    "body.strands.shear_modulus_Pa": 1.33e9,
    "body.springs.stiffness_N_per_m": 24.5,
    "body.springs.rest_length_m": 0.065,
    "body.rings.force_limit_N": 13.2,
    "body.rings.speed_limit_m_per_s": 0.2,
}
"""The preset with these is the base worm, which all others change in one quantity: rods and springs of the authors'
models, none of them tuned to the robot's elongations, and servos of which a single one moves an end as the robot's."""
RESOLUTION: dict[str, Any] = {
    "clock.control_timestep_s": 0.02,
    "clock.physics_timestep_s": 0.02,
    "record.signals_interval_s": 0.02,
    "record.frames_interval_s": 4.0,
}
STANDSTILL: dict[str, Any] = {
    "body.formulation.friction_impedance_ratio": 1e5,
    "body.formulation.solver_tolerance": 1e-8,
}
"""With the preset's values, which are good for walking, a held worm creeps over the ground."""
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


@dataclass(frozen=True)
class Actuator:
    """One kind of actuator, and how strongly it pulls.

    Attributes:
        kind: One of `ACTUATORS`.
        setting: How strongly, in words.
        changes: Fields of the base worm that it changes, by their dotted paths.
        activation: Activation of the pulled segment.
    """

    kind: str
    setting: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    activation: float = 1.0


def base_body() -> WormBody:
    """Returns the body of the base worm: the preset's with the authors' mesh."""
    body = load_config(PRESET, AUTHORS_MESH).body
    assert isinstance(body, WormBody)
    return body


def base_servos() -> ServoRings:
    """Returns the servos of the base worm."""
    rings = base_body().rings
    assert isinstance(rings, ServoRings)
    return rings


def papers_muscle() -> Rings:
    """Returns the paper's muscle in the base worm's layout."""
    body = load_config(RODS).body
    assert isinstance(body, WormBody)
    return body.muscles.model_copy(update={"layout": base_servos().layout})


# The cable's own damping delays the standstill and changes nothing of it.
_QUICK_CABLE = {"body.rings.damping_Ns_per_m": 1.0}


def force_limited(force_N: float | tuple[float, ...]) -> Actuator:
    """A servo that winds until it stalls: its shortest cable is out of reach.

    Args:
        force_N: Tension all round the ring, N; one for all segments, or one a segment.
    """
    forces = force_N if isinstance(force_N, tuple) else (force_N,)
    changes = {
        **_QUICK_CABLE,
        "body.rings.force_limit_N": list(force_N) if isinstance(force_N, tuple) else force_N,
        "body.rings.stiffness_N_per_m": SOFT_N_PER_M,
        "body.rings.length_range_m": [round(SHORTEST * rest_ring_m(), 6), rest_ring_m()],
    }
    return Actuator("force-limited", f"{' / '.join(f'{one:.2f}' for one in forces)} N", changes)


def length_limited(length_m: float) -> Actuator:
    """A servo that winds its cable to a length, whatever force that takes.

    Args:
        length_m: Slack length of a whole ring's cable when wound, m.
    """
    changes = {
        **_QUICK_CABLE,
        "body.rings.force_limit_N": OUT_OF_REACH_N,
        "body.rings.stiffness_N_per_m": STIFF_N_PER_M,
        "body.rings.length_range_m": [length_m, rest_ring_m()],
    }
    return Actuator("length-limited", f"{length_m:.4f} m", changes)


def servo() -> Actuator:
    """The base worm's servo: its force limit, its speed limit and its range of lengths."""
    servos = base_servos()
    shortest = servos.length_ranges(1)[0][0]
    return Actuator("servo", f"{servos.forces(1)[0]:.2f} N, {shortest:g} m", _QUICK_CABLE)


def muscle(activation: float) -> Actuator:
    """The paper's muscle, whose force depends on its length, at an activation."""
    return Actuator(
        "muscle", f"activation {activation:.4f}", {"body.rings": papers_muscle().model_dump()}, round(activation, 6)
    )


def muscle_activation(force_N: float, ring_length_m: float) -> float:
    """Activation at which the paper's muscle, standing still, pulls with a force at a length of its ring."""
    rings = papers_muscle()
    length = scaled_length(ring_length_m, rings.length_ranges(1)[0])
    return float(force_N / (rings.forces(1)[0] * closed_form_flv(length, 0.0, rings)))


def rest_ring_m() -> float:
    """Length of a ring of the base worm at rest, m."""
    return round(float(mesh_of(base_body().mesh).ring_length_m[0]), 6)


def pull(segment: int, actuator: Actuator, changes: Mapping[str, Any] | None = None) -> Case:
    """Returns the run in which one segment is pulled and all others rest.

    Args:
        segment: The segment, from 1.
        actuator: What pulls.
        changes: Fields of worm, ground or resolution that differ from the base worm and this study's settings.
    """
    contractions = [
        {"segment": segment, "start_s": 0.0, "stop_s": stop, "activation": actuator.activation} for stop in READ_S
    ]
    ramp_s = RAMP_S if actuator.kind == "muscle" else 0.0
    own: dict[str, Any] = {
        "duration_s": DURATION_S,
        "controller": {"kind": "program", "ramp_s": ramp_s, "contractions": contractions},
    }
    return Case(PRESET, {**AUTHORS_MESH, **RESOLUTION, **STANDSTILL, **actuator.changes, **(changes or {}), **own})


@dataclass(frozen=True, slots=True)
class Pulled:
    """What is read of one pulled segment.

    Attributes:
        segment: The segment, from 1.
        elongation_m: Mean of its left and right sensor above their rest length, m; NaN where there is no reading.
        ring_length_m: Length of its ring, m.
        force_N: Tension all round its ring, N.
        drift_m: How much it lengthened in the last half second, m.
        problem: Why the reading does not count; empty if it does.
    """

    segment: int
    elongation_m: float
    ring_length_m: float
    force_N: float
    drift_m: float
    problem: str


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

"""Servos that wind a cable round each ring."""

from __future__ import annotations

from collections.abc import Iterator
from math import expm1
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from pydantic import Field

from annelid.body.actuators import ActuatorKind, PerSegment, Slopes
from annelid.body.estimates import (
    ESTIMATE_FACTOR,
    MOST_SHRUNK_AT_REST,
    bearable_force_N,
    crush_findings,
    rhombus_of,
    weakness_findings,
)
from annelid.body.mesh import MeshBody
from annelid.config.answers import Finding
from annelid.config.sections import NonNegative, Positive, Range
from annelid.morphology import Array

if TYPE_CHECKING:
    import mujoco


class ServoRings(ActuatorKind):
    """Servos, each of which winds a cable that lies round a ring (or half of it) and can only pull.

    Activation commands the cable's slack length, from the longest at 0 to the shortest at 1, and the servo winds or
    pays out towards it at no more than its speed limit. The cable's tension is ``stiffness (length - slack length) +
    damping rate``, kept between 0 and the force limit; at the limit the servo stalls, and winds on only as its ring
    gives way. A longest cable beyond the ring at rest is slack that is wound first. A taut cable keeps a gear on one
    flank, so its play alone is not felt; ``backlash_m`` is what a servo loses where it reverses, because its position
    sensor has play or its controller ignores small errors.

    With ``cable_friction``, force limits are those at the motor, and a ring feels the mean tension round it; that
    friction also holds a cable that is pulled out, which this leaves away.
    """

    cites: ClassVar[tuple[tuple[str, str], ...]] = (("riddle2025models", "the position servos"),)
    force_field: ClassVar[str] = "force_limit_N"
    kind: Literal["servo"] = "servo"
    length_range_m: Range | tuple[Range, ...] = Field(
        default=(0.62, 0.96),
        description="shortest and longest cable of a whole ring (half-rings have half of it each), one pair for all or "
        "one pair per segment",
    )
    force_limit_N: PerSegment = Field(
        default=13.0, description="tension at which a servo stalls, one number for all or one per segment"
    )
    speed_limit_m_per_s: Positive = Field(default=0.064, description="fastest winding and paying out")
    backlash_m: NonNegative = Field(
        default=0.0,
        description="length of cable that is lost where winding reverses: a servo stands still within half of it about "
        "its command",
    )
    cable_friction: NonNegative | None = Field(
        default=None,
        description="friction of a cable times the angle that it wraps, m: a ring feels (1 - exp(-m)) / m of the force "
        "limit (not set: none)",
    )
    stiffness_N_per_m: Positive = Field(default=1000.0, description="tension of a cable per length that it lacks")
    damping_Ns_per_m: NonNegative = Field(default=10.0, description="tension of a taut cable per rate of its length")

    def findings(self, body: MeshBody) -> Iterator[Finding]:
        """Checks the cables' range against the ring at rest, and their force against the mesh."""
        for low, high, force_N in self.strongest(body.n_segments):
            yield from _findings(body, self, low, high, force_N / wrap_factors(self.cable_friction or 0.0)[0])

    def add(self, spec: mujoco.MjSpec, name: str, span_m: list[float], force_N: float) -> None:
        """Adds a cable whose slack length is the engine's state, and its rate the control."""
        import mujoco

        stiffness, speed = self.stiffness_N_per_m, self.speed_limit_m_per_s
        spec.add_actuator(
            name=name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_TENDON,
            dyntype=mujoco.mjtDyn.mjDYN_INTEGRATOR,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            gainprm=[stiffness, *[0.0] * 9],
            biasprm=[0.0, -stiffness, -self.damping_Ns_per_m, *[0.0] * 7],
            lengthrange=span_m,
            ctrllimited=True,
            ctrlrange=[-speed, speed],
            actlimited=True,
            actrange=span_m,
            forcelimited=True,
            forcerange=[-force_N / wrap_factors(self.cable_friction or 0.0)[0], 0.0],
        )

    def slopes(self, model: mujoco.MjModel) -> Slopes:
        """Returns the slopes of taut cables that do not stall."""
        limits = -model.actuator_forcerange[:, 0].copy()

        def slopes(length_m: Array, rate_m_per_s: Array, drive: Array, tension_N: Array) -> tuple[Array, Array]:
            pulls = ((tension_N > 0.0) & (tension_N < limits)).astype(float)
            return self.stiffness_N_per_m * pulls, self.damping_Ns_per_m * pulls

        return slopes

    def first_act(self, model: mujoco.MjModel) -> Array:
        """Returns the slack lengths of cables that are paid out, m."""
        return model.actuator_actrange[:, 1].copy()

    def act_at_rest(self, spec: mujoco.MjSpec) -> Array:
        """Returns the slack lengths of cables that are paid out, m."""
        return np.array([actuator.actrange[1] for actuator in spec.actuators])

    def states_after(
        self, model: mujoco.MjModel, activation: Array, state: Array, length_m: Array, time_s: float
    ) -> Array:
        """Returns the slack lengths of the cables, m, after commands.

        A cable winds towards the commanded length, up to half the backlash from it, but never so short that its tension
        would exceed the force limit: a stalled servo does not wind on, gives way to what pulls harder, and lets go at
        once when it is commanded to.
        """
        (shortest, longest), limits_N = model.actuator_actrange.T, -model.actuator_forcerange[:, 0]
        play, speed = 0.5 * self.backlash_m, self.speed_limit_m_per_s
        stalled = np.minimum(length_m - limits_N / self.stiffness_N_per_m, longest)
        # One by one, so that commands that are given together come to the same bits as single ones.
        for command in activation:
            commanded = longest + command * (shortest - longest)
            if play:
                commanded = state.clip(commanded - play, commanded + play)
            aim = np.maximum(commanded, stalled) - state
            wound = np.minimum(np.maximum(aim, -speed * time_s), speed * time_s)
            state = (state + wound).clip(shortest, longest)
        return state

    def control(self, activation: Array, state: Array) -> Array:
        """Returns the rates of the slack lengths during a step, none: they are those at its end already."""
        return np.zeros_like(state)


def wrap_factors(friction: float) -> tuple[float, float]:
    """Force at the pulled end of a cable over its mean tension, while it is wound in and while it is let out.

    The tension of a cable that slides round a body falls as ``exp(-mu angle)`` from the end that moves first
    (Euler and Eytelwein). With ``m = mu * wrap angle`` its mean is ``(1 - exp(-m)) / m`` of the force at that end
    when wound in and ``(exp(m) - 1) / m`` when let out, so that the two forces differ by ``exp(m)``; m = 0 is a cable
    that slides freely.
    """
    if friction == 0.0:
        return 1.0, 1.0
    return friction / -expm1(-friction), friction / expm1(friction)


def _findings(body: MeshBody, rings: ServoRings, low: float, high: float, force_N: float) -> Iterator[Finding]:
    """The cables' range against the ring at rest, and their force against the mesh."""
    rest, bearable = rhombus_of(body).ring_length_m, bearable_force_N(body)
    rate = rings.stiffness_N_per_m / (1 if rings.layout == "whole" else 2)
    idle = min(force_N, rate * max(0.0, rest - high))
    severity, problem = "warning", ""
    if low >= rest:
        severity, problem = "error", f"even the shortest cable of {low:.3g} m pulls 0 N"
    elif idle > 0.1 * bearable:
        severity = "error" if idle > ESTIMATE_FACTOR * bearable and high < MOST_SHRUNK_AT_REST * rest else "warning"
        problem = (
            f"the longest cable of {high:.3g} m pulls {idle:.3g} N before anything is activated, where the mesh bears "
            f"about {bearable:.2g} N"
        )
    elif low > 0.98 * rest:
        problem = f"a cable of {low:.3g} m hardly pulls"
    elif high > 1.5 * rest:
        problem = f"most of the winding from {high:.3g} m is slack"
    if problem:
        problem, fitting = (
            f"a ring is {rest:.3g} m long at rest, so that {problem}",
            f"set [{0.65 * rest:.3g}, {rest:.3g}]",
        )
        yield Finding("body.rings.length_range_m", [low, high], problem, fitting, severity)
    if low < rest:
        yield from weakness_findings(body, "stiffness_N_per_m", rings.stiffness_N_per_m, rate * (rest - low))
        yield from weakness_findings(body, rings.force_field, force_N, force_N)
        yield from crush_findings(rings.force_field, force_N, bearable, low / rest)

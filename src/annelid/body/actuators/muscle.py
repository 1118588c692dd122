"""Ring muscles: MuJoCo's force-length-velocity muscle on a closed ring or on two half-rings."""

from __future__ import annotations

from collections.abc import Iterator
from math import exp, hypot, sin
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
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
from annelid.config.sections import Positive
from annelid.morphology import Array

if TYPE_CHECKING:
    import mujoco

LOWEST_MUSCLE, SPAN_OF_MUSCLE = 0.75, 0.3
"""The engine lays a muscle's length range from 0.75 to 1.05 of its optimal length."""
MOST_OVER = 200.0
"""Largest force of a muscle at rest length over what the mesh bears; the paper's is 100 times that."""
NEWTON_STEPS = 5
"""Steps to the level of a rising muscle, which leave less than 1e-14 of it."""


class Rings(ActuatorKind):
    """Ring muscles: MuJoCo's force-length-velocity muscle on a closed ring (or two half-rings).

    The muscle's optimal length is ``(length_range[1] - length_range[0]) / (1.05 - 0.75)``: MuJoCo scales the
    given range to 0.75-1.05 of it. The force is ``peak_force_N * (activation * FL * FV + FP)``.
    """

    force_field: ClassVar[str] = "peak_force_N"
    kind: Literal["muscle"] = "muscle"
    peak_force_N: PerSegment = Field(
        default=117.57, description="isometric force at the optimal length, F0, one number for all or one per segment"
    )
    minimum_length: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.58, description="lmin, relative to the optimal length"
    )
    maximum_length: Annotated[float, Field(gt=1, le=1e6)] = Field(
        default=1.6, description="lmax, relative to the optimal length"
    )
    maximum_velocity: Positive = Field(default=1.5, description="vmax, optimal lengths per second")
    passive_peak: Positive = Field(default=1.3, description="fpmax, relative to the peak force")
    lengthening_peak: Positive = Field(default=1.2, description="fvmax, relative to the peak force")
    activation_dynamics: bool = Field(
        default=True, description="true: activation lags behind its command as MuJoCo's; false: it acts at once"
    )
    activation_times_s: tuple[Positive, Positive] = Field(
        default=(0.01, 0.04), description="MuJoCo's time constants of activation and deactivation, for the lag"
    )

    @property
    def muscle(self) -> Rings:
        """The section itself."""
        return self

    @property
    def lags(self) -> bool:
        """Whether its field says so."""
        return self.activation_dynamics

    def states_after(
        self, model: mujoco.MjModel, activation: Array, state: Array, length_m: Array, time_s: float
    ) -> Array:
        """Returns what acts of the activation after commands: the engine's lag, solved exactly.

        It is ``(activation - state) / time``, with a time of ``rise (0.5 + 1.5 state)`` or ``fall / (0.5 + 1.5 state)``
        (Millard et al. 2013, as MuJoCo has it). The engine's own steps of first order are stable below 10 ms only.
        """
        if not self.activation_dynamics:
            return state
        # A few muscles at a time: plain numbers are faster than arrays.
        after = []
        for level, commands in zip(state.tolist(), activation.T.tolist(), strict=True):
            for command in commands:
                level = _followed(level, command, time_s, *self.activation_times_s)
            after.append(level)
        return np.array(after)

    def control(self, activation: Array, state: Array) -> Array:
        """Returns the activation that acts, with a lag or at once."""
        return state if self.activation_dynamics else activation

    def findings(self, body: MeshBody) -> Iterator[Finding]:
        """Checks the muscles' lengths without force against the ring at rest, and their force against the mesh."""
        for low, high, force_N in self.strongest(body.n_segments):
            yield from _findings(body, self, low, high, force_N)

    def add(self, spec: mujoco.MjSpec, name: str, span_m: list[float], force_N: float) -> None:
        """Adds one muscle."""
        import mujoco

        actuator = spec.add_actuator(
            name=name,
            target=name,
            trntype=mujoco.mjtTrn.mjTRN_TENDON,
            lengthrange=span_m,
            ctrllimited=True,
            ctrlrange=[0.0, 1.0],
        )
        actuator.set_to_muscle(
            timeconst=self.activation_times_s,
            tausmooth=0.0,
            range=[0.75, 1.05],
            force=force_N,
            lmin=self.minimum_length,
            lmax=self.maximum_length,
            vmax=self.maximum_velocity,
            fpmax=self.passive_peak,
            fvmax=self.lengthening_peak,
        )
        # Of a written model, whose explicit steps may overshoot.
        actuator.actlimited, actuator.actrange = self.activation_dynamics, [0.0, 1.0]
        if not self.activation_dynamics:
            actuator.dyntype = mujoco.mjtDyn.mjDYN_NONE

    def slopes(self, model: mujoco.MjModel) -> Slopes:
        """Returns the slopes of ``F0 (activation FL(x) FV(v) + FP(x))``, with x and v in optimal lengths."""
        shortest, longest = model.actuator_lengthrange.T.copy()
        low, high = model.actuator_gainprm[0, :2]
        optimal_m = (longest - shortest) / (high - low)
        force = model.actuator_gainprm[:, 2].copy()
        fastest_m_per_s = optimal_m * self.maximum_velocity

        def slopes(length_m: Array, rate_m_per_s: Array, drive: Array, tension_N: Array) -> tuple[Array, Array]:
            x, v = low + (length_m - shortest) / optimal_m, rate_m_per_s / fastest_m_per_s
            active, active_slope = _force_length(x, self.minimum_length, self.maximum_length)
            speed, speed_slope = _force_velocity(v, self.lengthening_peak)
            # Of the passive force: a parabola from 1 to halfway to the longest, straight beyond.
            half = 0.5 * (self.maximum_length - 1.0)
            passive_slope = self.passive_peak * (x - 1.0).clip(0.0, half) / half**2
            per_length = force / optimal_m * (drive * active_slope * speed + passive_slope)
            per_rate = force / fastest_m_per_s * drive * active * speed_slope
            return per_length.clip(0.0), per_rate.clip(0.0)

        return slopes


def _followed(level: float, command: float, time_s: float, rise_s: float, fall_s: float) -> float:
    """Level of a muscle that has followed a command for a time, both in [0, 1]."""
    scale = 0.5 + 1.5 * command
    if level >= command:
        # A logistic curve.
        excess, left = level - command, exp(-scale * time_s / fall_s)
        return command + excess * scale * left / (scale + 1.5 * excess * (1.0 - left))
    # With w = 1.5 (command - level) / scale, w exp(-w) decays exponentially; Newton's steps come to w from below.
    w = 1.5 * (command - level) / scale
    decayed = w * exp(-w - time_s / (rise_s * scale))
    w = decayed * (1.0 + decayed * (1.0 + 1.5 * decayed))
    for _ in range(NEWTON_STEPS):
        w += (decayed * exp(w) - w) / (1.0 - w)
    return command - w * scale / 1.5


def _findings(body: MeshBody, rings: Rings, low: float, high: float, force_N: float) -> Iterator[Finding]:
    """The muscle's lengths without force against the ring at rest, and its force against the mesh."""
    rest, bearable = rhombus_of(body).ring_length_m, bearable_force_N(body)
    optimal = (high - low) / SPAN_OF_MUSCLE
    none = low + (rings.minimum_length - LOWEST_MUSCLE) * optimal
    at_rest = LOWEST_MUSCLE + (rest - low) / optimal
    pull, passive = force_N * _active_share(at_rest, rings), force_N * _passive_share(at_rest, rings)
    field, fitting = "body.rings.length_range_m", f"set [{0.59 * rest:.3g}, {1.11 * rest:.3g}]"
    if passive > 0.1 * bearable:
        # Its passive force ends at the optimal length.
        shrunk = low + (1.0 - LOWEST_MUSCLE) * optimal < MOST_SHRUNK_AT_REST * rest
        problem = (
            f"a ring is {rest:.3g} m long at rest, so that its muscle pulls {passive:.3g} N before anything is "
            f"activated, where the mesh bears about {bearable:.2g} N"
        )
        severity = "error" if passive > ESTIMATE_FACTOR * bearable and shrunk else "warning"
        yield Finding(field, [low, high], problem, fitting, severity)
    elif _active_share(at_rest, rings) < 0.02:
        where = f"at any length below {none:.3g} m" if at_rest < 1.0 else "beyond its longest length"
        problem = f"a ring is {rest:.3g} m long at rest, where its muscle pulls {pull:.2g} N, and 0 N {where}"
        yield Finding(field, [low, high], problem, fitting, "error" if at_rest < 1.0 else "warning")
    elif pull > MOST_OVER * bearable:
        problem = (
            f"at rest length a muscle begins to pull with {pull:.3g} N, {pull / bearable:.0f} times what the mesh "
            "bears: its ring may be squeezed beyond the length at which the force ends"
        )
        most = MOST_OVER * bearable / _active_share(at_rest, rings)
        yield Finding(f"body.rings.{rings.force_field}", force_N, problem, f"set at most {most:.2g}")
    else:
        yield from weakness_findings(body, rings.force_field, force_N, pull)
    yield from crush_findings(
        rings.force_field, force_N, bearable, _settled_m(body, rings, none, optimal, force_N) / rest
    )


def _settled_m(body: MeshBody, rings: Rings, none_m: float, optimal_m: float, force_N: float) -> float:
    """Length at which the muscle, fully activated, pulls no more than the mesh resists, m."""
    shape = rhombus_of(body)
    hypotenuse = hypot(shape.across_m, shape.along_m)
    closed, open_ = 0.0, 1.0
    for _ in range(30):
        share = (closed + open_) / 2
        ring = shape.n_per_plane * hypotenuse * sin(share * shape.opening_rad)
        pull = force_N * _active_share(rings.minimum_length + (ring - none_m) / optimal_m, rings)
        closed, open_ = (closed, share) if pull > bearable_force_N(body, share) else (share, open_)
    return shape.n_per_plane * hypotenuse * sin(closed * shape.opening_rad)


def muscle_force(length: ArrayLike, velocity: ArrayLike, rings: Rings, activation: float = 1.0) -> Array:
    """Computes the force of MuJoCo's muscle by its documented formula, ``activation FL(L) FV(V) + FP(L)``.

    FL is a bump of four parabolas from lmin over 1 to lmax. FV is a parabola that reaches 0 at -vmax and 1 at rest,
    then another that saturates at fvmax. FP is 0 up to 1, a parabola to half fpmax at the middle b between 1
    and lmax, and its tangent from there: it passes fpmax midway between b and lmax, and is 1.5 fpmax at lmax.
    MuJoCo's documentation, "Muscles", with its FLV.m.

    Args:
        length: Relative to the optimal length L0.
        velocity: Relative to L0, 1/s; negative while the muscle shortens. Broadcast against the lengths.
        rings: The muscle's parameters.
        activation: In [0, 1].

    Returns:
        Pulling force relative to the peak force F0, in the shape of the broadcast arguments.
    """
    x, v = np.broadcast_arrays(np.asarray(length, float), np.asarray(velocity, float) / rings.maximum_velocity)
    active, _ = _force_length(x, rings.minimum_length, rings.maximum_length)
    speed, _ = _force_velocity(v, rings.lengthening_peak)
    beyond = (2.0 * (x - 1.0) / (rings.maximum_length - 1.0)).clip(0.0)
    passive = rings.passive_peak * np.where(beyond < 1.0, 0.5 * beyond**2, beyond - 0.5)
    return activation * active * speed + passive


def _active_share(length: float, rings: Rings) -> float:
    """Active force of a muscle over its peak, at a length in optimal lengths."""
    return float(_force_length(np.asarray(length), rings.minimum_length, rings.maximum_length)[0])


def _passive_share(length: float, rings: Rings) -> float:
    """Passive force of a muscle over its peak, at a length in optimal lengths."""
    return float(muscle_force(length, 0.0, rings, 0.0))


def _force_length(x: Array, shortest: float, longest: float) -> tuple[Array, Array]:
    """The active force's dependence on length, two parabolas on either side of 1, and its slope."""
    reach = np.where(x < 1.0, 1.0 - shortest, longest - 1.0)
    away = np.minimum(np.abs(x - 1.0) / reach, 1.0)
    value = np.where(away < 0.5, 1.0 - 2.0 * away**2, 2.0 * (1.0 - away) ** 2)
    steepness = np.where(away < 0.5, 4.0 * away, 4.0 * (1.0 - away)) / reach
    return value, np.where(x < 1.0, steepness, -steepness)


def _force_velocity(v: Array, lengthening_peak: float) -> tuple[Array, Array]:
    """The active force's dependence on the rate of length, and its slope."""
    # Without excess nothing is left to saturate, and the limit guards the quotient.
    excess = max(lengthening_peak - 1.0, 1e-300)
    shortening, lengthening = (v + 1.0).clip(0.0), (excess - v).clip(0.0)
    shortens = v <= 0.0
    value = np.where(shortens, shortening**2, lengthening_peak - lengthening**2 / excess)
    return value, np.where(shortens, 2.0 * shortening, 2.0 * lengthening / excess)

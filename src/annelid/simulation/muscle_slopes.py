"""How steeply a ring actuator's tension rises with its length and with its rate, as the engine linearises it.

The integrator of the rods takes every force at the end of its step, to first order. What an actuator pulled with is
the engine's ``actuator_force``, which belongs to the start, and these two slopes times what has changed since.
"""

from __future__ import annotations

from typing import Protocol

import mujoco
import numpy as np

from annelid.config import Rings, ServoRings
from annelid.morphology import Array


class Slopes(Protocol):
    """Slopes of the actuators of one worm."""

    def __call__(self, length_m: Array, rate_m_per_s: Array, drive: Array, tension_N: Array) -> tuple[Array, Array]:
        """Tells both slopes, never negative, since the engine drops what would destabilise it.

        Args:
            length_m: Lengths of the rings, m, ``(n_muscles,)``.
            rate_m_per_s: Rates of their lengths, m/s.
            drive: What the muscles' gain is multiplied by, their activation.
            tension_N: Their tensions, N.

        Returns:
            Tension per length, N/m, and per rate, N s/m.
        """
        ...


def slopes_of(model: mujoco.MjModel, rings: Rings | ServoRings) -> Slopes | None:
    """Returns the slopes for a compiled body, or None where its integrator takes forces as they are at the start."""
    if model.opt.integrator != int(mujoco.mjtIntegrator.mjINT_DISCRETE):
        return None
    return _servo_slopes(model, rings) if isinstance(rings, ServoRings) else _muscle_slopes(model, rings)


def _servo_slopes(model: mujoco.MjModel, rings: ServoRings) -> Slopes:
    limits = -model.actuator_forcerange[:, 0].copy()

    def slopes(length_m: Array, rate_m_per_s: Array, drive: Array, tension_N: Array) -> tuple[Array, Array]:
        pulls = ((tension_N > 0.0) & (tension_N < limits)).astype(float)
        return rings.stiffness_N_per_m * pulls, rings.damping_Ns_per_m * pulls

    return slopes


def _muscle_slopes(model: mujoco.MjModel, rings: Rings) -> Slopes:
    """The muscle is ``F0 (activation FL(x) FV(v) + FP(x))``, with x and v in optimal lengths."""
    shortest, longest = model.actuator_lengthrange.T.copy()
    low, high = model.actuator_gainprm[0, :2]
    optimal_m = (longest - shortest) / (high - low)
    force = model.actuator_gainprm[:, 2].copy()
    fastest_m_per_s = optimal_m * rings.maximum_velocity

    def slopes(length_m: Array, rate_m_per_s: Array, drive: Array, tension_N: Array) -> tuple[Array, Array]:
        x, v = low + (length_m - shortest) / optimal_m, rate_m_per_s / fastest_m_per_s
        active, active_slope = _force_length(x, rings.minimum_length, rings.maximum_length)
        speed, speed_slope = _force_velocity(v, rings.lengthening_peak)
        passive_slope = _passive_slope(x, rings.maximum_length, rings.passive_peak)
        per_length = force / optimal_m * (drive * active_slope * speed + passive_slope)
        per_rate = force / fastest_m_per_s * drive * active * speed_slope
        return per_length.clip(0.0), per_rate.clip(0.0)

    return slopes


def _force_length(x: Array, shortest: float, longest: float) -> tuple[Array, Array]:
    """The active force's dependence on length, two parabolas on either side of 1, and its slope."""
    reach = np.where(x < 1.0, 1.0 - shortest, longest - 1.0)
    # Way from the optimum to where the muscle has no force, 0 to 1.
    away = np.minimum(np.abs(x - 1.0) / reach, 1.0)
    value = np.where(away < 0.5, 1.0 - 2.0 * away**2, 2.0 * (1.0 - away) ** 2)
    steepness = np.where(away < 0.5, 4.0 * away, 4.0 * (1.0 - away)) / reach
    return value, np.where(x < 1.0, steepness, -steepness)


def _force_velocity(v: Array, lengthening_peak: float) -> tuple[Array, Array]:
    """The active force's dependence on the rate of length, and its slope."""
    excess = lengthening_peak - 1.0
    shortening, lengthening = (v + 1.0).clip(0.0), (excess - v).clip(0.0)
    shortens = v <= 0.0
    value = np.where(shortens, shortening**2, lengthening_peak - lengthening**2 / excess)
    return value, np.where(shortens, 2.0 * shortening, 2.0 * lengthening / excess)


def _passive_slope(x: Array, longest: float, peak: float) -> Array:
    """Slope of the passive force: a parabola from 1 to halfway to the longest, straight beyond."""
    half = 0.5 * (longest - 1.0)
    return peak * (x - 1.0).clip(0.0, half) / half**2

"""Phase oscillators with a descending drive: the salamander's spinal cord, on a worm's segments.

Oscillator i has a phase theta_i (rad) and an amplitude r_i (Ijspeert, Crespi, Ryczko and Cabelguen 2007, "From swimming
to walking with a salamander robot driven by a spinal cord model", Science 315, eq. 1-3):

    dtheta_i/dt = 2 pi nu + sum_j r_j w sin(theta_j - theta_i - phi_ij)
    d2r_i/dt2 = a (a/4 (R - r_i) - dr_i/dt)
    x_i = r_i (1 + cos theta_i)

Intrinsic frequency nu and amplitude R are linear in the drive d within the body's range and 0 outside. With d rising
from 1 the body swims with a travelling wave, and falls silent beyond 5. The salamander has two such chains in
antiphase, where their coupling vanishes, and limbs; one side without limbs is enough for a worm, whose muscles are
rings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from annelid.errors import ConfigError
from annelid.protocols import Array

# The salamander's constants: Ijspeert et al. 2007, Table S1. Rates are 1/s.
LOWEST_DRIVE, HIGHEST_DRIVE = 1.0, 5.0
FREQUENCY_HZ, AMPLITUDE = (0.2, 0.3), (0.065, 0.196)
"""Slopes over the drive, and values at drive 0, were it to oscillate there."""
AMPLITUDE_RATE_PER_S = 20.0
"""a, the rate at which amplitudes settle."""
COUPLING_PER_S = 10.0
"""w between neighbours, in both directions."""


def frequency_Hz(drive: float) -> float:
    """Returns the intrinsic frequency nu, Hz."""
    return _within(drive, *FREQUENCY_HZ)


def amplitude(drive: float) -> float:
    """Returns the intrinsic amplitude R."""
    return _within(drive, *AMPLITUDE)


def _within(drive: float, slope: float, offset: float) -> float:
    return slope * drive + offset if LOWEST_DRIVE <= drive <= HIGHEST_DRIVE else 0.0


class PhaseStepper:
    """Advances copies of one side of the salamander's body by Heun's method, which is exact for a locked state.

    A state is the arrays theta (rad, not wrapped), r, and dr/dt (1/s), ``(3, n_copies, n_body)``.

    Raises:
        ConfigError: A time step of more than 1 / `AMPLITUDE_RATE_PER_S`.
    """

    def __init__(self, n_body: int, lag_rad: float, timestep_s: float, coupling_per_s: float = COUPLING_PER_S) -> None:
        """Prepares a step.

        Args:
            n_body: Oscillators in the chain.
            lag_rad: Phase by which each follows the one before it, rad.
            timestep_s: Step, s.
            coupling_per_s: w, 1/s.
        """
        if not 0 < timestep_s * AMPLITUDE_RATE_PER_S <= 1:
            raise ConfigError(
                f"a time step of {timestep_s:g} s is too long for phase oscillators: "
                f"it must be in 0 .. {1 / AMPLITUDE_RATE_PER_S:g} s"
            )
        self.timestep_s, self._coupling_per_s = timestep_s, coupling_per_s
        node = np.arange(n_body)
        self._to, self._from = np.nonzero(np.abs(node[:, np.newaxis] - node) == 1)
        self._bias = np.where(self._to > self._from, lag_rad, -lag_rad)
        self._gather = (self._to[:, np.newaxis] == node).astype(float)

    def advance(self, state: Array, frequency_Hz: ArrayLike, amplitude: ArrayLike) -> Array:
        """Returns the state one step on, under intrinsic frequencies and amplitudes that broadcast to its copies."""
        turn, target, a = 2.0 * np.pi * np.asarray(frequency_Hz), amplitude, AMPLITUDE_RATE_PER_S

        def rates(now: Array) -> Array:
            phase, size, rate = now
            pull = np.sin(phase[:, self._from] - phase[:, self._to] - self._bias)
            turned = turn + (size[:, self._from] * self._coupling_per_s * pull) @ self._gather
            return np.stack([turned, rate, a * (0.25 * a * (target - size) - rate)])

        first = rates(state)
        return state + 0.5 * self.timestep_s * (first + rates(state + self.timestep_s * first))

"""Phase oscillators with a descending drive: the salamander's spinal cord, on a worm's segments.

Oscillator i has a phase theta_i (rad) and an amplitude r_i (Ijspeert, Crespi, Ryczko and Cabelguen 2007, "From swimming
to walking with a salamander robot driven by a spinal cord model", Science 315, eq. 1-3):

    dtheta_i/dt = 2 pi nu_i + sum_j r_j w_ij sin(theta_j - theta_i - phi_ij)
    d2r_i/dt2 = a (a/4 (R_i - r_i) - dr_i/dt)
    x_i = r_i (1 + cos theta_i)

Intrinsic frequency nu and amplitude R are linear in the drive d within an oscillator's range and 0 outside. With d
rising from 1 the body swims with a travelling wave, and falls silent beyond 5. The salamander has two such chains in
antiphase, where their coupling vanishes, and limbs; one side without limbs is enough for a worm, whose muscles are
rings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from annelid.errors import ConfigError, require_at_least
from annelid.protocols import Array


@dataclass(frozen=True, slots=True)
class DriveResponse:
    """Intrinsic frequency and amplitude of an oscillator as functions of the drive, 0 outside its range.

    Attributes:
        lowest_drive: Drive from which it oscillates.
        highest_drive: Drive up to which it oscillates.
        frequency_slope_Hz: Frequency per unit of drive, Hz.
        frequency_offset_Hz: Frequency at drive 0, were it to oscillate there, Hz.
        amplitude_slope: Amplitude per unit of drive.
        amplitude_offset: Amplitude at drive 0, likewise.
    """

    lowest_drive: float
    highest_drive: float
    frequency_slope_Hz: float
    frequency_offset_Hz: float
    amplitude_slope: float
    amplitude_offset: float

    def frequency_Hz(self, drive: ArrayLike) -> Array:
        """Returns the intrinsic frequency, Hz, in the drive's shape."""
        return self._within(drive, self.frequency_slope_Hz, self.frequency_offset_Hz)

    def amplitude(self, drive: ArrayLike) -> Array:
        """Returns the intrinsic amplitude, in the drive's shape."""
        return self._within(drive, self.amplitude_slope, self.amplitude_offset)

    def _within(self, drive: ArrayLike, slope: float, offset: float) -> Array:
        d = np.asarray(drive, dtype=float)
        return np.where((d >= self.lowest_drive) & (d <= self.highest_drive), slope * d + offset, 0.0)


# The salamander's constants: Ijspeert et al. 2007, Table S1. Rates are 1/s.
BODY = DriveResponse(1.0, 5.0, 0.2, 0.3, 0.065, 0.196)
AMPLITUDE_RATE_PER_S = 20.0
"""a, the rate at which amplitudes settle."""
BODY_COUPLING_PER_S = 10.0
"""w between neighbours."""


@dataclass(frozen=True)
class PhaseNetwork:
    """Oscillators and their couplings.

    Attributes:
        responses: How each oscillator answers the drive, n of them.
        coupling_per_s: w, 1/s; ``w[i, j]`` acts on i from j, ``(n, n)``.
        phase_bias_rad: phi, rad, same shape: alone, the coupling from j makes i lag by it.

    Raises:
        ConfigError: Arrays of another shape.
    """

    responses: tuple[DriveResponse, ...]
    coupling_per_s: Array
    phase_bias_rad: Array

    def __post_init__(self) -> None:
        n = len(self.responses)
        for name in ("coupling_per_s", "phase_bias_rad"):
            shape = np.shape(getattr(self, name))
            if shape != (n, n):
                raise ConfigError(f"{name} has shape {shape}, but {n} oscillators need ({n}, {n})")

    def frequency_Hz(self, drive: ArrayLike) -> Array:
        """Returns the intrinsic frequencies, Hz, ``(*drive.shape, n)``."""
        return self._of_each(lambda response: response.frequency_Hz(drive))

    def amplitude(self, drive: ArrayLike) -> Array:
        """Returns the intrinsic amplitudes, ``(*drive.shape, n)``."""
        return self._of_each(lambda response: response.amplitude(drive))

    def _of_each(self, answer: Callable[[DriveResponse], Array]) -> Array:
        of_kind = {response: answer(response) for response in set(self.responses)}
        return np.stack([of_kind[response] for response in self.responses], axis=-1)


def phase_chain(n_body: int, lag_rad: float | None = None, coupling_per_s: float = BODY_COUPLING_PER_S) -> PhaseNetwork:
    """Builds one side of the salamander's body for any number of segments; Ijspeert et al. 2007, Fig. 1.

    Args:
        n_body: Oscillators in a chain, at least 2, coupled to their neighbours in both directions.
        lag_rad: Phase by which each follows the one before it, rad; default one wave on the body, 2 pi / n_body.
        coupling_per_s: w, 1/s.

    Raises:
        ConfigError: Fewer than 2 oscillators.
    """
    require_at_least(2, n_body=n_body)
    weight, bias = np.zeros((n_body, n_body)), np.zeros((n_body, n_body))
    front = np.arange(n_body - 1)
    weight[front, front + 1] = weight[front + 1, front] = coupling_per_s
    lag = 2.0 * np.pi / n_body if lag_rad is None else lag_rad
    bias[front + 1, front], bias[front, front + 1] = lag, -lag
    return PhaseNetwork((BODY,) * n_body, weight, bias)


@dataclass
class PhaseState:
    """State of any number of copies of a network, each array of shape ``(n_networks, n)``.

    Attributes:
        phase_rad: theta, rad, not wrapped.
        amplitude: r.
        amplitude_rate_per_s: dr/dt, 1/s.
    """

    phase_rad: Array
    amplitude: Array
    amplitude_rate_per_s: Array


class PhaseStepper:
    """Advances any number of copies of a network by Heun's method, which is exact for a locked state.

    Raises:
        ConfigError: A time step of more than 1 / `AMPLITUDE_RATE_PER_S`.
    """

    def __init__(self, network: PhaseNetwork, timestep_s: float) -> None:
        """Prepares a step.

        Args:
            network: The oscillators.
            timestep_s: Step, s.
        """
        if not 0 < timestep_s * AMPLITUDE_RATE_PER_S <= 1:
            raise ConfigError(
                f"a time step of {timestep_s:g} s is too long for phase oscillators: "
                f"it must be in 0 .. {1 / AMPLITUDE_RATE_PER_S:g} s"
            )
        self.network = network
        self.timestep_s = timestep_s
        # Only oscillators that are coupled enter the sum.
        self._to, self._from = np.nonzero(network.coupling_per_s)
        self._weight = network.coupling_per_s[self._to, self._from]
        self._bias = network.phase_bias_rad[self._to, self._from]
        self._gather = (self._to[:, np.newaxis] == np.arange(len(network.responses))).astype(float)

    def initial_state(self, drive: ArrayLike = 0.0, phase_rad: ArrayLike = 0.0) -> PhaseState:
        """Returns copies at rest in their amplitude.

        Args:
            drive: Drive whose amplitudes they have, ``(n_networks,)`` or one number for a single copy.
            phase_rad: Phases, broadcast to ``(n_networks, n)``.
        """
        amplitude = self.network.amplitude(np.atleast_1d(drive))
        phase = np.array(np.broadcast_to(np.asarray(phase_rad, dtype=float), amplitude.shape))
        return PhaseState(phase, amplitude, np.zeros(amplitude.shape))

    def advance(self, state: PhaseState, drive: ArrayLike) -> PhaseState:
        """Returns the state one step on.

        Args:
            state: The state of all copies.
            drive: Drive of each copy during the step, ``(n_networks,)``, or one number for all.
        """
        drives = np.broadcast_to(np.asarray(drive, dtype=float), state.phase_rad.shape[:1])
        turn, target = 2.0 * np.pi * self.network.frequency_Hz(drives), self.network.amplitude(drives)
        a = AMPLITUDE_RATE_PER_S

        def rates(now: Array) -> Array:
            phase, amplitude, rate = now
            pull = np.sin(phase[:, self._from] - phase[:, self._to] - self._bias)
            turned = turn + (amplitude[:, self._from] * self._weight * pull) @ self._gather
            return np.stack([turned, rate, a * (0.25 * a * (target - amplitude) - rate)])

        here = np.stack([state.phase_rad, state.amplitude, state.amplitude_rate_per_s])
        first = rates(here)
        return PhaseState(*(here + 0.5 * self.timestep_s * (first + rates(here + self.timestep_s * first))))

    def output(self, state: PhaseState) -> Array:
        """Returns x = r (1 + cos theta), ``(n_networks, n)``."""
        return state.amplitude * (1.0 + np.cos(state.phase_rad))

"""A periodic orbit: the section where it begins, its steps, and what is found out about it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.flow import Switches
from annelid.errors import AnnelidError
from annelid.protocols import Array


class NoLimitCycle(AnnelidError):
    """No periodic orbit was found: the section was not met, or the orbit did not close."""


@dataclass(frozen=True, slots=True)
class Section:
    """The event that ends a cycle: a state rising through a threshold.

    Attributes:
        state: Index of the state.
        threshold: In its unit.
    """

    state: int
    threshold: float


@dataclass(frozen=True, slots=True)
class LimitCycle:
    """A periodic orbit, its linearisation and its phase response; arrays hold ``n_phases + 1`` instants of one cycle.

    Attributes:
        labels: Names of the states.
        period_s: Period, s.
        timestep_s: Step that it was computed with, s.
        section: Where the cycle begins and ends.
        closing_error: Largest distance between beginning and end in any state, as a share of its range.
        n_returns: Returns to the section (or Newton steps) that it took to close the orbit.
        time_s: Instants, s, from 0 to the period, ``(n_phases + 1,)``.
        state: Shape ``(n_phases + 1, n_states)``.
        switches: Switches in force there, ``(n_phases + 1, n_switches)``.
        switch_time_s: When a switch moves, s, ``(n_moves,)``.
        range: Peak to peak of every state over the cycle (1 for one that does not move), ``(n_states,)``.
        transitions: State-transition matrices from each instant to the next, ``(n_phases, n_states, n_states)``.
        monodromy: Their product, the state-transition matrix of a period, ``(n_states, n_states)``.
        multipliers: Floquet multipliers, its eigenvalues, by falling magnitude, ``(n_states,)``, complex.
        eigenvectors: Its right eigenvectors at the section in the same order, one a column, of norm 1 when every
            state is measured by its range, ``(n_states, n_states)``, complex.
        trivial: Index of the multiplier nearest to 1, whose eigenvector is along the orbit.
        phase_response: Infinitesimal phase response curves, ``(n_phases + 1, n_states)``: by how many seconds a
            cycle is advanced by a unit of perturbation of each state at each instant; where a state rests on a kink,
            the mean of what perturbations to either side do.
    """

    labels: tuple[str, ...]
    period_s: float
    timestep_s: float
    section: Section
    closing_error: float
    n_returns: int
    time_s: Array
    state: Array
    switches: Switches = field(repr=False)
    switch_time_s: Array = field(repr=False)
    range: Array = field(repr=False)
    transitions: Array = field(repr=False)
    monodromy: Array = field(repr=False)
    multipliers: NDArray[np.complex128]
    eigenvectors: NDArray[np.complex128] = field(repr=False)
    trivial: int
    phase_response: Array = field(repr=False)


@dataclass(slots=True)
class Orbit:
    """Every step of one cycle: instants (steps), states and switches there, and when switches moved."""

    timestep_s: float
    time: Array
    state: Array
    switches: Switches
    moved: NDArray[np.intp]

    @property
    def range(self) -> Array:
        """Peak to peak of every state, 1 for one that does not move."""
        range_ = np.ptp(self.state, axis=0)
        return np.where(range_ > 0.0, range_, 1.0)

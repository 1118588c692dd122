"""Shooting for a periodic orbit: the return map of a section, iterated or by Newton's method, until it closes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.floquet import arcs_of, decomposed, monodromy_of, state_transitions
from annelid.analysis.flow import Flow, Switches
from annelid.analysis.orbit import LimitCycle, NoLimitCycle, Orbit, Section
from annelid.analysis.phase_response import adjoint_phase_response
from annelid.analysis.poincare import crossing_times, first_return
from annelid.errors import ConfigError
from annelid.protocols import Array

_MOST_RETURNS, _MOST_NEWTON = 40, 12
# A closing error that shrinks by less than this factor a return calls for Newton's method.
_SLOW = 0.5


def find_limit_cycle(
    flow: Flow,
    state: Array,
    switches: Switches,
    section: Section,
    *,
    n_phases: int = 100,
    tolerance: float = 1e-9,
    perturbation: float = 1e-6,
    longest_s: float = 60.0,
    refine: bool = True,
) -> LimitCycle:
    """Finds the periodic orbit near a state, and linearises round it.

    The return map of the section is iterated until the orbit closes; where it contracts by less than a half a
    cycle, Newton's method on the return map takes over. The orbit is then cut into ``n_phases`` arcs. Every state is
    perturbed both ways at the beginning of every arc, and all ``2 n_states n_phases`` copies run through their arcs at
    once; the central differences are the arcs' state-transition matrices, whose product is the monodromy. The
    phase response is the left eigenvector of the trivial multiplier, carried round the orbit backwards by
    the transposed transition matrices (the adjoint method: Ermentrout & Terman 2010, ch. 8; Floquet multipliers and
    shooting: Seydel 2010, ch. 7).

    Args:
        flow: The system.
        state: Where to begin, in the orbit's basin, ``(1, n_states)``.
        switches: Switches as they were before, ``(1, n_switches)``.
        section: The event that ends a cycle.
        n_phases: Arcs, at least 1.
        tolerance: Closing error at which the orbit counts as closed, as a share of each state's range.
        perturbation: Size of a perturbation, as a share of the state's range.
        longest_s: Longest cycle to wait for, s.
        refine: Whether steps end where a switch moves; without, the derivative misses the saltations.

    Returns:
        The limit cycle.

    Raises:
        NoLimitCycle: The section is not met, or the orbit does not close.
        ConfigError: No arcs, or a perturbation or a tolerance that is not positive.
    """
    for name, value in (("n_phases", n_phases), ("tolerance", tolerance), ("perturbation", perturbation)):
        if not value > 0:
            raise ConfigError(f"{name} = {value:g} must be greater than 0")
    _, state, switches = crossing_times(flow, state, switches, section, longest_s, refine=refine)
    closing, n_returns, newton = np.inf, 0, 0
    while True:
        orbit = first_return(flow, state, switches, section, longest_s, refine)
        end, last = orbit.state[-1:], orbit.switches[-1:]
        n_returns += 1
        before, closing = closing, float((np.abs(end - state) / orbit.range).max())
        if closing <= tolerance:
            break
        if n_returns >= _MOST_RETURNS or newton >= _MOST_NEWTON:
            raise NoLimitCycle(
                f"the orbit does not close: after {n_returns} returns to the section its ends differ by {closing:.2g} "
                f"of a state's range, more than {tolerance:g}"
            )
        if refine and (newton or (n_returns > 3 and closing > _SLOW * before)):
            newton += 1
            transition = monodromy_of(state_transitions(flow, orbit, arcs_of(orbit, n_phases), perturbation, refine))
            along = flow.step(end, last)[0][0] - end[0]
            project = np.eye(state.size)
            project[:, section.state] -= along / along[section.state]
            correction = np.linalg.solve(np.eye(state.size) - project @ transition, (end - state)[0])
            end = state + correction
            end[:, section.state] = section.threshold
        state, switches = end, last
    arcs = arcs_of(orbit, n_phases)
    transitions = state_transitions(flow, orbit, arcs, perturbation, refine)
    return _linearised(flow, section, orbit, arcs, transitions, closing, n_returns)


def _linearised(
    flow: Flow,
    section: Section,
    orbit: Orbit,
    arcs: NDArray[np.intp],
    transitions: Array,
    closing: float,
    n_returns: int,
) -> LimitCycle:
    scale = orbit.range
    monodromy = monodromy_of(transitions)
    multipliers, eigenvectors, adjoint = decomposed(monodromy, scale)
    state, switches = orbit.state[arcs], orbit.switches[arcs]
    velocity = (flow.step(state, switches)[0] - state) / flow.timestep_s
    return LimitCycle(
        labels=flow.labels,
        period_s=float(orbit.time[-1] * orbit.timestep_s),
        timestep_s=flow.timestep_s,
        section=section,
        closing_error=closing,
        n_returns=n_returns,
        time_s=orbit.time[arcs] * orbit.timestep_s,
        state=state,
        switches=switches,
        switch_time_s=orbit.time[orbit.moved] * orbit.timestep_s,
        range=scale,
        transitions=transitions,
        monodromy=monodromy,
        multipliers=multipliers,
        eigenvectors=eigenvectors,
        trivial=int(np.argmin(np.abs(multipliers - 1.0))),
        phase_response=adjoint_phase_response(adjoint, transitions, velocity),
    )

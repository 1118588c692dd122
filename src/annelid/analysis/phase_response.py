"""Phase response: by how much a perturbation advances a cycle, by the adjoint method and by kicks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.flow import Flow
from annelid.analysis.orbit import LimitCycle
from annelid.analysis.poincare import crossing_times
from annelid.protocols import Array


def adjoint_phase_response(adjoint: Array, transitions: Array, velocity: Array) -> Array:
    """Carries the left eigenvector of the trivial multiplier round the orbit backwards.

    Args:
        adjoint: The eigenvector at the end of the cycle, ``(n_states,)``, of any length.
        transitions: State-transition matrices of the arcs, ``(n_arcs, n_states, n_states)``.
        velocity: Vector field at the ends of the arcs, ``(n_arcs + 1, n_states)``.

    Returns:
        Advance by a unit of perturbation of each state, s, ``(n_arcs + 1, n_states)``.
    """
    carried = [adjoint]
    for transition in transitions[::-1]:
        carried.append(transition.T @ carried[-1])
    response = np.array(carried[::-1])
    return response / (response * velocity).sum(axis=1, keepdims=True)


def kicked_phase_response(
    flow: Flow,
    cycle: LimitCycle,
    kicks: Array,
    phases: NDArray[np.intp],
    *,
    n_cycles: int = 3,
    longest_s: float = 60.0,
) -> Array:
    """Measures phase response directly: kicks the system at a phase, and sees when it next meets the section.

    Args:
        flow: The system of the cycle.
        cycle: Its limit cycle.
        kicks: What is added to the states at once, ``(n_kicks, n_states)``; any size.
        phases: Indices into the cycle's instants, ``(n_kicked,)``.
        n_cycles: Which meeting with the section to compare, from 1; by then the kick should have died away but for
            its phase.
        longest_s: Longest cycle to wait for, s.

    Returns:
        Advance of each phase by each kick, s, ``(n_kicked, n_kicks)``, within half a period of 0.

    Raises:
        NoLimitCycle: A kick has thrown the system off the cycle.
    """
    plain = np.zeros((1, kicks.shape[1]))
    state = (cycle.state[phases, np.newaxis] + np.concatenate([plain, kicks])).reshape(-1, kicks.shape[1])
    switches = cycle.switches[phases].repeat(len(kicks) + 1, axis=0)
    times, _, _ = crossing_times(flow, state, switches, cycle.section, n_cycles * longest_s, count=n_cycles)
    times = times.reshape(len(phases), -1)
    advance = times[:, :1] - times[:, 1:]
    return advance - cycle.period_s * np.round(advance / cycle.period_s)

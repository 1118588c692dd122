"""Floquet theory of a periodic orbit: state-transition matrices, monodromy and multipliers.

Steps of finite length are not a flow: their trivial multiplier is not 1, and kinks, at which the equations change piece
within a step, take it further away. `Continuous` and `Piecewise` of `annelid.analysis.flow` take care of both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.events import travel
from annelid.analysis.flow import Flow
from annelid.analysis.orbit import Orbit
from annelid.protocols import Array

# Copies that run at once, for the processor's cache.
_MOST_COPIES = 2048


def arcs_of(orbit: Orbit, n_phases: int) -> NDArray[np.intp]:
    """Indices of the steps between which the arcs lie: even in time, at whole steps, and none beside a switch."""
    last = len(orbit.time) - 1
    allowed = np.ones(last, dtype=bool)
    for offset in (-1, 0, 1):
        allowed[np.clip(orbit.moved + offset, 1, last - 1)] = False
    allowed[0] = True
    candidates = np.flatnonzero(allowed)
    wanted = orbit.time[-1] * np.arange(n_phases) / n_phases
    nearest = np.searchsorted(orbit.time[candidates], wanted)
    return np.append(np.unique(candidates[np.minimum(nearest, len(candidates) - 1)]), last)


def state_transitions(flow: Flow, orbit: Orbit, arcs: NDArray[np.intp], perturbation: float, refine: bool) -> Array:
    """State-transition matrices of the arcs by central differences, ``(n_arcs, n_states, n_states)``."""
    size = perturbation * orbit.range
    kicks = np.concatenate([np.diag(size), -np.diag(size)])
    duration_s = np.diff(orbit.time[arcs]) * orbit.timestep_s
    ends = np.empty((len(duration_s), *kicks.shape))
    at_once = max(1, _MOST_COPIES // len(kicks))
    for first in range(0, len(duration_s), at_once):
        some = slice(first, min(first + at_once, len(duration_s)))
        starts = orbit.state[arcs[:-1][some], np.newaxis] + kicks
        switches = orbit.switches[arcs[:-1][some]].repeat(len(kicks), axis=0)
        durations = duration_s[some].repeat(len(kicks))
        ends[some] = travel(flow, starts.reshape(-1, size.size), switches, durations, refine=refine).state.reshape(
            starts.shape
        )
    plus, minus = ends[:, : size.size], ends[:, size.size :]
    return ((plus - minus) / (2.0 * size[:, np.newaxis])).transpose(0, 2, 1)


def monodromy_of(transitions: Array) -> Array:
    """State-transition matrix of a whole period: the product of those of its arcs."""
    product = np.eye(transitions.shape[1])
    for transition in transitions:
        product = transition @ product
    return product


def decomposed(monodromy: Array, scale: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128], Array]:
    """Multipliers, right eigenvectors and the left eigenvector of the trivial multiplier.

    Args:
        monodromy: Shape ``(n_states, n_states)``.
        scale: By what every state is measured, ``(n_states,)``.

    Returns:
        Floquet multipliers by falling magnitude, ``(n_states,)``; right eigenvectors in the same order, one a column,
        of norm 1 in that measure; the left eigenvector of the multiplier nearest to 1, ``(n_states,)``, of any length.
    """
    scaled = monodromy * scale / scale[:, np.newaxis]
    multipliers, vectors = np.linalg.eig(scaled)
    order = np.argsort(-np.abs(multipliers), kind="stable")
    multipliers, vectors = multipliers[order].astype(complex), vectors[:, order].astype(complex)
    of_left, left = np.linalg.eig(scaled.T)
    adjoint = np.real(left[:, np.argmin(np.abs(of_left - 1.0))]) / scale
    return multipliers, (scale[:, np.newaxis] * vectors).astype(complex), adjoint

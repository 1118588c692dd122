"""Steps of a flow that end where an event happens: a switch that moves, or a duration that is over.

A step of a `Flow` is smooth as long as its switches, such as stretch sensors that are on or off, keep still. When one
moves within a step, the step is shortened to the instant of the switch, which bisection finds, and a new one begins
there: a shorter step of the method where time is continuous, the same share of the step where it is the plant's own.
So a perturbed copy switches earlier or later by what its perturbation says, and the finite differences
carry the jump of the vector field at the switch (the saltation matrix; Leine & Nijmeijer 2004, ch. 7) without its being
written down. With ``refine=False`` switches move at whole steps only, as in a plain run: then infinitesimal
perturbations never move them, and the derivative misses the saltations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.flow import Flow, Switches
from annelid.protocols import Array

# Halvings of a step that locate an event: to 1e-9 of the step.
_HALVINGS = 30


@dataclass(slots=True)
class Copies:
    """Copies on their way: state, switches in force, and where a whole step from here leads."""

    state: Array
    switches: Switches
    ahead: Array

    @classmethod
    def at(cls, flow: Flow, state: Array, before: Switches) -> Copies:
        """Copies about to take a step; ``before`` are their switches as they were."""
        ahead, switches = flow.step(state, before)
        return cls(state, switches, ahead)

    def __getitem__(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Copies:
        return Copies(self.state[rows], self.switches[rows], self.ahead[rows])

    def part(self, flow: Flow, share: Array) -> Array:
        """States after a share of the step."""
        return flow.part(self.state, self.switches, self.ahead, share)


def advance(flow: Flow, here: Copies, share: Array, refine: bool) -> tuple[Copies, Array]:
    """Takes a share of one step, or less, up to the first move of a switch; returns the share taken."""
    there = Copies.at(flow, here.part(flow, share), here.switches)
    moved = np.flatnonzero((there.switches != here.switches).any(axis=1) & (share > 0.0))
    if not (refine and moved.size):
        return there, share
    base = here[moved]

    def past(state: Array) -> NDArray[np.bool_]:
        return (flow.step(state, base.switches)[1] != base.switches).any(axis=1)

    share = share.copy()
    share[moved] = first_share(flow, base, share[moved], past)
    at_switch = Copies.at(flow, base.part(flow, share[moved]), base.switches)
    there.state[moved], there.switches[moved], there.ahead[moved] = (
        at_switch.state,
        at_switch.switches,
        at_switch.ahead,
    )
    return there, share


def first_share(flow: Flow, here: Copies, share: Array, past: Callable[[Array], NDArray[np.bool_]]) -> Array:
    """Bisects for the share of the step at which an event has just passed; it has by the share given."""
    low, high = np.zeros(len(share)), share
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        over = past(here.part(flow, middle))
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return high


def travel(flow: Flow, state: Array, before: Switches, duration_s: Array, *, refine: bool = True) -> Copies:
    """Lets copies run, each for a duration of its own.

    Args:
        flow: The system.
        state: Shape ``(n_copies, n_states)``.
        before: Switches as they were before, ``(n_copies, n_switches)``.
        duration_s: Shape ``(n_copies,)``, s.
        refine: Whether steps end where a switch moves.

    Returns:
        The copies at the end.
    """
    left = np.asarray(duration_s, dtype=float) / flow.timestep_s
    done = Copies.at(flow, state, before)
    rows, here = np.arange(len(left)), done
    while rows.size:
        # A remainder of 1e-9 steps is the rounding of sums of steps.
        share = np.where(np.abs(left[rows] - 1.0) < 1e-9, 1.0, np.minimum(left[rows], 1.0))
        here, taken = advance(flow, here, share, refine)
        left[rows] -= taken
        ended = left[rows] < 1e-9
        if ended.any():
            over = rows[ended]
            done.state[over], done.switches[over], done.ahead[over] = (
                here.state[ended],
                here.switches[ended],
                here.ahead[ended],
            )
            rows, here = rows[~ended], here[~ended]
    return done

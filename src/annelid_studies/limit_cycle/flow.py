"""Flows with switches: differential equations that change at once where a switch moves, and their linearisation.

Between two moves the equations are integrated by scipy, with the derivatives of the end by the start beside them. Where
a switch moves these jump by the saltation matrix (Leine & Nijmeijer 2004, ch. 7).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from annelid.protocols import Array

Switches = NDArray[np.bool_]

_TOLERANCE = 1e-11  # Error of a step, as a share of a state and of its scale
_OF_DERIVATIVES = 1e-8  # The same where the derivatives are taken along, whose rounding is larger
_PERTURBATION = 1e-7  # Of a state, as a share of its scale, for derivatives
# So that no switch moves twice within a step, and few steps run over a kink of a piecewise linear synapse.
_LONGEST_STEP_S = 0.005


class Flow(Protocol):
    """An autonomous system with continuous states and switches, evaluated for many states at once."""

    labels: tuple[str, ...]  # Names of the states
    scale: Array  # Size of each state, ``(n_states,)``

    def velocity(self, states: Array, on: Switches) -> Array:
        """Returns the derivatives by time, 1/s, ``(n, n_states)`` as the states, under switches ``(n_switches,)``."""
        ...

    def margins(self, states: Array, on: Switches) -> Array:
        """Returns how far each switch is from moving, ``(n, n_switches)``; it moves where this falls below 0."""
        ...


@dataclass(frozen=True, slots=True)
class Section:
    """The event that ends a cycle: a state rising through a threshold."""

    state: int  # Its index
    threshold: float  # In its unit


@dataclass(frozen=True, slots=True)
class Journey:
    """Where a flow leads.

    Attributes:
        state: The state at the end, ``(n_states,)``.
        on: The switches there, ``(n_switches,)``.
        duration_s: How long it took, s.
        met: Whether it ended on the section.
        transition: Derivatives of the end by the start, ``(n_states, n_states)``; the unit matrix if not asked for.
    """

    state: Array
    on: Switches
    duration_s: float
    met: bool
    transition: Array


def travel(
    flow: Flow,
    state: Array,
    on: Switches,
    duration_s: float,
    *,
    section: Section | None = None,
    linearised: bool = False,
) -> Journey:
    """Follows a flow for a time, or up to a section.

    Args:
        flow: The flow.
        state: Where it begins, ``(n_states,)``.
        on: The switches there, ``(n_switches,)``.
        duration_s: How long to follow it, s.
        section: Ends the journey where it is next met, at the latest after the time; on it at the start does not count.
        linearised: Whether to take the derivatives along.
    """
    n, kicks = state.size, np.diag(_PERTURBATION * flow.scale)

    def slopes(values: Array) -> Array:
        """Derivatives by the states, ``(n_values, n_states)``, of values at kicks forwards, then backwards."""
        return ((values[:n] - values[n:]) / (2.0 * kicks.diagonal()[:, np.newaxis])).T

    def rate(_: float, y: Array) -> Array:
        if not linearised:
            return flow.velocity(y[np.newaxis], on)[0]
        here = y[:n]
        velocity = flow.velocity(np.concatenate([[here], here + kicks, here - kicks]), on)
        return np.append(velocity[0], slopes(velocity[1:]) @ y[n:].reshape(n, n))

    def switching(_: float, y: Array) -> float:
        return float(flow.margins(y[np.newaxis, :n], on).min(initial=np.inf))

    def meeting(time_s: float, y: Array) -> float:
        assert section is not None
        return y[section.state] - section.threshold if time_s > 0.0 else 1.0

    events = [switching] if section is None else [switching, meeting]
    for event, direction in zip(events, (-1.0, 1.0), strict=False):
        event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
    y = np.append(state, np.eye(n)) if linearised else state
    scale = np.append(flow.scale, np.ones(n * n)) if linearised else flow.scale
    tolerance = _OF_DERIVATIVES if linearised else _TOLERANCE
    time_s, met = 0.0, False
    # Since it moved last, a switch may have passed its threshold by the rounding of a step.
    on = on ^ (flow.margins(state[np.newaxis], on)[0] < 0.0)
    while time_s < duration_s and not met:
        leg = solve_ivp(
            rate,
            (time_s, duration_s),
            y,
            method="DOP853",
            events=events,
            rtol=tolerance,
            atol=tolerance * scale,
            max_step=_LONGEST_STEP_S,
        )
        time_s, y = float(leg.t[-1]), leg.y[:, -1]
        met = section is not None and bool(leg.t_events[1].size)
        if leg.t_events[0].size:
            here = y[:n]
            margin = flow.margins(np.concatenate([[here], here + kicks, here - kicks]), on)
            moved = int(margin[0].argmin())
            before = flow.velocity(here[np.newaxis], on)[0]
            on = on ^ (np.arange(on.size) == moved)
            if linearised:
                jump = flow.velocity(here[np.newaxis], on)[0] - before
                normal = slopes(margin[1:])[moved]
                saltation = np.eye(n) + np.outer(jump, normal) / (normal @ before)
                y = np.append(here, saltation @ y[n:].reshape(n, n))
    transition = y[n:].reshape(n, n) if linearised else np.eye(n)
    return Journey(y[:n].copy(), on, time_s, met, transition)

"""Poincaré section: when and where a flow meets it, and the way from it back to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from annelid.analysis.events import Copies, advance, first_share
from annelid.analysis.flow import Flow, Switches
from annelid.analysis.orbit import NoLimitCycle, Orbit, Section
from annelid.errors import ConfigError, suggest
from annelid.protocols import Array


def section_at(flow: Flow, label: str, threshold: float) -> Section:
    """Finds a state by its name.

    Args:
        flow: The system.
        label: One of its labels.
        threshold: In the state's unit.

    Raises:
        ConfigError: No such state.
    """
    if label not in flow.labels:
        raise ConfigError(f"there is no state {label!r}: {suggest(label, flow.labels)}")
    return Section(flow.labels.index(label), threshold)


def crossing_times(
    flow: Flow,
    state: Array,
    before: Switches,
    section: Section,
    longest_s: float,
    *,
    count: int = 1,
    refine: bool = True,
) -> tuple[Array, Array, Switches]:
    """Lets copies run until they have met the section, interpolating the state linearly within the last step.

    Args:
        flow: The system.
        state: Shape ``(n_copies, n_states)``.
        before: Switches as they were before, ``(n_copies, n_switches)``.
        section: The event.
        longest_s: Simulated time after which to give up, s.
        count: Which of the events to stop at, from 1.
        refine: Whether steps end where a switch moves.

    Returns:
        Times, s, ``(n_copies,)``; states and switches there.

    Raises:
        NoLimitCycle: A copy has not met the section so often in that time.
    """
    start = Copies.at(flow, state, before)
    times, end, switches = np.zeros(len(state)), start.state.copy(), start.switches.copy()
    rows, here = np.arange(len(state)), start
    counts = np.zeros(len(state), dtype=int)
    while rows.size:
        _refuse_waiting(flow, section, count, float(times[rows].max()), longest_s)
        there, taken = advance(flow, here, np.ones(rows.size), refine)
        met = _meets(section, here, there)
        counts[rows] += met
        final = met & (counts[rows] == count)
        if final.any():
            stopped, taken[final] = _stop(flow, section, here[final], taken[final])
            end[rows[final]], switches[rows[final]] = stopped.state, stopped.switches
        times[rows] += taken * flow.timestep_s
        rows, here = rows[~final], there[~final]
    return times, end, switches


def first_return(flow: Flow, state: Array, before: Switches, section: Section, longest_s: float, refine: bool) -> Orbit:
    """One copy's way from the section back to it, step by step."""
    here = Copies.at(flow, state, before)
    time, states, switches, moved = [0.0], [here.state[0]], [here.switches[0]], []
    while True:
        there, taken = advance(flow, here, np.ones(1), refine)
        met = _meets(section, here, there)[0]
        if met:
            there, taken = _stop(flow, section, here, taken)
        elif (there.switches != here.switches).any():
            moved.append(len(time))
        here = there
        time.append(time[-1] + float(taken[0]))
        states.append(here.state[0])
        switches.append(here.switches[0])
        if met:
            break
        _refuse_waiting(flow, section, 1, time[-1] * flow.timestep_s, longest_s)
    return Orbit(flow.timestep_s, np.array(time), np.array(states), np.array(switches), np.array(moved, dtype=np.intp))


def _meets(section: Section, here: Copies, there: Copies) -> NDArray[np.bool_]:
    low, high = here.state[:, section.state], there.state[:, section.state]
    return (low < section.threshold) & (high >= section.threshold)


def _stop(flow: Flow, section: Section, here: Copies, share: Array) -> tuple[Copies, Array]:
    """Ends steps on the section, which they meet within the share given; returns the share taken."""
    share = first_share(flow, here, share, lambda state: state[:, section.state] >= section.threshold)
    state = here.part(flow, share)
    # On the section to the last bit, so that a copy that starts from here does not meet it at once.
    state[:, section.state] = section.threshold
    return Copies.at(flow, state, here.switches), share


def _refuse_waiting(flow: Flow, section: Section, count: int, time_s: float, longest_s: float) -> None:
    if time_s > longest_s:
        raise NoLimitCycle(
            f"{flow.labels[section.state]} does not rise through {section.threshold:g} "
            f"{'' if count == 1 else f'{count} times '}within {longest_s:g} s: "
            "choose another threshold or neuron, or a worm that oscillates"
        )

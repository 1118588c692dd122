"""Limit cycles of a worm under its nervous system: found by shooting, linearised, and kicked.

The return map of a section is iterated until the orbit closes; state-transition
matrices along it give the Floquet multipliers and the phase response (Seydel 2010, ch. 7; Ermentrout & Terman 2010,
ch. 8). Steps of finite length are not a flow: their trivial multiplier is not 1, and kinks within a step take it
further away; `Continuous` of `annelid_studies.limit_cycle.closed_loop` takes care of both.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from itertools import accumulate
from typing import cast

import numpy as np
from numpy.typing import NDArray

from annelid.config import RunConfig, load_config
from annelid.control import paper_controller
from annelid.errors import AnnelidError, ConfigError, suggest
from annelid.protocols import Array, Controller, Plant, Stateful
from annelid.simulation import build_controller, build_plant
from annelid_studies.limit_cycle.closed_loop import (
    ClosedLoop,
    Continuous,
    Copies,
    Flow,
    Switches,
    advance,
    first_share,
    travel,
)

# Step whose change is the vector field, and the step that the field is integrated with, s.
_FIELD_STEP_S = 1e-5
_CONTINUOUS_STEP_S = 1e-3
_MOST_RETURNS = 40
# Size of a perturbation, as a share of the state's range.
_PERTURBATION = 1e-6
# Copies that run at once, for the processor's cache.
_MOST_COPIES = 2048


class NoLimitCycle(AnnelidError):
    """No periodic orbit was found: the section was not met, or the orbit did not close."""


@dataclass(frozen=True, slots=True)
class Section:
    """The event that ends a cycle: a state rising through a threshold."""

    state: int  # its index
    threshold: float  # in its unit


@dataclass(frozen=True, slots=True)
class LimitCycle:
    """A periodic orbit, its linearisation and its phase response; arrays hold ``n_phases + 1`` instants of one cycle.

    Attributes:
        labels: Names of the states.
        period_s: Period, s.
        timestep_s: Step that it was computed with, s.
        closing_error: Largest distance between beginning and end in any state, as a share of its range.
        time_s: Instants, s, from 0 to the period, ``(n_phases + 1,)``.
        state: Shape ``(n_phases + 1, n_states)``.
        multipliers: Floquet multipliers, by falling magnitude, ``(n_states,)``, complex.
        trivial: Index of the multiplier nearest to 1, whose eigenvector is along the orbit.
        phase_response: Infinitesimal phase response curves, ``(n_phases + 1, n_states)``: by how many seconds a
            cycle is advanced by a unit of perturbation of each state there; on a kink, the mean of both sides.
    """

    labels: tuple[str, ...]
    period_s: float
    timestep_s: float
    closing_error: float
    time_s: Array
    state: Array
    multipliers: NDArray[np.complex128]
    trivial: int
    phase_response: Array = field(repr=False)


def limit_cycle(
    config: RunConfig,
    *,
    neuron: str = "contraction_1",
    threshold_mV: float | None = None,
    settle_s: float = 5.0,
    n_phases: int = 100,
) -> LimitCycle:
    """Finds the limit cycle of a configured worm under its nervous system, in continuous time (`Continuous`).

    Args:
        config: A configuration with a planar body and the synthetic nervous system, without sensor noise.
        neuron: The cycle begins when this neuron's potential rises through the threshold.
        threshold_mV: Relative to rest; default: half of the operating range R.
        settle_s: Simulated time before the search begins, s, longer than ``sensor.startup_hold_s``.
        n_phases: Arcs that the orbit is cut into.

    Raises:
        ConfigError: A controller without neurons, no such neuron, sensor noise, a loop that depends on time itself
            or has too many states (`ClosedLoop`).
        NoLimitCycle: The worm does not oscillate, or not periodically.
    """
    network = paper_controller(config.controller)
    if network is None:
        raise ConfigError(f"controller.kind = {config.controller.kind!r} has no neurons whose rise could begin a cycle")
    flow, state, switches = flow_of(config, settle_s)
    section = section_at(flow, neuron, 0.5 * network.range_mV if threshold_mV is None else threshold_mV)
    # The field's rounding, divided by its short step, leaves no more digits.
    return find_limit_cycle(flow, state, switches, section, n_phases=n_phases, tolerance=1e-7)


def flow_of(config: RunConfig, settle_s: float = 5.0) -> tuple[Continuous, Array, Switches]:
    """Builds the closed loop of a configuration and lets it run until its start is over.

    Arguments and errors are those of `limit_cycle`.

    Returns:
        The flow, its states ``(1, n_states)`` and its switches ``(1, n_switches)``.
    """
    if config.sensor.noise_m > 0.0:
        raise ConfigError(f"sensor.noise_m = {config.sensor.noise_m:g} m leaves no limit cycle: set sensor.noise_m=0")
    if not settle_s > config.sensor.startup_hold_s:
        raise ConfigError(
            f"settle_s = {settle_s:g} must be longer than sensor.startup_hold_s = {config.sensor.startup_hold_s:g}"
        )
    plant = build_plant(config)
    controller = build_controller(config, plant)
    settle(plant, controller, config.clock.control_timestep_s, settle_s)
    # The same loop in forward Euler steps so short that they are the vector field.
    tree = config.model_dump()
    tree["clock"] = {"control_timestep_s": _FIELD_STEP_S, "physics_timestep_s": _FIELD_STEP_S}
    tree["controller"]["scheme"] = "euler"
    # Time runs slower there, and must not come back into the hold.
    tree["sensor"]["startup_hold_s"] = 0.0
    tree["record"] = {"signals_interval_s": config.duration_s, "frames_interval_s": config.duration_s}
    short = load_config(tree)
    body = build_plant(short)
    nerves = build_controller(short, body)
    for new, old in ((body, plant), (nerves, controller)):
        cast(Stateful, new).set_state(cast(Stateful, old).get_state())
    loop = ClosedLoop(body, nerves, _FIELD_STEP_S)
    return Continuous(loop, _CONTINUOUS_STEP_S), *loop.present()


def settle(plant: Plant, controller: Controller, control_timestep_s: float, settle_s: float) -> None:
    """Lets a plant and a controller run from their reset.

    Raises:
        ConfigError: The loop depends on time itself, or cannot be linearised (`ClosedLoop`).
    """
    sensation = plant.reset(0)
    controller.reset(0)
    earlier = ClosedLoop(plant, controller, control_timestep_s)
    n_steps = max(2, round(settle_s / control_timestep_s))
    for step in range(n_steps):
        if step == n_steps // 2:
            earlier = ClosedLoop(plant, controller, control_timestep_s)
        sensation = plant.step(controller.step(sensation))
    loop = ClosedLoop(plant, controller, control_timestep_s)
    state, switches = loop.present()
    if not all(map(np.array_equal, loop.step(state, switches), earlier.step(state, switches))):
        raise ConfigError(
            f"{type(plant).__name__} under {type(controller).__name__} depends on time itself, not on its state alone: "
            "only an autonomous loop has a limit cycle of its own"
        )


def section_at(flow: Flow, label: str, threshold: float) -> Section:
    """Returns where the state of that label rises through a threshold, in its unit.

    Raises:
        ConfigError: No such state.
    """
    if label not in flow.labels:
        raise ConfigError(f"there is no state {label!r}: {suggest(label, flow.labels)}")
    return Section(flow.labels.index(label), threshold)


def find_limit_cycle(
    flow: Flow,
    state: Array,
    switches: Switches,
    section: Section,
    *,
    n_phases: int = 100,
    tolerance: float = 1e-9,
    longest_s: float = 60.0,
) -> LimitCycle:
    """Finds the periodic orbit near a state, and linearises round it.

    The return map of the section is iterated until the orbit closes. The orbit is then cut into ``n_phases`` arcs.
    Every state is perturbed both ways at the beginning of every arc; the central differences at the ends are the arcs'
    state-transition matrices, whose product is the monodromy. The phase response is the left eigenvector of the trivial
    multiplier, carried round the orbit backwards by the transposed transition matrices (the adjoint method).

    Args:
        flow: The system.
        state: Where to begin, in the orbit's basin, ``(1, n_states)``.
        switches: Switches as they were before, ``(1, n_switches)``.
        section: The event that ends a cycle.
        n_phases: Arcs, at least 1.
        tolerance: Closing error at which the orbit counts as closed, as a share of each state's range.
        longest_s: Longest cycle to wait for, s.

    Raises:
        NoLimitCycle: The section is not met, or the orbit does not close.
    """
    orbit = _first_return(flow, state, switches, section, longest_s)
    state, switches = orbit.state[-1:], orbit.switches[-1:]
    closing = np.inf
    for _ in range(_MOST_RETURNS):
        orbit = _first_return(flow, state, switches, section, longest_s)
        closing = float((np.abs(orbit.state[-1] - state[0]) / orbit.range).max())
        state, switches = orbit.state[-1:], orbit.switches[-1:]
        if closing <= tolerance:
            break
    else:
        raise NoLimitCycle(
            f"the orbit does not close: after {_MOST_RETURNS} returns to the section its ends differ by {closing:.2g} "
            f"of a state's range, more than {tolerance:g}"
        )
    arcs = _arcs(orbit, n_phases)
    transitions = _transitions(flow, orbit, arcs)
    multipliers, adjoint = _decomposed(_product(transitions), orbit.range)
    state, switches = orbit.state[arcs], orbit.switches[arcs]
    velocity = (flow.step(state, switches)[0] - state) / flow.timestep_s
    carried = accumulate(transitions[::-1], lambda later, transition: transition.T @ later, initial=adjoint)
    response = np.array([*carried][::-1])
    return LimitCycle(
        labels=flow.labels,
        period_s=float(orbit.time[-1] * flow.timestep_s),
        timestep_s=flow.timestep_s,
        closing_error=closing,
        time_s=orbit.time[arcs] * flow.timestep_s,
        state=state,
        multipliers=multipliers,
        trivial=int(np.argmin(np.abs(multipliers - 1.0))),
        phase_response=response / (response * velocity).sum(axis=1, keepdims=True),
    )


@dataclass(slots=True)
class _Orbit:
    """Every step of one cycle: instants (in steps), states and switches there, and when switches moved."""

    time: Array
    state: Array
    switches: Switches
    moved: NDArray[np.intp]

    @property
    def range(self) -> Array:
        """Peak to peak of every state, 1 for one that does not move."""
        range_ = np.ptp(self.state, axis=0)
        return np.where(range_ > 0.0, range_, 1.0)


def _first_return(flow: Flow, state: Array, before: Switches, section: Section, longest_s: float) -> _Orbit:
    """Lets one copy run, step by step, until it next meets the section, on which its last step ends.

    Raises:
        NoLimitCycle: It does not in ``longest_s``.
    """
    here = Copies.at(flow, state, before)
    time, states, switches, moved = [0.0], [here.state[0]], [here.switches[0]], []
    reached = False
    while not reached:
        if time[-1] * flow.timestep_s > longest_s:
            raise NoLimitCycle(
                f"{flow.labels[section.state]} does not rise through {section.threshold:g} within {longest_s:g} s: "
                "choose another threshold or neuron, or a worm that oscillates"
            )
        there, taken = advance(flow, here, np.ones(1))
        reached = bool(here.state[0, section.state] < section.threshold <= there.state[0, section.state])
        if reached:
            there, taken = _stop(flow, section, here, taken)
        elif (there.switches != here.switches).any():
            moved.append(len(time))
        time.append(time[-1] + float(taken[0]))
        states.append(there.state[0])
        switches.append(there.switches[0])
        here = there
    return _Orbit(np.array(time), np.array(states), np.array(switches), np.array(moved, dtype=np.intp))


def _stop(flow: Flow, section: Section, here: Copies, share: Array) -> tuple[Copies, Array]:
    """Ends steps on the section, which they meet within the share given; returns the share taken."""
    share = first_share(flow, here, share, lambda state: state[:, section.state] >= section.threshold)
    state = here.part(flow, share)
    # On the section to the last bit, so that a copy that starts from here does not meet it at once.
    state[:, section.state] = section.threshold
    return Copies.at(flow, state, here.switches), share


def _arcs(orbit: _Orbit, n_phases: int) -> NDArray[np.intp]:
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


def _transitions(flow: Flow, orbit: _Orbit, arcs: NDArray[np.intp]) -> Array:
    """State-transition matrices of the arcs by central differences, ``(n_arcs, n_states, n_states)``."""
    size = _PERTURBATION * orbit.range
    kicks = np.concatenate([np.diag(size), -np.diag(size)])
    duration_s = np.diff(orbit.time[arcs]) * flow.timestep_s
    ends = np.empty((len(duration_s), *kicks.shape))
    at_once = max(1, _MOST_COPIES // len(kicks))
    for first in range(0, len(duration_s), at_once):
        some = slice(first, first + at_once)
        starts = orbit.state[arcs[:-1][some], np.newaxis] + kicks
        switches = orbit.switches[arcs[:-1][some]].repeat(len(kicks), axis=0)
        durations = duration_s[some].repeat(len(kicks))
        end = travel(flow, starts.reshape(-1, size.size), switches, durations)
        ends[some] = end.state.reshape(starts.shape)
    plus, minus = ends[:, : size.size], ends[:, size.size :]
    return ((plus - minus) / (2.0 * size[:, np.newaxis])).transpose(0, 2, 1)


def _product(transitions: Array) -> Array:
    """State-transition matrix of a whole period: the product of those of its arcs."""
    return reduce(lambda product, transition: transition @ product, transitions, np.eye(transitions.shape[1]))


def _decomposed(monodromy: Array, scale: Array) -> tuple[NDArray[np.complex128], Array]:
    """Multipliers, by falling magnitude, and the left eigenvector of the trivial one."""
    scaled = monodromy * scale / scale[:, np.newaxis]
    multipliers, left = np.linalg.eig(scaled.T)
    adjoint = np.real(left[:, np.argmin(np.abs(multipliers - 1.0))]) / scale
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")].astype(complex), adjoint

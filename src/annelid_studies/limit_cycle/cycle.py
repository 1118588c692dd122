"""Limit cycles of a worm under its nervous system: found by shooting, linearised, and kicked.

The return map of a section is iterated until the orbit closes; state-transition matrices along it give the Floquet
multipliers and the phase response (Seydel 2010, ch. 7; Ermentrout & Terman 2010, ch. 8).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from annelid.config import RunConfig
from annelid.control import CircuitController, paper_controller
from annelid.errors import AnnelidError, ConfigError, suggest
from annelid.nervous import NetworkState, Stepper
from annelid.protocols import Array
from annelid.simulation import build_controller, build_plant
from annelid_studies.limit_cycle.flow import Flow, Section, Switches, travel
from annelid_studies.planar.riddle2022 import Riddle2022Plant

MOST_STATES = 400
"""More states than this are refused: the derivatives of all by all would take too long."""
_MOST_RETURNS = 40
_CLOSED = 1e-7  # Closing error at which an orbit counts as closed, as a share of each state's size
_LONGEST_CYCLE_S = 60.0
_MS_PER_S = 1e3


class NoLimitCycle(AnnelidError):
    """No periodic orbit was found: the section was not met, or the orbit did not close."""


@dataclass(frozen=True, slots=True)
class LimitCycle:
    """A periodic orbit, its linearisation and its phase response; arrays hold ``n_phases + 1`` instants of one cycle.

    Attributes:
        labels: Names of the states.
        period_s: Period, s.
        closing_error: Largest distance between beginning and end in any state, as a share of its size.
        time_s: Instants, s, from 0 to the period, ``(n_phases + 1,)``.
        state: Shape ``(n_phases + 1, n_states)``.
        multipliers: Floquet multipliers, by falling magnitude, ``(n_states,)``, complex.
        trivial: Index of the multiplier nearest to 1, whose eigenvector is along the orbit.
        phase_response: Infinitesimal phase response curves, ``(n_phases + 1, n_states)``: by how many seconds a
            cycle is advanced by a unit of perturbation of each state there.
    """

    labels: tuple[str, ...]
    period_s: float
    closing_error: float
    time_s: Array
    state: Array
    multipliers: NDArray[np.complex128]
    trivial: int
    phase_response: Array = field(repr=False)


class WormFlow:
    """The planar worm of Riddle 2022 under the paper's nervous system, as a `Flow`.

    States are the heights of the rhombi, m, the potentials, mV, and the slow gates; switches are the stretch sensors.
    """

    def __init__(self, plant: Riddle2022Plant, controller: CircuitController) -> None:
        """Takes body and controller, which both are left as they are."""
        self._plant, self._controller, table = plant, controller, controller.table
        gates, heights = (range(part.size) for part in (controller.network_state.gate, plant.sense().ring_length_m))
        names = [f"height[{i}]" for i in heights], list(controller.network.neurons), [f"gate[{i}]" for i in gates]
        self.labels = tuple(name for part in names for name in part)
        if len(self.labels) > MOST_STATES:
            raise ConfigError(
                f"a worm of {plant.n_segments} segments has {len(self.labels)} continuous states; its limit cycle is "
                f"found for at most {MOST_STATES}: choose fewer segments"
            )
        sizes = [len(part) for part in names]
        self._ends = np.cumsum(sizes[:-1])
        self.scale = np.repeat([plant.sense().ring_length_m.max(), controller.circuit.range_mV, 1.0], sizes)
        # The rows behind the linear ones are the sensors; the kick of the start is over.
        self._input = table.input[table.n_linear :]
        self._current_nA, self._limit_m = (values[table.n_linear :] for values in (table.gain, table.threshold))
        self._networks: dict[int, Stepper] = {}

    def present(self) -> tuple[Array, Switches]:
        """Returns the state of body and controller, ``(n_states,)``, and the switches, ``(n_segments,)``."""
        state, on = self._controller.network_state, self._controller.get_state()["sensor_on"]
        height_m = self._plant.sense().ring_length_m
        return np.concatenate([height_m, state.potential.ravel(), state.gate.ravel()]), on.astype(bool)

    def velocity(self, states: Array, on: Switches) -> Array:
        """Returns the derivatives, as `Flow.velocity`."""
        height_m, potential, gate = np.split(states, self._ends, axis=1)
        n = len(states)
        gate = gate.reshape(n, *self._controller.network_state.gate.shape[1:])
        if n not in self._networks:
            self._networks[n] = self._controller.network.compile(1.0, "euler", n)
        inputs_nA = np.zeros(self._controller.table.n_inputs)
        inputs_nA[self._input] = self._current_nA * on
        # An Euler step of 1 ms is the derivative, times 1 ms.
        after = NetworkState(potential.copy(), gate.copy())
        self._networks[n].advance(after, inputs_nA)
        rates = self._plant.height_rate_m_per_s(height_m, self._controller.activation(potential))
        grown = (after.gate - gate).reshape(n, -1)
        return np.concatenate([rates, _MS_PER_S * (after.potential - potential), _MS_PER_S * grown], axis=1)

    def margins(self, states: Array, on: Switches) -> Array:
        """Returns how far the length of each segment is from where its sensor moves, m, as `Flow.margins`."""
        longer_m = self._plant.lengthening_m(states[:, : self._plant.n_segments])
        return np.where(on, self._limit_m + self._controller.table.hysteresis - longer_m, longer_m - self._limit_m)


def limit_cycle(
    config: RunConfig,
    *,
    neuron: str = "contraction_1",
    threshold_mV: float | None = None,
    settle_s: float = 5.0,
    n_phases: int = 100,
) -> LimitCycle:
    """Finds the limit cycle of a configured worm under its nervous system, in continuous time.

    Args:
        config: A configuration with the body riddle2022 and the paper's controller, without sensor noise.
        neuron: The cycle begins when this neuron's potential rises through the threshold.
        threshold_mV: Relative to rest; default: half of the operating range R.
        settle_s: Simulated time before the search begins, s, longer than ``sensor.startup_hold_s``.
        n_phases: Arcs that the orbit is cut into.

    Raises:
        ConfigError: Another body or controller, no such neuron, sensor noise, or too many segments.
        NoLimitCycle: The worm does not oscillate, or not periodically.
    """
    if config.sensor.noise_m > 0.0:
        raise ConfigError(f"sensor.noise_m = {config.sensor.noise_m:g} m leaves no limit cycle: set sensor.noise_m=0")
    if not settle_s > config.sensor.startup_hold_s:
        raise ConfigError(
            f"settle_s = {settle_s:g} must be longer than sensor.startup_hold_s = {config.sensor.startup_hold_s:g}"
        )
    plant = build_plant(config)
    controller = build_controller(config, plant)
    network = paper_controller(config.controller)
    if network is None or not (isinstance(plant, Riddle2022Plant) and isinstance(controller, CircuitController)):
        raise ConfigError(
            f"body.kind = {config.body.kind!r} under controller.kind = {config.controller.kind!r} has no limit cycle "
            "that this study finds: choose the body riddle2022 and the controller sns, without a trial"
        )
    sensation = plant.reset(0)
    controller.reset(0)
    for _ in range(round(settle_s / config.clock.control_timestep_s)):
        sensation = plant.step(controller.step(sensation))
    flow = WormFlow(plant, controller)
    section = section_at(flow, neuron, 0.5 * network.range_mV if threshold_mV is None else threshold_mV)
    return find_limit_cycle(flow, *flow.present(), section, n_phases=n_phases)


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
    on: Switches,
    section: Section,
    *,
    n_phases: int = 100,
    longest_s: float = _LONGEST_CYCLE_S,
) -> LimitCycle:
    """Finds the periodic orbit near a state, and linearises round it.

    The return map of the section is iterated until the orbit closes. The product of the state-transition matrices of
    ``n_phases`` arcs is the monodromy. The phase response is the left eigenvector of the trivial multiplier, carried
    round the orbit backwards by the transposed transition matrices (the adjoint method).

    Args:
        flow: The system.
        state: Where to begin, in the orbit's basin, ``(n_states,)``.
        on: The switches there, ``(n_switches,)``.
        section: The event that ends a cycle.
        n_phases: Arcs of equal duration, at least 1.
        longest_s: Longest cycle to wait for, s.

    Raises:
        NoLimitCycle: The section is not met, or the orbit does not close.
    """
    closing = np.inf
    for returns in range(_MOST_RETURNS):
        orbit = travel(flow, state, on, longest_s, section=section)
        if not orbit.met:
            raise NoLimitCycle(
                f"{flow.labels[section.state]} does not rise through {section.threshold:g} within {longest_s:g} s: "
                "choose another threshold or neuron, or a worm that oscillates"
            )
        closing = float((np.abs(orbit.state - state) / flow.scale).max()) if returns else np.inf
        state, on = orbit.state, orbit.on
        if closing <= _CLOSED:
            break
    else:
        raise NoLimitCycle(
            f"the orbit does not close: after {_MOST_RETURNS} returns to the section its ends differ by {closing:.2g} "
            f"of a state's size, more than {_CLOSED:g}"
        )
    states, velocities, transitions = [state], [flow.velocity(state[np.newaxis], on)[0]], []
    for _ in range(n_phases):
        arc = travel(flow, states[-1], on, orbit.duration_s / n_phases, linearised=True)
        on = arc.on
        states.append(arc.state)
        velocities.append(flow.velocity(arc.state[np.newaxis], on)[0])
        transitions.append(arc.transition)
    monodromy = reduce(lambda product, transition: transition @ product, transitions)
    multipliers, adjoint = _decomposed(monodromy, flow.scale)
    carried = accumulate(transitions[::-1], lambda later, transition: transition.T @ later, initial=adjoint)
    response = np.array([*carried][::-1])
    return LimitCycle(
        labels=flow.labels,
        period_s=orbit.duration_s,
        closing_error=closing,
        time_s=np.linspace(0.0, orbit.duration_s, n_phases + 1),
        state=np.array(states),
        multipliers=multipliers,
        trivial=int(np.argmin(np.abs(multipliers - 1.0))),
        phase_response=response / (response * velocities).sum(axis=1, keepdims=True),
    )


def _decomposed(monodromy: Array, scale: Array) -> tuple[NDArray[np.complex128], Array]:
    """Multipliers, by falling magnitude, and the left eigenvector of the trivial one."""
    scaled = monodromy * scale / scale[:, np.newaxis]
    multipliers, left = np.linalg.eig(scaled.T)
    adjoint = np.real(left[:, np.argmin(np.abs(multipliers - 1.0))]) / scale
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")].astype(complex), adjoint

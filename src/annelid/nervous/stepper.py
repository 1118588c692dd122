"""The batched stepper: one time step of many copies of a network, in a few numpy calls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from annelid.errors import ConfigError, suggest
from annelid.nervous.arrays import NetworkArrays
from annelid.nervous.neurons import Array

Scheme = Literal["euler", "toolbox", "heun"]
GateStart = Literal["steady", "toolbox"]


@dataclass(slots=True)
class NetworkState:
    """All that the next step depends on.

    Attributes:
        potential: Membrane potentials, mV, shape ``(n_worms, n_neurons)``.
        gate: Slow gates, shape ``(n_worms, n_slow, n_channels)``; a slot that a channel does not use stays
            constant.
    """

    potential: Array
    gate: Array

    def copy(self) -> NetworkState:
        """Returns an independent copy."""
        return NetworkState(self.potential.copy(), self.gate.copy())


class Stepper:
    """Advances ``n_worms`` copies of a compiled network by a fixed step.

    With ``y = sqrt(factor exp(slope (midpoint - U)))`` a gate's steady state is ``1 / (1 + y^2)`` and its rate
    ``(1/y - z (y + 1/y)) / time_constant_ms``, which needs one exponential a gate.

    Two steppers that run at once need not share anything but their arrays; one stepper keeps scratch buffers
    and must not be used from two threads.

    Attributes:
        arrays: The network's parameters.
        timestep_ms: Step, ms.
        scheme: Integration scheme.
        n_worms: Number of copies.

    Raises:
        ConfigError: An unknown scheme, or a step or number of copies that is not positive.
    """

    def __init__(self, arrays: NetworkArrays, timestep_ms: float, scheme: Scheme = "euler", n_worms: int = 1) -> None:
        if scheme not in get_args(Scheme):
            raise ConfigError(f"unknown scheme {scheme!r}: {suggest(scheme, get_args(Scheme))}")
        if not timestep_ms > 0:
            raise ConfigError(f"timestep_ms must be positive, not {timestep_ms}")
        if n_worms < 1:
            raise ConfigError(f"n_worms must be at least 1, not {n_worms}")
        self.arrays = arrays
        self.timestep_ms = float(timestep_ms)
        self.scheme: Scheme = scheme
        self.n_worms = n_worms
        self._prepare_parameters()
        self._prepare_buffers()

    def _prepare_parameters(self) -> None:
        a, dt = self.arrays, self.timestep_ms
        n_channels, n_slow = a.channel_neuron.size, a.n_slow
        shape = (len(a.gates), n_channels)
        gates = [gate for slot in a.gates for gate in slot]
        with np.errstate(divide="ignore"):
            log_factor = np.log([gate.factor for gate in gates])
        slope = np.array([gate.slope_per_mV for gate in gates])
        midpoint = np.array([gate.midpoint_mV for gate in gates])
        power = np.array([gate.power for gate in gates]).reshape(shape)
        taus = [gate.time_constant_ms for slot in a.gates[:n_slow] for gate in slot]
        self._exponent_offset = (0.5 * (log_factor + slope * midpoint)).reshape(shape)
        self._exponent_slope = (-0.5 * slope).reshape(shape)
        self._power = None if (power == 1.0).all() else power
        self._gate_rate = np.array([0.0 if tau is None else dt / tau for tau in taus]).reshape(n_slow, n_channels)
        self._membrane_rate = dt / a.capacitance_nF
        self._weights = a.weights
        n = len(a.neurons)
        one_each = np.array_equal(a.terminal_neuron, np.arange(n))
        self._terminal_neuron = None if one_each else a.terminal_neuron
        self._terminal_slope = a.terminal_slope_per_mV
        self._terminal_offset = -a.terminal_threshold_mV * a.terminal_slope_per_mV

    def _prepare_buffers(self) -> None:
        a, w, n = self.arrays, self.n_worms, len(self.arrays.neurons)
        n_channels, n_slow, n_slots = a.channel_neuron.size, a.n_slow, len(a.gates)
        where = a.drive_slices()
        drive = np.zeros((w, a.weights.shape[0]))
        self._drive = drive
        self._open = drive[:, where["terminals"]]
        self._channel_open = drive[:, where["channels"]]
        self._rectified = drive[:, where["rectified"]]
        self._potentials = drive[:, where["potentials"]]
        drive[:, where["one"]] = 1.0
        self._inputs = drive[:, where["inputs"]]
        self._total = np.empty((w, 2 * n))
        self._conductance, self._current = self._total[:, :n], self._total[:, n:]
        self._channel_potential = np.empty((w, n_channels))
        self._channel_potential_by_slot = self._channel_potential[:, np.newaxis, :]
        self._y = np.empty((w, n_slots, n_channels))
        self._y_slow, self._y_instant = self._y[:, :n_slow], self._y[:, n_slow:]
        self._z = np.empty((w, n_slots, n_channels))
        self._z_slow, self._z_instant = self._z[:, :n_slow], self._z[:, n_slow:]
        self._gate_steps = (np.empty((w, n_slow, n_channels)), np.empty((w, n_slow, n_channels)))
        self._gate_scratch = np.empty((w, n_slow, n_channels))
        self._potential_steps = (np.empty((w, n)), np.empty((w, n)))
        self._middle = NetworkState(np.empty((w, n)), np.empty((w, n_slow, n_channels)))

    def initial_state(self, gate_start: GateStart = "steady") -> NetworkState:
        """Returns the state at the start.

        Args:
            gate_start: ``"steady"``: slow gates at their steady state at the initial potential;
                ``"toolbox"``: as SNS-Toolbox 1.5.2 starts them, with the slope's sign the other way round.

        Raises:
            ConfigError: An unknown start.
        """
        if gate_start not in get_args(GateStart):
            raise ConfigError(f"unknown gate start {gate_start!r}: {suggest(gate_start, get_args(GateStart))}")
        a = self.arrays
        gate = np.empty((a.n_slow, a.channel_neuron.size))
        for slot, row in enumerate(a.gates[: a.n_slow]):
            for column, (one, neuron) in enumerate(zip(row, a.channel_neuron, strict=True)):
                potential = a.initial_mV[neuron]
                gate[slot, column] = one.steady(potential) if gate_start == "steady" else one.toolbox_start(potential)
        return NetworkState(np.tile(a.initial_mV, (self.n_worms, 1)), np.tile(gate, (self.n_worms, 1, 1)))

    def advance(self, state: NetworkState, inputs_nA: Array | None = None) -> None:
        """Advances a state by one step, in place.

        Args:
            state: The state of all copies.
            inputs_nA: Input currents during the step, shape ``(n_worms, n_inputs)`` or ``(n_inputs,)`` for all
                copies alike; None for no current.
        """
        self._inputs[...] = 0.0 if inputs_nA is None else inputs_nA
        potential, gate = state.potential, state.gate
        gate_step, potential_step = self._gate_steps[0], self._potential_steps[0]
        if self.scheme == "toolbox":
            self._step_gates(potential, gate, gate_step)
            gate += gate_step
            self._step_potentials(potential, gate, potential_step)
            potential += potential_step
            return
        self._step_gates(potential, gate, gate_step)
        self._step_potentials(potential, gate, potential_step)
        if self.scheme == "heun":
            middle = self._middle
            np.add(potential, potential_step, out=middle.potential)
            np.add(gate, gate_step, out=middle.gate)
            self._step_gates(middle.potential, middle.gate, self._gate_steps[1])
            self._step_potentials(middle.potential, middle.gate, self._potential_steps[1])
            for step, end in ((gate_step, self._gate_steps[1]), (potential_step, self._potential_steps[1])):
                step += end
                step *= 0.5
        gate += gate_step
        potential += potential_step

    def outputs(self, state: NetworkState) -> Array:
        """Returns the potentials that the outputs read, mV, shape ``(n_worms, n_outputs)``."""
        return state.potential[:, self.arrays.output_neuron]

    def run(self, inputs_nA: Array, state: NetworkState | None = None) -> Array:
        """Advances through a whole record of inputs.

        Args:
            inputs_nA: Shape ``(n_steps, n_inputs)`` or ``(n_steps, n_worms, n_inputs)``.
            state: Where to begin, advanced in place; default: `initial_state`.

        Returns:
            Potentials before the first and after every step, mV, ``(n_steps + 1, n_worms, n_neurons)``.
        """
        state = self.initial_state() if state is None else state
        trace = np.empty((len(inputs_nA) + 1, *state.potential.shape))
        trace[0] = state.potential
        for i, inputs in enumerate(inputs_nA):
            self.advance(state, inputs)
            trace[i + 1] = state.potential
        return trace

    def _step_gates(self, potential: Array, gate: Array, step: Array) -> None:
        """Writes the slow gates' Euler step, and leaves the exponentials at this potential for the channels."""
        if not self._channel_potential.size:
            return
        np.take(potential, self.arrays.channel_neuron, axis=1, out=self._channel_potential, mode="clip")
        y, y_slow, scratch = self._y, self._y_slow, self._gate_scratch
        np.multiply(self._channel_potential_by_slot, self._exponent_slope, out=y)
        y += self._exponent_offset
        np.exp(y, out=y)
        np.divide(self._gate_rate, y_slow, out=step)
        np.multiply(self._gate_rate, y_slow, out=scratch)
        scratch += step
        scratch *= gate
        step -= scratch

    def _step_potentials(self, potential: Array, gate: Array, step: Array) -> None:
        """Writes the potentials' Euler step; `_step_gates` has been called at the same potential."""
        if self._open.size:
            if self._terminal_neuron is None:
                np.multiply(potential, self._terminal_slope, out=self._open)
            else:
                np.take(potential, self._terminal_neuron, axis=1, out=self._open, mode="clip")
                self._open *= self._terminal_slope
            self._open += self._terminal_offset
            np.maximum(self._open, 0.0, out=self._open)
            np.minimum(self._open, 1.0, out=self._open)
        if self._channel_open.size:
            np.multiply(self._y_instant, self._y_instant, out=self._z_instant)
            self._z_instant += 1.0
            np.reciprocal(self._z_instant, out=self._z_instant)
            self._z_slow[...] = gate
            if self._power is not None:
                np.power(self._z, self._power, out=self._z)
            np.multiply.reduce(self._z, axis=1, out=self._channel_open)
        if self._rectified.size:
            source, target = self.arrays.rectified_source, self.arrays.rectified_target
            np.subtract(potential[:, source], potential[:, target], out=self._rectified)
            np.maximum(self._rectified, 0.0, out=self._rectified)
        if self._potentials.size:
            self._potentials[...] = potential
        np.matmul(self._drive, self._weights, out=self._total)
        np.multiply(self._conductance, potential, out=step)
        np.subtract(self._current, step, out=step)
        step *= self._membrane_rate

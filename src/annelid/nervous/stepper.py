"""The stepper: one time step of many copies of a network, in a few numpy calls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from annelid.errors import ConfigError, require_at_least, require_positive, suggest
from annelid.nervous.arrays import NetworkArrays
from annelid.nervous.neurons import Array

Scheme = Literal["euler", "toolbox", "heun"]
GateStart = Literal["steady", "toolbox"]

# As arrays, numpy need not convert them at every call.
_ZERO, _ONE = np.array(0.0), np.array(1.0)


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
    ``(1 - z (1 + y^2)) / (y time_constant_ms)``, which needs one exponential per gate. The exponents of the gates and
    the open fractions of the terminals are one affine map of the potentials; ``dt / C`` is part of the weights.

    Every copy gets the same bits whatever their number: the product with the weights is taken copy by copy, since a
    matrix product of all copies sums in another order. A stepper has scratch buffers and must not be used from two
    threads; two steppers share nothing but their arrays.

    Attributes:
        arrays: The network's parameters.
        timestep_ms: Step, ms.
        scheme: Integration scheme.
        n_worms: Number of copies.
        affine_slope: Factors of the potentials in what the terminals of all copies, then the gates, look at,
            ``(n_worms n_terminals + n_slots n_worms n_channels,)``.
        affine_offset: What is added to the products, same shape.
        gate_rate: Step over time constant of the slow gates, 0 in slots that are not used,
            ``(n_slow, n_worms, n_channels)``.
        weights: Those of the arrays, times the step over the capacitance of each neuron.

    Raises:
        ConfigError: An unknown scheme, or a step or number of copies that is not positive.
    """

    def __init__(self, arrays: NetworkArrays, timestep_ms: float, scheme: Scheme = "euler", n_worms: int = 1) -> None:
        if scheme not in get_args(Scheme):
            raise ConfigError(f"unknown scheme {scheme!r}: {suggest(scheme, get_args(Scheme))}")
        require_positive(timestep_ms=timestep_ms)
        require_at_least(1, n_worms=n_worms)
        self.arrays = arrays
        self.timestep_ms = float(timestep_ms)
        self.scheme: Scheme = scheme
        self.n_worms = n_worms

        a, dt, w = arrays, self.timestep_ms, n_worms
        n_channels, n_terminals = a.channel_neuron.size, a.terminal_neuron.size
        gates = [gate for slot in a.gates for gate in slot]
        with np.errstate(divide="ignore"):
            log_factor = np.log([gate.factor for gate in gates])
        slope = np.array([gate.slope_per_mV for gate in gates])
        midpoint = np.array([gate.midpoint_mV for gate in gates])
        power = np.array([gate.power for gate in gates])
        taus = [gate.time_constant_ms for slot in a.gates[: a.n_slow] for gate in slot]

        def by_slot(values: Array, n_slots: int) -> Array:
            """A row of channels for every slot and copy."""
            return np.repeat(values.reshape(n_slots, 1, n_channels), w, axis=1)

        def in_row(of_terminals: Array, of_gates: Array) -> Array:
            """Terminals of all copies, then gates of all copies, so that one call serves both."""
            return np.concatenate([np.tile(of_terminals, w), by_slot(of_gates, len(a.gates)).ravel()])

        terminal_slope = a.terminal_slope_per_mV
        self.affine_slope = in_row(terminal_slope, -0.5 * slope)
        self.affine_offset = in_row(-a.terminal_threshold_mV * terminal_slope, 0.5 * (log_factor + slope * midpoint))
        first = len(a.neurons) * np.arange(w)[:, np.newaxis]
        bearers = (first + a.channel_neuron).ravel()
        self._looked_at = np.concatenate([(first + a.terminal_neuron).ravel(), *[bearers] * len(a.gates)])
        self._power = None if (power == 1.0).all() else by_slot(power, len(a.gates))
        self.gate_rate = by_slot(np.array([0.0 if tau is None else dt / tau for tau in taus]), a.n_slow)
        membrane_rate = dt / a.capacitance_nF
        self.weights = a.weights * np.tile(membrane_rate, 2)

        self._drive = drive = np.zeros((w, a.weights.shape[0]))
        drive[:, a.drive["one"]] = 1.0
        self._open = drive[:, a.drive["terminals"]]
        self._channel_open = drive[:, a.drive["channels"]]
        self._rectified = drive[:, a.drive["rectified"]]
        self._potentials = drive[:, a.drive["potentials"]]
        self._inputs = drive[:, a.drive["inputs"]]
        self._seen = np.empty(self._looked_at.size)
        self._opening = self._seen[: w * n_terminals].reshape(w, n_terminals)
        self._y = self._seen[w * n_terminals :].reshape(len(a.gates), w, n_channels)
        self._q = np.empty(self._y.shape)
        self._y_slow, self._q_slow, self._q_instant = self._y[: a.n_slow], self._q[: a.n_slow], self._q[a.n_slow :]
        self._total = np.empty((w, 2 * len(a.neurons)))
        self._conductance, self._current = np.split(self._total, 2, axis=1)

    def initial_state(self, gate_start: GateStart = "steady") -> NetworkState:
        """Returns the state at the start.

        Args:
            gate_start: ``"steady"``: slow gates at their steady state at the initial potential;
                ``"toolbox"``: as SNS-Toolbox 1.5.2 starts them, with the slope's sign reversed.

        Raises:
            ConfigError: An unknown start.
        """
        if gate_start not in get_args(GateStart):
            raise ConfigError(f"unknown gate start {gate_start!r}: {suggest(gate_start, get_args(GateStart))}")
        a, w = self.arrays, self.n_worms
        gate = np.empty((a.n_slow, a.channel_neuron.size))
        for slot, row in enumerate(a.gates[: a.n_slow]):
            starts = [one.steady if gate_start == "steady" else one.toolbox_start for one in row]
            gate[slot] = [start(a.initial_mV[neuron]) for start, neuron in zip(starts, a.channel_neuron, strict=True)]
        return NetworkState(np.tile(a.initial_mV, (w, 1)), np.tile(gate, (w, 1, 1)))

    def advance(self, state: NetworkState, inputs_nA: Array | None = None, n_steps: int = 1) -> None:
        """Advances a state, in place.

        Args:
            state: The state of all copies.
            inputs_nA: Input currents during all of the steps, shape ``(n_worms, n_inputs)`` or ``(n_inputs,)`` for all
                copies alike; None for no current.
            n_steps: Number of steps; bit for bit the same as so many calls.
        """
        potential, gate = state.potential, state.gate.swapaxes(0, 1)
        self._inputs[...] = 0.0 if inputs_nA is None else inputs_nA
        for _ in range(n_steps):
            gate_step = self._gate_step(potential, gate)
            if self.scheme == "toolbox":
                gate += gate_step
                potential_step = self._potential_step(potential, gate)
            else:
                potential_step = self._potential_step(potential, gate)
                if self.scheme == "heun":
                    # The mean of the Euler steps at the beginning and at the end that they lead to.
                    potential_ahead, gate_ahead = potential + potential_step, gate + gate_step
                    gate_step = (gate_step + self._gate_step(potential_ahead, gate_ahead)) * 0.5
                    potential_step = (potential_step + self._potential_step(potential_ahead, gate_ahead)) * 0.5
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

    def _gate_step(self, potential: Array, gate: Array) -> Array:
        """Looks at the potentials, for the step of the potentials too, and returns the slow gates' Euler step."""
        seen, y, q = self._seen, self._y, self._q
        potential.take(self._looked_at, None, seen, "clip")
        np.multiply(seen, self.affine_slope, seen)
        np.add(seen, self.affine_offset, seen)
        np.maximum(self._opening, _ZERO, out=self._opening)
        np.minimum(self._opening, _ONE, out=self._open)
        np.exp(y, y)
        np.square(y, q)
        np.add(q, _ONE, q)
        step = self._q_slow * gate
        np.subtract(_ONE, step, step)
        np.multiply(step, self.gate_rate / self._y_slow, step)
        return step

    def _potential_step(self, potential: Array, gate: Array) -> Array:
        """Returns the potentials' Euler step at the potentials last looked at."""
        a = self.arrays
        if self._channel_open.size:
            self._open_channels(gate)
        if self._rectified.size:
            difference = potential[:, a.rectified_source] - potential[:, a.rectified_target]
            np.maximum(difference, 0.0, out=self._rectified)
        if self._potentials.size:
            self._potentials[...] = potential
        if self.n_worms == 1:
            # Calls the same routine of BLAS with less ado.
            self._drive.dot(self.weights, self._total)
        else:
            # One product of a vector and the matrix per copy.
            np.matmul(self._drive[:, np.newaxis], self.weights, self._total[:, np.newaxis])
        step = self._conductance * potential
        np.subtract(self._current, step, step)
        return step

    def _open_channels(self, gate: Array) -> None:
        """Multiplies the powers of all gates of each channel."""
        if self._power is None and len(self._q) == 2 and len(gate) == 1:
            np.divide(gate[0], self._q_instant[0], self._channel_open)
        else:
            open_gates = np.concatenate([gate, 1.0 / self._q_instant])
            if self._power is not None:
                open_gates **= self._power
            np.multiply.reduce(open_gates, axis=0, out=self._channel_open)

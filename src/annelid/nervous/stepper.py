"""The batched stepper: one time step of many copies of a network, in a few numpy calls."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError, suggest
from annelid.nervous.arrays import NetworkArrays
from annelid.nervous.neurons import Array
from annelid.nervous.synapses import Modulated

Scheme = Literal["euler", "toolbox", "heun"]
GateStart = Literal["steady", "toolbox"]


@dataclass(slots=True)
class NetworkState:
    """All that the next step depends on.

    Attributes:
        potential: Membrane potentials, mV, shape ``(n_worms, n_neurons)``.
        gate: Slow gates, shape ``(n_worms, n_slow, n_channels)``; a slot that a channel does not use stays
            constant.
        threshold: Firing thresholds of the spiking neurons, mV, ``(n_worms, n_firing)``.
        release: Releases of the spiking synapses, in [0, 1], ``(n_worms, n_releases)``.
        fired: Which of the spiking neurons fired in the last step, ``(n_worms, n_firing)``.
    """

    potential: Array
    gate: Array
    threshold: Array
    release: Array
    fired: NDArray[np.bool_]

    def copy(self) -> NetworkState:
        """Returns an independent copy."""
        return NetworkState(
            self.potential.copy(), self.gate.copy(), self.threshold.copy(), self.release.copy(), self.fired.copy()
        )


class Stepper:
    """Advances ``n_worms`` copies of a compiled network by a fixed step.

    With ``y = sqrt(factor exp(slope (midpoint - U)))`` a gate's steady state is ``1 / (1 + y^2)`` and its rate
    ``(1 - z (1 + y^2)) / (y time_constant_ms)``, which needs one exponential a gate. The exponents of the gates and
    the open fractions of the terminals are one affine map of the potentials; ``dt / C`` is part of the weights.

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
        terminal_slope = a.terminal_slope_per_mV
        self._looked_at = np.concatenate([a.terminal_neuron, *[a.channel_neuron] * len(a.gates)])
        self._affine_slope = np.concatenate([terminal_slope, -0.5 * slope])
        self._affine_offset = np.concatenate(
            [-a.terminal_threshold_mV * terminal_slope, 0.5 * (log_factor + slope * midpoint)]
        )
        self._power = None if (power == 1.0).all() else power
        self._gate_rate = np.array([0.0 if tau is None else dt / tau for tau in taus]).reshape(n_slow, n_channels)
        membrane_rate = dt / a.capacitance_nF
        self._weights = a.weights * np.tile(membrane_rate, 2)
        self._leak_step = a.leak_conductance_uS * membrane_rate
        self._threshold_rate = dt / a.adaptation_time_constant_ms
        self._release_decay = np.exp(-dt / a.release_time_constant_ms)
        self._prepare_modulation()

    def _prepare_modulation(self) -> None:
        """Finds, for each modulated quantity, which factor scales which column."""
        a = self.arrays
        factors = [dict[int, int]() for _ in get_args(Modulated)]
        kinds = dict(zip(get_args(Modulated), factors, strict=True))
        for column, (quantity, neuron) in enumerate(a.modulated):
            kinds[quantity][neuron] = column

        def pairs(table: dict[int, int], neurons: Iterable[int]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
            found = [(place, table[neuron]) for place, neuron in enumerate(neurons) if neuron in table]
            places, columns = np.array(found, dtype=np.intp).reshape(-1, 2).T
            return places, columns

        everyone, bearers = range(len(a.neurons)), a.channel_neuron.tolist()
        self._leak_factor = pairs(kinds["leak"], everyone)
        self._membrane_factor = pairs(kinds["membrane"], everyone)
        self._channel_factor = pairs(kinds["channels"], bearers)
        self._gate_factor = pairs(kinds["gates"], bearers)

    def _prepare_buffers(self) -> None:
        a, w, n = self.arrays, self.n_worms, len(self.arrays.neurons)
        n_channels, n_slow, n_slots = a.channel_neuron.size, a.n_slow, len(a.gates)
        n_terminals, n_firing = a.terminal_neuron.size, a.firing_neuron.size
        where = a.drive_slices()
        drive = np.zeros((w, a.weights.shape[0]))
        self._drive = drive
        self._open = drive[:, where["terminals"]]
        self._release = drive[:, where["releases"]]
        self._channel_open = drive[:, where["channels"]]
        self._rectified = drive[:, where["rectified"]]
        self._potentials = drive[:, where["potentials"]]
        drive[:, where["one"]] = 1.0
        self._inputs = drive[:, where["inputs"]]
        self._total = np.empty((w, 2 * n))
        self._conductance, self._current = self._total[:, :n], self._total[:, n:]
        self._affine = np.empty((w, self._looked_at.size))
        self._transmission = self._affine[:, :n_terminals]
        self._exponent = self._affine[:, n_terminals:]
        self._y = self._exponent.reshape(w, n_slots, n_channels)
        self._y_slow = self._y[:, :n_slow]
        self._q = np.empty((w, n_slots, n_channels))
        self._q_slow, self._q_instant = self._q[:, :n_slow], self._q[:, n_slow:]
        self._z = np.empty((w, n_slots, n_channels))
        self._gate_steps = (np.empty((w, n_slow, n_channels)), np.empty((w, n_slow, n_channels)))
        self._gate_scratch = np.empty((w, n_slow, n_channels))
        self._potential_steps = (np.empty((w, n)), np.empty((w, n)))
        self._modulation = np.ones((w, len(a.modulated)))
        self._middle = NetworkState(
            np.empty((w, n)),
            np.empty((w, n_slow, n_channels)),
            np.empty((w, n_firing)),
            np.empty((w, a.release_source.size)),
            np.zeros((w, n_firing), dtype=bool),
        )

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
        w = self.n_worms
        return NetworkState(
            potential=np.tile(a.initial_mV, (w, 1)),
            gate=np.tile(gate, (w, 1, 1)),
            threshold=np.tile(a.threshold_mV, (w, 1)),
            release=np.zeros((w, a.release_source.size)),
            fired=np.zeros((w, a.firing_neuron.size), dtype=bool),
        )

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
        self._release[...] = state.release
        self._look(potential)
        self._step_gates(gate, gate_step)
        if self.scheme == "toolbox":
            gate += gate_step
            self._step_potentials(potential, gate, potential_step)
        else:
            self._step_potentials(potential, gate, potential_step)
            if self.scheme == "heun":
                self._average_with_end(potential, gate)
            gate += gate_step
        if state.fired.size:
            self._adapt_thresholds(state)
        potential += potential_step
        if state.fired.size:
            self._fire(state)

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

    def _average_with_end(self, potential: Array, gate: Array) -> None:
        """Replaces the Euler steps by the mean of those at the beginning and at the end that they lead to."""
        middle = self._middle
        np.add(potential, self._potential_steps[0], out=middle.potential)
        np.add(gate, self._gate_steps[0], out=middle.gate)
        self._look(middle.potential)
        self._step_gates(middle.gate, self._gate_steps[1])
        self._step_potentials(middle.potential, middle.gate, self._potential_steps[1])
        for step, end in (self._gate_steps, self._potential_steps):
            step += end
            step *= 0.5

    def _look(self, potential: Array) -> None:
        """Finds all that depends on the potentials alone: terminals, exponentials of gates, modulation."""
        if not self._affine.size:
            return
        np.take(potential, self._looked_at, axis=1, out=self._affine, mode="clip")
        self._affine *= self._affine_slope
        self._affine += self._affine_offset
        if self._open.size:
            np.maximum(self._transmission, 0.0, out=self._open)
            np.minimum(self._open, 1.0, out=self._open)
        if self._q.size:
            np.exp(self._exponent, out=self._exponent)
            np.multiply(self._y, self._y, out=self._q)
            self._q += 1.0
        if self._modulation.size:
            np.matmul(self._open, self.arrays.log_modulation, out=self._modulation)
            np.exp(self._modulation, out=self._modulation)

    def _step_gates(self, gate: Array, step: Array) -> None:
        """Writes the slow gates' Euler step at the potential last looked at."""
        if not step.size:
            return
        np.multiply(self._q_slow, gate, out=step)
        np.subtract(1.0, step, out=step)
        np.divide(self._gate_rate, self._y_slow, out=self._gate_scratch)
        step *= self._gate_scratch
        channels, factors = self._gate_factor
        if channels.size:
            step[:, :, channels] /= self._modulation[:, np.newaxis, factors]

    def _step_potentials(self, potential: Array, gate: Array, step: Array) -> None:
        """Writes the potentials' Euler step; `potential` is what was last looked at."""
        if self._channel_open.size:
            self._open_channels(gate)
        if self._rectified.size:
            source, target = self.arrays.rectified_source, self.arrays.rectified_target
            np.subtract(potential[:, source], potential[:, target], out=self._rectified)
            np.maximum(self._rectified, 0.0, out=self._rectified)
        if self._potentials.size:
            self._potentials[...] = potential
        np.matmul(self._drive, self._weights, out=self._total)
        neurons, factors = self._leak_factor
        if neurons.size:
            more = self._leak_step[neurons] * (self._modulation[:, factors] - 1.0)
            self._conductance[:, neurons] += more
            self._current[:, neurons] += more * self.arrays.rest_mV[neurons]
        np.multiply(self._conductance, potential, out=step)
        np.subtract(self._current, step, out=step)
        neurons, factors = self._membrane_factor
        if neurons.size:
            step[:, neurons] /= self._modulation[:, factors]

    def _open_channels(self, gate: Array) -> None:
        """Multiplies the powers of all gates of each channel."""
        n_slow = self.arrays.n_slow
        if self._power is None and self._z.shape[1] == 2 and n_slow == 1:
            np.divide(gate[:, 0], self._q[:, 1], out=self._channel_open)
        else:
            self._z[:, :n_slow] = gate
            np.reciprocal(self._q_instant, out=self._z[:, n_slow:])
            if self._power is not None:
                np.power(self._z, self._power, out=self._z)
            np.multiply.reduce(self._z, axis=1, out=self._channel_open)
        channels, factors = self._channel_factor
        if channels.size:
            self._channel_open[:, channels] *= self._modulation[:, factors]

    def _adapt_thresholds(self, state: NetworkState) -> None:
        """Takes the thresholds' Euler step, from the potentials before this step."""
        a = self.arrays
        depolarisation = state.potential[:, a.firing_neuron] - a.rest_mV[a.firing_neuron]
        state.threshold += self._threshold_rate * (a.threshold_mV - state.threshold + a.adaptation * depolarisation)

    def _fire(self, state: NetworkState) -> None:
        """Resets the neurons at or above their thresholds, and lets their synapses release."""
        a = self.arrays
        reached = state.potential[:, a.firing_neuron]
        np.greater_equal(reached, state.threshold, out=state.fired)
        state.potential[:, a.firing_neuron] = np.where(state.fired, a.reset_mV, reached)
        state.release *= self._release_decay
        state.release += a.release_increment * state.fired[:, a.release_source]
        np.minimum(state.release, 1.0, out=state.release)

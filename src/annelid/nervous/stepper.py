"""The batched stepper: one time step of many copies of a network, in a few numpy calls."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial
from math import prod
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError, require_at_least, require_positive, suggest
from annelid.nervous.arrays import NetworkArrays
from annelid.nervous.neurons import Array
from annelid.nervous.synapses import Modulated

Scheme = Literal["euler", "toolbox", "heun"]
GateStart = Literal["steady", "toolbox"]
Operations = list[Callable[[], object]]
Factors = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Places of what is modulated, and the column of the factor that scales each."""

# As arrays, numpy need not convert them at every call.
_ZERO, _HALF, _ONE = np.array(0.0), np.array(0.5), np.array(1.0)


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
        return NetworkState(*(getattr(self, field.name).copy() for field in fields(self)))


class _Motion:
    """Gates and potentials, or a change of them, in one row of numbers, so that one call adds both."""

    def __init__(self, arrays: NetworkArrays, n_worms: int) -> None:
        gates = arrays.n_slow, n_worms, arrays.channel_neuron.size
        self.all = np.empty(prod(gates) + n_worms * len(arrays.neurons))
        self.gate = self.all[: prod(gates)].reshape(gates)
        self.potential = self.all[prod(gates) :].reshape(n_worms, -1)


class Stepper:
    """Advances ``n_worms`` copies of a compiled network by a fixed step.

    With ``y = sqrt(factor exp(slope (midpoint - U)))`` a gate's steady state is ``1 / (1 + y^2)`` and its rate
    ``(1 - z (1 + y^2)) / (y time_constant_ms)``, which needs one exponential per gate. The exponents of the gates and
    the open fractions of the terminals are one affine map of the potentials; ``dt / C`` is part of the weights.

    For small networks the time goes into calling numpy, not into arithmetic. So a step is a list of calls bound to fixed
    buffers, made once. Every copy gets the same bits whatever their number: the product with the weights is taken copy
    by copy, since a matrix product of all copies sums in another order.

    A stepper has scratch buffers and must not be used from two threads; two steppers share nothing but their arrays.

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
        require_positive(timestep_ms=timestep_ms)
        require_at_least(1, n_worms=n_worms)
        self.arrays = arrays
        self.timestep_ms = float(timestep_ms)
        self.scheme: Scheme = scheme
        self.n_worms = n_worms
        self._prepare_parameters()
        self._prepare_buffers()
        self._step = self._listed_step()

    def _prepare_parameters(self) -> None:
        a, dt, w = self.arrays, self.timestep_ms, self.n_worms
        n_slots, n_channels = len(a.gates), a.channel_neuron.size
        gates = [gate for slot in a.gates for gate in slot]
        with np.errstate(divide="ignore"):
            log_factor = np.log([gate.factor for gate in gates])
        slope = np.array([gate.slope_per_mV for gate in gates])
        midpoint = np.array([gate.midpoint_mV for gate in gates])
        power = np.array([gate.power for gate in gates])
        taus = [gate.time_constant_ms for slot in a.gates[: a.n_slow] for gate in slot]

        def by_slot(values: Array) -> Array:
            """A row of channels for every slot and copy, as the buffers of the gates have it."""
            return np.repeat(values.reshape(-1, 1, max(n_channels, 1)), w, axis=1)

        def in_row(of_terminals: Array, of_gates: Array) -> Array:
            """A row of terminals for every copy, then the gates."""
            return np.concatenate([np.tile(of_terminals, w), by_slot(of_gates).ravel()])

        terminal_slope = a.terminal_slope_per_mV
        self._affine_slope = in_row(terminal_slope, -0.5 * slope)
        self._affine_offset = in_row(-a.terminal_threshold_mV * terminal_slope, 0.5 * (log_factor + slope * midpoint))
        first = len(a.neurons) * np.arange(w)[:, np.newaxis]
        bearers = (first + a.channel_neuron).ravel()
        self._looked_at = np.concatenate([(first + a.terminal_neuron).ravel(), *[bearers] * n_slots])
        self._power = None if (power == 1.0).all() else by_slot(power)
        self._gate_rate = by_slot(np.array([0.0 if tau is None else dt / tau for tau in taus]))
        membrane_rate = dt / a.capacitance_nF
        self._weights = a.weights * np.tile(membrane_rate, 2)
        self._leak_step = a.leak_conductance_uS * membrane_rate
        self._threshold_rate = dt / a.adaptation_time_constant_ms
        self._release_decay = np.exp(-dt / a.release_time_constant_ms)

        def factors(quantity: Modulated, neurons: Iterable[int]) -> Factors:
            """Which of the neurons (or channels) have the quantity modulated, and by which factor."""
            column = {neuron: column for column, (what, neuron) in enumerate(a.modulated) if what == quantity}
            found = [(place, column[neuron]) for place, neuron in enumerate(neurons) if neuron in column]
            places, columns = np.array(found, dtype=np.intp).reshape(-1, 2).T
            return places, columns

        everyone, bearers = range(len(a.neurons)), a.channel_neuron.tolist()
        self._leak_factor = factors("leak", everyone)
        self._membrane_factor = factors("membrane", everyone)
        self._channel_factor = factors("channels", bearers)
        self._gate_factor = factors("gates", bearers)

    def _prepare_buffers(self) -> None:
        a, w, n = self.arrays, self.n_worms, len(self.arrays.neurons)
        n_terminals, n_slow, slots = a.terminal_neuron.size, a.n_slow, (len(a.gates), w, a.channel_neuron.size)
        drive = np.zeros((w, a.weights.shape[0]))
        # One matrix-vector product per copy.
        self._drive = drive[:, np.newaxis]
        self._open = drive[:, a.drive["terminals"]]
        self._release = drive[:, a.drive["releases"]]
        self._channel_open = drive[:, a.drive["channels"]]
        self._rectified = drive[:, a.drive["rectified"]]
        self._potentials = drive[:, a.drive["potentials"]]
        drive[:, a.drive["one"]] = 1.0
        self._inputs = drive[:, a.drive["inputs"]]
        total = np.empty((w, 2 * n))
        self._total = total[:, np.newaxis]
        self._conductance, self._current = total[:, :n], total[:, n:]
        # Terminals and gates of all copies are in one row, so that one call serves both at any number of copies.
        self._affine = np.empty(self._looked_at.size)
        self._transmission = self._affine[: w * n_terminals].reshape(w, n_terminals)
        self._exponent = self._affine[w * n_terminals :]
        self._y = self._exponent.reshape(slots)
        self._q, self._z = np.empty(slots), np.empty(slots)
        self._modulation = np.ones((w, len(a.modulated)))
        self._motion = _Motion(a, w)
        self._now = NetworkState(
            self._motion.potential,
            self._motion.gate.swapaxes(0, 1),
            np.empty((w, a.firing_neuron.size)),
            np.empty((w, a.release_source.size)),
            np.zeros((w, a.firing_neuron.size), dtype=bool),
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
        a, w = self.arrays, self.n_worms
        gate = np.empty((a.n_slow, a.channel_neuron.size))
        for slot, row in enumerate(a.gates[: a.n_slow]):
            starts = [one.steady if gate_start == "steady" else one.toolbox_start for one in row]
            gate[slot] = [start(a.initial_mV[neuron]) for start, neuron in zip(starts, a.channel_neuron, strict=True)]
        return NetworkState(
            potential=np.tile(a.initial_mV, (w, 1)),
            gate=np.tile(gate, (w, 1, 1)),
            threshold=np.tile(a.threshold_mV, (w, 1)),
            release=np.zeros((w, a.release_source.size)),
            fired=np.zeros((w, a.firing_neuron.size), dtype=bool),
        )

    def advance(self, state: NetworkState, inputs_nA: Array | None = None, n_steps: int = 1) -> None:
        """Advances a state, in place.

        Args:
            state: The state of all copies.
            inputs_nA: Input currents during all of the steps, shape ``(n_worms, n_inputs)`` or ``(n_inputs,)`` for all
                copies alike; None for no current.
            n_steps: Number of steps; bit for bit the same as so many calls.
        """
        now, step = self._now, self._step
        self._inputs[...] = 0.0 if inputs_nA is None else inputs_nA
        now.potential[...] = state.potential
        now.gate[...] = state.gate
        spiking = state.fired.size
        if spiking:
            now.threshold[...] = state.threshold
            now.release[...] = state.release
        for _ in range(n_steps):
            for operation in step:
                operation()
        state.potential[...] = now.potential
        state.gate[...] = now.gate
        if spiking:
            state.threshold[...] = now.threshold
            state.release[...] = now.release
            state.fired[...] = now.fired

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

    def _listed_step(self) -> Operations:
        """Lists the operations that take the present state one step on."""
        now, spiking = self._motion, self._now
        step, middle, end = (_Motion(self.arrays, self.n_worms) for _ in range(3))
        take_step = partial(np.add, now.all, step.all, now.all)
        operations = self._look(now.potential) + self._gate_step(now, step)
        if self.scheme == "toolbox":
            operations.append(partial(np.add, now.gate, step.gate, now.gate))
            take_step = partial(np.add, now.potential, step.potential, now.potential)
        operations += self._potential_step(now, step)
        if self.scheme == "heun":
            # The mean of the Euler steps at the beginning and at the end that they lead to.
            operations.append(partial(np.add, now.all, step.all, middle.all))
            operations += [*self._look(middle.potential), *self._gate_step(middle, end)]
            operations += self._potential_step(middle, end)
            operations.append(partial(np.add, step.all, end.all, step.all))
            operations.append(partial(np.multiply, step.all, _HALF, step.all))
        if not spiking.fired.size:
            return [*operations, take_step]
        release = partial(np.copyto, self._release, spiking.release)
        return [release, *operations, self._adapt_thresholds, take_step, self._fire]

    def _look(self, potential: Array) -> Operations:
        """Finds all that depends on the potentials alone: terminals, exponentials of gates, modulation."""
        affine, opened, q, factors = self._affine, self._open, self._q, self._modulation
        if not affine.size:
            return []
        operations: Operations = [
            partial(potential.take, self._looked_at, None, affine, "clip"),
            partial(np.multiply, affine, self._affine_slope, affine),
            partial(np.add, affine, self._affine_offset, affine),
        ]
        if opened.size:
            transmission = self._transmission
            operations.append(partial(np.maximum, transmission, _ZERO, out=transmission))
            operations.append(partial(np.minimum, transmission, _ONE, out=opened))
        if q.size:
            operations.append(partial(np.exp, self._exponent, self._exponent))
            operations.append(partial(np.square, self._y, q))
            operations.append(partial(np.add, q, _ONE, q))
        if factors.size:
            each_open, each_factor = opened[:, np.newaxis], factors[:, np.newaxis]
            operations.append(partial(np.matmul, each_open, self.arrays.log_modulation, each_factor))
            operations.append(partial(np.exp, factors, factors))
        return operations

    def _gate_step(self, state: _Motion, step: _Motion) -> Operations:
        """Writes the slow gates' Euler step at the potential last looked at."""
        change, pace, n_slow = step.gate, np.empty(step.gate.shape), self.arrays.n_slow
        if not change.size:
            return []
        operations: Operations = [
            partial(np.multiply, self._q[:n_slow], state.gate, change),
            partial(np.subtract, _ONE, change, change),
            partial(np.divide, self._gate_rate, self._y[:n_slow], pace),
            partial(np.multiply, change, pace, change),
        ]
        if self._gate_factor[0].size:
            operations.append(partial(self._slow_down, change, *self._gate_factor))
        return operations

    def _potential_step(self, state: _Motion, step: _Motion) -> Operations:
        """Writes the potentials' Euler step at the potential last looked at."""
        a, potential, change, difference = self.arrays, state.potential, step.potential, self._rectified
        operations = self._open_channels(state.gate) if self._channel_open.size else []
        if difference.size:
            target = np.empty(difference.shape)
            operations += [
                partial(potential.take, a.rectified_source, 1, difference, "clip"),
                partial(potential.take, a.rectified_target, 1, target, "clip"),
                partial(np.subtract, difference, target, difference),
                partial(np.maximum, difference, _ZERO, out=difference),
            ]
        if self._potentials.size:
            operations.append(partial(np.copyto, self._potentials, potential))
        if self.n_worms == 1:
            # Calls the same routine of BLAS with less ado.
            operations.append(partial(self._drive[0, 0].dot, self._weights, self._total[0, 0]))
        else:
            operations.append(partial(np.matmul, self._drive, self._weights, self._total))
        if self._leak_factor[0].size:
            operations.append(partial(self._modulate_leaks, *self._leak_factor))
        operations.append(partial(np.multiply, self._conductance, potential, change))
        operations.append(partial(np.subtract, self._current, change, change))
        if self._membrane_factor[0].size:
            operations.append(partial(self._slow_down, change, *self._membrane_factor))
        return operations

    def _open_channels(self, gate: Array) -> Operations:
        """Multiplies the powers of all gates of each channel."""
        n_slow, z, q = self.arrays.n_slow, self._z, self._q
        if self._power is None and len(z) == 2 and n_slow == 1:
            operations: Operations = [partial(np.divide, gate[0], q[1], self._channel_open)]
        else:
            operations = [partial(np.copyto, z[:n_slow], gate), partial(np.reciprocal, q[n_slow:], z[n_slow:])]
            if self._power is not None:
                operations.append(partial(np.power, z, self._power, z))
            operations.append(partial(np.multiply.reduce, z, axis=0, out=self._channel_open))
        if self._channel_factor[0].size:
            operations.append(partial(self._modulate_channels, *self._channel_factor))
        return operations

    def _slow_down(self, step: Array, columns: NDArray[np.intp], factors: NDArray[np.intp]) -> None:
        """Divides columns of a step by modulation factors, which lengthen their time constants."""
        step[..., columns] /= self._modulation[:, factors]

    def _modulate_leaks(self, neurons: NDArray[np.intp], factors: NDArray[np.intp]) -> None:
        more = self._leak_step[neurons] * (self._modulation[:, factors] - 1.0)
        self._conductance[:, neurons] += more
        self._current[:, neurons] += more * self.arrays.rest_mV[neurons]

    def _modulate_channels(self, channels: NDArray[np.intp], factors: NDArray[np.intp]) -> None:
        self._channel_open[:, channels] *= self._modulation[:, factors]

    def _adapt_thresholds(self) -> None:
        """Takes the thresholds' Euler step, from the potentials before this step."""
        a, state = self.arrays, self._now
        depolarisation = state.potential[:, a.firing_neuron] - a.rest_mV[a.firing_neuron]
        state.threshold += self._threshold_rate * (a.threshold_mV - state.threshold + a.adaptation * depolarisation)

    def _fire(self) -> None:
        """Resets the neurons at or above their thresholds, and lets their synapses release."""
        a, state = self.arrays, self._now
        reached = state.potential[:, a.firing_neuron]
        np.greater_equal(reached, state.threshold, out=state.fired)
        state.potential[:, a.firing_neuron] = np.where(state.fired, a.reset_mV, reached)
        state.release *= self._release_decay
        state.release += a.release_increment * state.fired[:, a.release_source]
        np.minimum(state.release, 1.0, out=state.release)

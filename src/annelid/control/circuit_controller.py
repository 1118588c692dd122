"""The stepper of circuits: a declared controller as numpy steps it."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from annelid.config.run import ControllerKind, RunConfig
from annelid.control.base import SegmentController
from annelid.control.circuit import Circuit, InputTable
from annelid.control.senses import SENSED, lengthening_m
from annelid.errors import ConfigError
from annelid.nervous import GapJunction, Network
from annelid.protocols import Array, Plant, Sensation, Values


class CircuitController(SegmentController):
    """Drives a worm by a circuit.

    One step, from t to t + dt: what is sensed at t sets the currents of the inputs during the whole step; the
    activation is read from the potentials at t + dt and drives the body from t on. This is the order of the loop of
    Riddle et al. 2023.

    Attributes:
        name: What the run file calls it.
        circuit: What it steps.
        stepper: The compiled network.
        table: The inputs' currents as a table.
        network_state: The network's present state.
        timestep_s: Control step, s.

    Raises:
        ConfigError: Muscles that are neither one nor two per segment, or something sensed at a place that the body has
            not.
    """

    recorded: ClassVar[tuple[tuple[str, tuple[str, ...], str, str], ...]] = (
        ("potential", ("neuron",), "mV", "membrane potential relative to rest"),
        (
            "sodium_gate",
            ("neuron",),
            "1",
            "slow gate, h of the persistent sodium channel; NaN for neurons without one",
        ),
        (
            "sensor_on",
            ("segment",),
            "1",
            "stretch sensor during the last control step: 1 while the segment is at rest length",
        ),
        ("stretch_activity", ("segment",), "1", "activity of the stretch neuron"),
        ("drive", (), "1", "activity of the descending neuron"),
    )

    def __init__(self, circuit: Circuit, n_muscles: int, control_timestep_s: float) -> None:
        """Compiles the circuit in its initial state.

        Args:
            circuit: What it steps.
            n_muscles: Muscles, one per segment, or two for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        super().__init__(circuit.n_segments, n_muscles)
        self.name = circuit.name
        self.circuit, self.timestep_s = circuit, control_timestep_s
        self.stepper = circuit.network.compile(1e3 * control_timestep_s, circuit.scheme)
        self.table = InputTable(circuit, control_timestep_s)
        readout = circuit.readout
        self._up, self._down = circuit.places(readout.contracting), circuit.places(readout.expanding)
        self.reset(0)

    @property
    def senses(self) -> tuple[str, ...]:
        """What it senses, names in `annelid.control.SENSED`."""
        return self.circuit.senses

    @property
    def network(self) -> Network:
        """The network that it steps."""
        return self.circuit.network

    @property
    def potential_mV(self) -> Array:
        """Present potentials, ``(n_neurons,)``."""
        return self.network_state.potential[0]

    def reset(self, seed: int) -> None:
        """Returns to the initial state; the seed matters where the circuit starts at random."""
        self.network_state = state = self.stepper.initial_state(self.circuit.gate_start)
        if self.circuit.random_start_mV is not None:
            rng = np.random.default_rng(seed)
            state.potential[...] = rng.uniform(*self.circuit.random_start_mV, state.potential.shape)
            state.gate[...] = rng.random(state.gate.shape)
        self._now = {"potential": state.potential, "gate": state.gate, "n_steps": np.array(0)}
        if self.table.hysteresis.size:
            self._now["sensor_on"] = np.zeros(self.table.hysteresis.size, dtype=bool)

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step, as `stride`."""
        return self.stride(sensation, 1)[0]

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `annelid.protocols.StridingController.stride`.

        Raises:
            ConfigError: The body does not sense what an input needs.
        """
        inputs_nA = self._inputs_nA(self._now, sensation, n_steps)
        potentials = np.empty((n_steps, self.network_state.potential.shape[-1]))
        for step in range(n_steps):
            self.stepper.advance(self.network_state, inputs_nA[step])
            potentials[step] = self.network_state.potential[0]
        return self.activation(potentials)

    def alarm(self) -> str | None:
        """Returns a sentence if a potential has left the range that currents and reversals can explain."""
        potential, (low, high) = self.potential_mV, self._bounds_mV
        # Written so that NaN fails it.
        if np.minimum.reduce(potential) >= low and np.maximum.reduce(potential) <= high:
            return None
        worst = int(np.argmin((potential >= low) & (potential <= high)))
        return (
            f"potential of {self.stepper.arrays.neurons[worst]} is {potential[worst]:.4g} mV, outside "
            f"{low:g} .. {high:g} mV, which currents reach: clock.control_timestep_s = {self.timestep_s:g} is too long"
        )

    @cached_property
    def _bounds_mV(self) -> tuple[float, float]:
        """The reversal and resting potentials, and beyond them what the strongest currents make of a leak."""
        network, table = self.circuit.network, self.table
        if table.functions:
            return -np.inf, np.inf
        largest_nA = np.maximum(np.abs(table.least), np.abs(table.most))
        largest_nA[table.n_linear :] = np.abs(table.gain[table.n_linear :])
        names, currents = list(network.inputs), dict.fromkeys(network.neurons, 0.0)
        for place, current_nA in zip(table.input, largest_nA.tolist(), strict=True):
            for target in network.inputs[names[place]]:
                currents[target] += current_nA
        drive = max(
            (abs(n.bias_nA) + currents[name]) / n.leak_conductance_uS if n.leak_conductance_uS else np.inf
            for name, n in network.neurons.items()
        )
        levels = [n.rest_mV for n in network.neurons.values()]
        levels += [channel.reversal_mV for n in network.neurons.values() for channel in n.channels]
        levels += [c.kind.reversal_mV for c in network.connections if not isinstance(c.kind, GapJunction)]
        return min(levels) - drive, max(levels) + drive

    def _inputs_nA(self, now: dict[str, NDArray[Any]], sensation: Sensation, n_steps: int) -> Array:
        """The inputs' currents at control steps, nA, ``(n_steps, n_inputs)``; takes the steps in ``now``."""
        first = round(sensation.time_s / self.timestep_s)
        on = now["sensor_on"].astype(bool) if "sensor_on" in now else np.zeros(0, dtype=bool)
        inputs_nA, on = self.table.currents(self._sensed(sensation, n_steps), first, on)
        for place, function in self.table.functions:
            for k in range(n_steps):
                at = sensation if k == 0 else sensation.later((first + k) * self.timestep_s)
                inputs_nA[k, place] = function(at)
        now["n_steps"] = np.array(int(now["n_steps"]) + n_steps)
        if "sensor_on" in now:
            now["sensor_on"] = on
        return inputs_nA

    def _sensed(self, sensation: Sensation, n_steps: int) -> Array:
        """The list of all numbers that are sensed at each step, with a 0 behind, ``(n_steps, n_values + 1)``."""
        parts: list[Array] = []
        for name in self.circuit.senses:
            if name == "lengthening_m":
                parts.append(self._lengthening(sensation, n_steps))
                continue
            values = SENSED[name].read(sensation)
            if values.shape != SENSED[name].shape(self.n_segments):
                raise ConfigError(f"the controller needs {name}, which the body does not sense")
            parts.append(np.tile(values.ravel(), (n_steps, 1)))
        return np.concatenate([*parts, np.zeros((n_steps, 1))], axis=1)

    def _lengthening(self, sensation: Sensation, n_steps: int) -> Array:
        """How much longer than at rest segments are at every control step, m, ``(n_steps, n_segments)``."""
        longer = lengthening_m(sensation.stretch_m, sensation.rest_stretch_m)
        if n_steps == 1:
            return longer[np.newaxis]
        rate = sensation.stretch_rate_m_per_s
        times = self.timestep_s * np.arange(n_steps)[:, np.newaxis]
        return longer + times * (rate.mean(axis=-1) if rate.size else 0.0)

    def activation(self, potential: Array) -> Array:
        """Returns the activation of every muscle, ``(.., n_muscles)``, at potentials, mV, ``(.., n_neurons)``."""
        readout, value = self.circuit.readout, potential[..., self._up]
        if self._down.size:
            value = value - potential[..., self._down]
        if readout.slope_per_mV is not None:
            activation = 1.0 / (1.0 + np.exp(-readout.slope_per_mV * value))
        else:
            low, high, length, offset = readout.line
            activation = np.minimum(np.maximum(value, low), high) / length + offset
            activation = np.minimum(np.maximum(activation, 0.0), 1.0)
        return activation if self.muscles_per_segment == 1 else activation.repeat(self.muscles_per_segment, axis=-1)

    def _values(self) -> Values:
        arrays = self.stepper.arrays
        gate = np.full(len(arrays.neurons), np.nan)
        if arrays.n_slow:
            gate[arrays.channel_neuron] = self.network_state.gate[0, 0]
        values: dict[str, Any] = {"potential": self.potential_mV.copy(), "sodium_gate": gate}
        if "sensor_on" in self._now:
            values["sensor_on"] = self._now["sensor_on"].astype(np.float64)
        for signal, neurons in self.circuit.activities.items():
            potential_mV = self.potential_mV[[arrays.neurons.index(name) for name in neurons]]
            activity = np.clip(potential_mV / self.circuit.range_mV, 0.0, 1.0)
            values[signal] = activity if signal != "drive" else float(activity[0])
        return values

    def _coords(self) -> dict[str, list[int] | list[str]]:
        return {"neuron": list(self.stepper.arrays.neurons), "segment": list(range(1, self.n_segments + 1))}

    def _attrs(self) -> dict[str, float | int | str]:
        return dict(self.circuit.constants)


class CircuitKind(ControllerKind):
    """Base of the sections of controllers that are circuits: they say which circuit it is, and nothing else."""

    @abstractmethod
    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit.

        Args:
            config: The configuration that the section is of.
            n_segments: Segments of the body.

        Raises:
            ConfigError: It cannot be designed with these values.
        """

    def build(self, config: RunConfig, plant: Plant) -> CircuitController:
        """Builds the controller, as `ControllerKind.build`."""
        return CircuitController(
            self.circuit(config, plant.n_segments), plant.n_muscles, config.clock.control_timestep_s
        )

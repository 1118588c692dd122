"""The paper's controller: stretch sensors, the peristalsis network, and the muscles' activation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields

import numpy as np
from numpy.typing import NDArray

from annelid import config as settings
from annelid.control.muscles import muscles_a_segment
from annelid.control.stretch_sensor import StretchSensor
from annelid.nervous import NetworkState, PeristalsisParameters, Stepper, neuron_names, peristalsis_network
from annelid.protocols import Array, Recordable, Sensation, Signal, State

_CONTRACTION, _EXPANSION, _NEURONS_A_SEGMENT = 0, 1, 4


class SnsController:
    """Drives a worm by the synthetic nervous system of Riddle et al. 2022 and 2023.

    One step, from t to t + dt: the lengths sensed at t switch the sensors, whose currents act on the network
    during the whole step; the activation is read from the potentials at t + dt and drives the body from t on.
    This is the order of the authors' loop. The kick acts during the first step only.

    A segment's activation is a function of its contraction minus its expansion neuron, U1 - U2:
    ``"sigmoid"``: ``1 / (1 + exp(-slope (U1 - U2)))`` (Riddle et al. 2023, Eq. 2, whose printed exponent has
    the other sign); ``"linear"``: ``0.5 + clip(U1 - U2, -R, R) / (2 R)`` (Riddle et al. 2022).

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two a segment, or network
            parameters for which a design rule has no solution.
    """

    def __init__(
        self,
        config: settings.SnsController,
        sensor: settings.StretchSensor,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Builds the controller in its initial state.

        Args:
            config: Section of the network, its scheme and its activation.
            sensor: Section of the stretch sensors; their noise is the simulation's business, not used here.
            n_segments: Segments, at least 3.
            n_muscles: ``n_segments``, or twice that for half-rings (left, right, segment by segment).
            control_timestep_s: Step of the network, s.
        """
        self._config = config
        self._parameters = PeristalsisParameters(
            **{field.name: getattr(config, field.name) for field in fields(PeristalsisParameters)}
        )
        self._n_segments = n_segments
        self._muscles_a_segment = muscles_a_segment(n_segments, n_muscles)
        self._stepper = peristalsis_network(n_segments, self._parameters).compile(
            timestep_ms=1e3 * control_timestep_s, scheme=config.scheme
        )
        self._sensor = StretchSensor(sensor, n_segments)
        self._batches: dict[int, tuple[Stepper, NetworkState]] = {}
        self._inputs_nA = np.zeros(n_segments + 1)
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Returns to the initial state: segment 1 contracted, the others expanded; nothing here is random."""
        self._state = self._stepper.initial_state(self._config.gate_start)
        self._sensor.reset()
        self._n_steps = 0

    def step(self, sensation: Sensation) -> Array:
        """Advances by one control step.

        Args:
            sensation: What the body feels at the beginning of the step; lengths and time are used.

        Returns:
            Activation of every muscle in [0, 1], shape ``(n_muscles,)``; both halves of a ring alike.
        """
        on = self._sensor.read(sensation.stretch_m, sensation.rest_stretch_m, sensation.time_s)
        np.multiply(on, self._config.sensor_current_nA, out=self._inputs_nA[:-1])
        self._inputs_nA[-1] = self._config.kick_nA if self._n_steps == 0 else 0.0
        self._stepper.advance(self._state, self._inputs_nA)
        self._n_steps += 1
        return self._activation(self._state.potential[0])

    def step_copies(self, states: State, sensation: Sensation) -> tuple[State, Array]:
        """Advances many copies by one control step at once, as `step` does one; changes nothing here.

        Args:
            states: As `get_state` returns them, the arrays but for the number of steps with one more axis in
                front, ``n_copies`` long.
            sensation: Lengths with the same axis in front, ``(n_copies, n_segments, n_sensors)``; one time for all.

        Returns:
            The states one step on, and their activation, ``(n_copies, n_muscles)``.
        """
        on = self._sensor.reading(
            states["sensor_on"].astype(bool), sensation.stretch_m, sensation.rest_stretch_m, sensation.time_s
        )
        n_copies = len(on)
        stepper, batch = self._batch(n_copies)
        inputs = np.zeros((stepper.n_worms, self._n_segments + 1))
        inputs[:n_copies, :-1] = self._config.sensor_current_nA * on
        inputs[:, -1] = self._config.kick_nA if int(states["n_steps"]) == 0 else 0.0
        batch.potential[:n_copies] = states["potential"][:, 0]
        batch.gate[:n_copies] = states["gate"][:, 0]
        stepper.advance(batch, inputs)
        potential, gate = batch.potential[:n_copies].copy(), batch.gate[:n_copies].copy()
        after: State = {
            "potential": potential[:, np.newaxis],
            "gate": gate[:, np.newaxis],
            "sensor_on": on,
            "n_steps": np.array(int(states["n_steps"]) + 1),
        }
        return after, self._activation(potential)

    def recordable(self) -> Recordable:
        """Names potentials, sodium gates and sensors, and gives the derived conductances as attributes."""
        names = neuron_names(self._n_segments)
        n_neurons = len(names)
        return Recordable(
            signals=(
                Signal("potential", ("neuron",), (n_neurons,), "mV", "membrane potential relative to rest"),
                Signal(
                    "sodium_gate",
                    ("neuron",),
                    (n_neurons,),
                    "1",
                    "inactivation gate h of the persistent sodium channel; NaN for neurons without one",
                ),
                Signal(
                    "sensor_on",
                    ("segment",),
                    (self._n_segments,),
                    "1",
                    "stretch sensor during the last control step: 1 while the segment is at rest length",
                ),
            ),
            coords={"neuron": names, "segment": list(range(1, self._n_segments + 1))},
            attrs={
                "controller": "synthetic nervous system",
                **{f"conductance_{name}_uS": value for name, value in asdict(self._parameters.conductances).items()},
            },
        )

    def read(self, frame: bool) -> Mapping[str, NDArray[np.generic] | float]:
        """Reads the signals that `recordable` names; there are none at frame rate."""
        if frame:
            return {}
        potential = self._state.potential[0]
        gate = np.full(potential.shape, np.nan)
        gate[self._stepper.arrays.channel_neuron] = self._state.gate[0, 0]
        return {
            "potential": potential.copy(),
            "sodium_gate": gate,
            "sensor_on": self._sensor.on.astype(np.float64),
        }

    def get_state(self) -> State:
        """Returns copies of potentials (mV), gates, sensors and the number of steps taken."""
        return {
            "potential": self._state.potential.copy(),
            "gate": self._state.gate.copy(),
            "sensor_on": self._sensor.on.copy(),
            "n_steps": np.array(self._n_steps),
        }

    def set_state(self, state: State) -> None:
        """Restores what `get_state` returned."""
        self._state.potential[...] = state["potential"]
        self._state.gate[...] = state["gate"]
        self._sensor.on[...] = state["sensor_on"]
        self._n_steps = int(state["n_steps"])

    def alarm(self) -> str | None:
        """Returns a sentence if a potential has left the range that currents and reversals can explain."""
        p, c = self._parameters, self._config
        drive = (c.sensor_current_nA + c.kick_nA) / p.leak_conductance_uS
        low = p.inhibitory_reversal_mV - drive
        high = max(p.excitatory_reversal_mV, p.sodium_reversal_mV) + drive
        potential = self._state.potential[0]
        within = (potential >= low) & (potential <= high)
        if within.all():
            return None
        worst = int(np.argmin(within))
        return (
            f"potential of {self._stepper.arrays.neurons[worst]} is {potential[worst]:.4g} mV, outside "
            f"{low:g} .. {high:g} mV: the control timestep of {self._stepper.timestep_ms:g} ms is too long"
        )

    def pieces_copies(self, states: State) -> NDArray[np.bool_]:
        """Tells in which piece of its piecewise smooth equations each of many copies is.

        Synapses open between two potentials, and a linear activation saturates: there the equations have kinks.

        Args:
            states: As for `step_copies`.

        Returns:
            Shape ``(n_copies, n_pieces)``; between two of its changes the equations are smooth.
        """
        potential = states["potential"][:, 0].astype(np.float64)
        arrays = self._stepper.arrays
        opening = (potential[:, arrays.terminal_neuron] - arrays.terminal_threshold_mV) * arrays.terminal_slope_per_mV
        pieces = [opening > 0.0, opening > 1.0]
        if self._config.activation == "linear":
            activation = self._activation(potential)
            pieces += [activation > 0.0, activation < 1.0]
        return np.concatenate(pieces, axis=1)

    def _batch(self, n_copies: int) -> tuple[Stepper, NetworkState]:
        """A stepper for at least this many copies, and room for their state."""
        # Few widths of buffers serve any number of copies.
        width = 1 << (n_copies - 1).bit_length()
        if width not in self._batches:
            own = self._stepper
            stepper = Stepper(own.arrays, own.timestep_ms, own.scheme, width)
            self._batches[width] = stepper, stepper.initial_state(self._config.gate_start)
        return self._batches[width]

    def _activation(self, potential: Array) -> Array:
        """Activation of every muscle, ``(.., n_muscles)``, from potentials, ``(.., n_neurons)``."""
        by_segment = potential.reshape(*potential.shape[:-1], -1, _NEURONS_A_SEGMENT)
        difference = by_segment[..., _CONTRACTION] - by_segment[..., _EXPANSION]
        if self._config.activation == "linear":
            reach = self._parameters.range_mV
            activation = 0.5 + np.minimum(np.maximum(difference, -reach), reach) / (2.0 * reach)
        else:
            activation = 1.0 / (1.0 + np.exp(-self._config.activation_slope_per_mV * difference))
        return activation if self._muscles_a_segment == 1 else activation.repeat(self._muscles_a_segment, axis=-1)

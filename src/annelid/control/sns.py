"""The paper's controller: stretch sensors, the peristalsis network, and the muscles' activation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from annelid import config as settings
from annelid.control.neural import PeristalsisController
from annelid.nervous import Network, NetworkState, Stepper, peristalsis_network
from annelid.protocols import Array, Sensation, State


@dataclass(frozen=True, slots=True)
class CopySettings:
    """What may differ between copies that are advanced together: one number for all, or an array ``(n_copies,)``.

    Attributes:
        tolerance_m: Tolerance of the stretch sensors, m.
        hysteresis_m: Their hysteresis, m.
        sensor_current_nA: Current of a sensor that is on, nA.
        kick_nA: Current of the first step, nA.
    """

    tolerance_m: float | Array
    hysteresis_m: float | Array
    sensor_current_nA: float | Array
    kick_nA: float | Array

    @classmethod
    def of(cls, sections: Sequence[tuple[settings.SnsController, settings.StretchSensor]]) -> Self:
        """Returns those of the configurations of all copies, given as sections of the controller and its sensors."""
        each = [(s.tolerance_m, s.hysteresis_m, c.sensor_current_nA, c.kick_nA) for c, s in sections]
        return cls(*np.array(each).reshape(-1, 4).T)


class SnsController(PeristalsisController[settings.SnsController]):
    """Drives a worm by the synthetic nervous system of Riddle et al. 2022 and 2023.

    One step, from t to t + dt: the lengths sensed at t switch the sensors, whose currents act on the network
    during the whole step; the activation is read from the potentials at t + dt and drives the body from t on.
    This is the order of the authors' loop. The kick acts during the first step only.

    A segment's activation is that of `annelid.control.neural.NeuralController`: ``"sigmoid"`` as in Riddle et al. 2023,
    ``"linear"`` as in Riddle et al. 2022.

    Raises:
        ConfigError: Fewer than 3 segments, muscles that are neither one nor two a segment, or network
            parameters for which a design rule has no solution.
    """

    name = "synthetic nervous system"

    def __init__(
        self,
        config: settings.SnsController,
        sensor: settings.StretchSensor,
        n_segments: int,
        n_muscles: int,
        control_timestep_s: float,
    ) -> None:
        """Builds the controller in its initial state, as `PeristalsisController`."""
        super().__init__(config, sensor, n_segments, n_muscles, control_timestep_s)
        self._own = CopySettings(sensor.tolerance_m, sensor.hysteresis_m, config.sensor_current_nA, config.kick_nA)
        drive = (config.sensor_current_nA + config.kick_nA) / config.leak_conductance_uS
        reversals = config.excitatory_reversal_mV, config.sodium_reversal_mV
        self._explicable_mV = config.inhibitory_reversal_mV - drive, max(reversals) + drive
        self._batches: dict[int, tuple[Stepper, NetworkState]] = {}

    def _network(self, n_segments: int, control_timestep_s: float) -> Network:
        return peristalsis_network(n_segments, self._parameters)

    def step_copies(
        self, states: State, sensation: Sensation, n_steps: int = 1, each: CopySettings | None = None
    ) -> tuple[State, Array]:
        """Advances many copies at once, each as `stride` does one, bit for bit; changes nothing here.

        Args:
            states: As `get_state` returns them, the arrays but for the number of steps with one more axis in
                front, ``n_copies`` long.
            sensation: Lengths with the same axis in front, ``(n_copies, n_segments, n_sensors)``; one time for all.
            n_steps: Control steps under these lengths, at least 1.
            each: What differs between the copies; None for this controller's own settings.

        Returns:
            The states that many steps on, and their activation, ``(n_copies, n_muscles)``.
        """
        each = each or self._own
        tolerance, hysteresis, current = (
            np.asarray(value)[..., np.newaxis]
            for value in (each.tolerance_m, each.hysteresis_m, each.sensor_current_nA)
        )
        on = states["sensor_on"].astype(bool)
        n_copies, n_taken = len(on), int(states["n_steps"])
        stepper, batch = self._batch(n_copies)
        batch.potential[:n_copies] = states["potential"][:, 0]
        batch.gate[:n_copies] = states["gate"][:, 0]
        inputs = np.zeros((stepper.n_worms, self._n_segments + 1))
        for n, time_s in self._pieces(n_taken, sensation.time_s, n_steps):
            lengths = sensation.stretch_m, sensation.rest_stretch_m
            on = self._sensor.reading(on, *lengths, time_s, tolerance, hysteresis)
            inputs[:n_copies, :-1] = current * on
            inputs[:n_copies, -1] = each.kick_nA if n_taken == 0 else 0.0
            stepper.advance(batch, inputs, n)
            n_taken += n
        potential, gate = batch.potential[:n_copies].copy(), batch.gate[:n_copies].copy()
        after: State = {
            "potential": potential[:, np.newaxis],
            "gate": gate[:, np.newaxis],
            "sensor_on": on,
            "n_steps": np.array(n_taken),
        }
        return after, self._activation(potential)

    def _batch(self, n_copies: int) -> tuple[Stepper, NetworkState]:
        """A stepper for at least this many copies, and room for their state."""
        # Few widths of buffers serve any number of copies.
        width = 1 << (n_copies - 1).bit_length()
        if width not in self._batches:
            own = self._stepper
            stepper = Stepper(own.arrays, own.timestep_ms, own.scheme, width)
            self._batches[width] = stepper, stepper.initial_state(self._sns.gate_start)
        return self._batches[width]

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
        if self._sns.activation == "linear":
            activation = self._activation(potential)
            pieces += [activation > 0.0, activation < 1.0]
        return np.concatenate(pieces, axis=1)

    def alarm(self) -> str | None:
        """Returns a sentence if a potential has left the range that currents and reversals can explain."""
        low, high = self._explicable_mV
        potential = self._state.potential[0]
        # Written so that NaN fails it.
        if np.minimum.reduce(potential) >= low and np.maximum.reduce(potential) <= high:
            return None
        worst = int(np.argmin((potential >= low) & (potential <= high)))
        return (
            f"potential of {self._stepper.arrays.neurons[worst]} is {potential[worst]:.4g} mV, outside "
            f"{low:g} .. {high:g} mV: the control timestep of {self._stepper.timestep_ms:g} ms is too long"
        )

    def _attrs(self) -> dict[str, float]:
        return {f"conductance_{name}_uS": value for name, value in asdict(self._parameters.conductances).items()}

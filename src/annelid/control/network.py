"""A user's own network as a controller, whose gates and currents are recorded by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from annelid.control.circuit import Circuit, Readout
from annelid.control.circuit_controller import CircuitController
from annelid.control.senses import Source
from annelid.errors import ConfigError, require_positive
from annelid.nervous import NO_GATE, GapJunction, Network, Scheme
from annelid.protocols import Array, Sensation, Values
from annelid.text import numbered

LONGEST_TEXT = 60_000
"""Characters of a network that a run file's attribute can hold."""
Output: TypeAlias = str | tuple[str, str]
"""An output of the network, or two, of which the first contracts and the second expands."""


class NetworkController(CircuitController):
    """Drives a worm by a network of a user's own, as the circuit of it does.

    Recorded are all potentials, slow gates and currents of connections, by name.

    Example::

        inputs = {f"stretch_{i + 1}": Sense("lengthening_m", i, gain=400.0) for i in range(3)}
        controller = NetworkController(network, inputs, outputs=["motor_1", "motor_2", "motor_3"])
        annelid.simulate("riddle2023-rods", "runs/mine", controller=controller)

    Raises:
        ConfigError: As of `Circuit`, `Readout` and `CircuitController`, or outputs of which some are one and some two.
    """

    recorded = (
        ("potential", ("neuron",), "mV", "membrane potential"),
        ("gate", ("channel",), "1", "slow gate of a channel"),
        ("switch_on", ("switch",), "1", "during the last control step: 1 while an input's switch is on"),
        ("synaptic_current", ("connection",), "nA", "current through a synapse or gap junction into its target"),
    )

    def __init__(
        self,
        network: Network,
        inputs: Mapping[str, Source],
        outputs: Sequence[Output],
        *,
        n_muscles: int | None = None,
        control_timestep_s: float = 0.001,
        scheme: Scheme = "euler",
        from_mV: float = 0.0,
        to_mV: float = 20.0,
        slope_per_mV: float | None = None,
    ) -> None:
        """Compiles the network.

        Args:
            network: The network; it is not changed.
            inputs: What sets the currents of its inputs; those that are not named get none.
            outputs: For every segment the output that drives its muscles, or two.
            n_muscles: Muscles; default one per segment. Half-rings are two, which are driven alike.
            control_timestep_s: Step of the network, s: ``clock.control_timestep_s`` of the run.
            scheme: As of `annelid.nervous.Network.compile`.
            from_mV: Potential of activation 0.
            to_mV: Potential of activation 1.
            slope_per_mV: Slope of the sigmoid, which then takes the place of the line.
        """
        require_positive(control_timestep_s=control_timestep_s)
        pairs = [(output,) if isinstance(output, str) else output for output in outputs]
        contracting, expanding = [pair[0] for pair in pairs], [pair[1] for pair in pairs if len(pair) == 2]
        circuit = Circuit(network, inputs, Readout(contracting, expanding, from_mV, to_mV, slope_per_mV), scheme)
        self._currents = _Currents(network)
        super().__init__(circuit, len(pairs) if n_muscles is None else n_muscles, control_timestep_s)
        gates = self.stepper.arrays.gates[: self.stepper.arrays.n_slow]
        self._gates = [(slot, c) for slot, row in enumerate(gates) for c, gate in enumerate(row) if gate != NO_GATE]

    def stride(self, sensation: Sensation, n_steps: int) -> Array:
        """Advances by control steps, as `CircuitController.stride`.

        Raises:
            ConfigError: The run has another control step, too.
        """
        if abs(sensation.time_s - int(self._now["n_steps"]) * self.timestep_s) > 0.5 * self.timestep_s:
            raise ConfigError(
                f"control_timestep_s = {self.timestep_s:g} of the NetworkController must be clock.control_timestep_s "
                "of the run"
            )
        return super().stride(sensation, n_steps)

    def _values(self) -> Values:
        state = self.network_state
        values: dict[str, Any] = {"potential": state.potential[0].copy()}
        if self._gates:
            values["gate"] = np.array([state.gate[0, slot, channel] for slot, channel in self._gates])
        if "sensor_on" in self._now:
            values["switch_on"] = self._now["sensor_on"].astype(np.float64)
        if self._currents.labels:
            values["synaptic_current"] = self._currents.read(state.potential[0])
        return values

    def _coords(self) -> dict[str, list[int] | list[str]]:
        arrays, table = self.stepper.arrays, self.table
        bearers = [arrays.neurons[arrays.channel_neuron[channel]] for _, channel in self._gates]
        labels = {
            "channel": numbered(bearers),
            "switch": [arrays.inputs[place] for place in table.input[table.n_linear :]],
            "connection": self._currents.labels,
        }
        return {**super()._coords(), **{name: each for name, each in labels.items() if each}}

    def _attrs(self) -> dict[str, float | int | str]:
        text = self.circuit.network.to_toml()
        return {"network": text} if len(text) <= LONGEST_TEXT else {}


class _Currents:
    """The currents of all connections, from potentials."""

    def __init__(self, network: Network) -> None:
        place = {name: number for number, name in enumerate(network.neurons)}
        self.labels = numbered(f"{c.source} -> {c.target}" for c in network.connections)
        self._source = np.array([place[c.source] for c in network.connections], dtype=np.intp)
        self._target = np.array([place[c.target] for c in network.connections], dtype=np.intp)
        kinds = [c.kind for c in network.connections]
        self._conductance = np.array([kind.conductance_uS for kind in kinds])
        self._reversal = np.array([getattr(kind, "reversal_mV", np.nan) for kind in kinds])
        self._threshold = np.array([getattr(kind, "threshold_mV", 0.0) for kind in kinds])
        self._slope = 1.0 / (np.array([getattr(kind, "saturation_mV", 1.0) for kind in kinds]) - self._threshold)
        self._junction = np.array([isinstance(kind, GapJunction) for kind in kinds], dtype=bool)
        self._rectified = np.array([getattr(kind, "rectified", False) for kind in kinds], dtype=bool)

    def read(self, potential: Array) -> Array:
        """Returns the current of each into its target, nA."""
        before, after = potential[self._source], potential[self._target]
        opening = np.clip((before - self._threshold) * self._slope, 0.0, 1.0)
        flow = np.where(self._rectified, np.maximum(before - after, 0.0), before - after)
        return self._conductance * np.where(self._junction, flow, opening * (self._reversal - after))

"""A user's own network as a controller."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from annelid.control.circuit import Circuit, Readout
from annelid.control.circuit_controller import CircuitController
from annelid.control.senses import Source
from annelid.errors import ConfigError, require_positive
from annelid.nervous import Network, Scheme
from annelid.protocols import Array, Sensation

LONGEST_TEXT = 60_000
"""Characters of a network that a run file's attribute can hold."""
Output: TypeAlias = str | tuple[str, str]
"""An output of the network, or two, of which the first contracts and the second expands."""


class OwnCircuitController(CircuitController):
    """Steps a circuit of a user's own; recorded are all potentials and slow gates by name, and the network itself."""

    recorded = CircuitController.recorded[:2]

    def _attrs(self) -> dict[str, float | int | str]:
        text = self.circuit.network.to_toml()
        return {"network": text} if len(text) <= LONGEST_TEXT else {}


class NetworkController(OwnCircuitController):
    """Drives a worm by a network of a user's own, as the circuit of it does.

    Example::

        inputs = {f"stretch_{i + 1}": Sense("lengthening_m", i, gain=400.0) for i in range(3)}
        controller = NetworkController(network, inputs, outputs=["motor_1", "motor_2", "motor_3"])
        annelid.simulate("riddle2023-rods", "runs/mine", controller=controller)

    Raises:
        ConfigError: As of `Circuit`, `Readout` and `CircuitController`, or outputs of which some are one and some two.
    """

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
        super().__init__(circuit, len(pairs) if n_muscles is None else n_muscles, control_timestep_s)

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

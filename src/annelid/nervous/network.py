"""A network of neurons that a user builds by name, and all that can be made of it."""

from __future__ import annotations

from typing import Self

import numpy as np

from annelid.nervous.arrays import NetworkArrays, build_arrays
from annelid.nervous.stepper import Scheme, Stepper
from annelid.nervous.toml import read_network, write_network
from annelid.nervous.wiring import Wiring


class Network(Wiring):
    """Neurons, synapses, inputs and outputs, each known by its name; `compile` makes it run.

    All are in the order in which they were added, which is that of the columns of every array of the compiled network.
    They are for reading; the methods add to them, and check what is added.

    Attributes:
        name: What to call the network.
        neurons: The neurons by name.
        initial_mV: The initial potential of every neuron, mV.
        connections: The synapses and gap junctions.
        inputs: The neurons that each input drives.
        outputs: The neuron that each output reads.
    """

    def arrays(self) -> NetworkArrays:
        """Returns the network as frozen arrays.

        Raises:
            ConfigError: The network has no neurons.
        """
        return build_arrays(self)

    def compile(self, timestep_ms: float = 1.0, scheme: Scheme = "euler", n_worms: int = 1) -> Stepper:
        """Returns a stepper that advances ``n_worms`` independent copies of the network at once.

        Args:
            timestep_ms: Step, ms.
            scheme: ``"euler"`` (potentials and gates both from the old state, as in Riddle et al. 2022),
                ``"toolbox"`` (gates first, as SNS-Toolbox does) or ``"heun"`` (second order).
            n_worms: Copies to advance together.

        Raises:
            ConfigError: No neurons, an unknown scheme, or a step or number of copies that is not positive.
        """
        return Stepper(self.arrays(), timestep_ms, scheme, n_worms)

    def stable_timestep_ms(self) -> float:
        """Returns the step above which an Euler step may overshoot and grow: the least ``2 C / G`` of all neurons.

        G counts every synapse, channel and junction as fully open.

        Raises:
            ConfigError: The network has no neurons.
        """
        arrays = self.arrays()
        total = arrays.weights[:, : len(arrays.neurons)].sum(axis=0)
        total += np.abs(arrays.weights[arrays.drive["rectified"], len(arrays.neurons) :]).sum(axis=0)
        return float(np.min(2.0 * arrays.capacitance_nF / np.maximum(total, np.finfo(float).tiny)))

    def to_toml(self) -> str:
        """Returns the network as TOML text, from which `from_toml` makes the same network to the last bit."""
        return write_network(self)

    @classmethod
    def from_toml(cls, text: str) -> Self:
        """Builds a network from TOML text as `to_toml` writes it; fields left out take their defaults.

        Raises:
            ConfigError: No valid TOML, an unknown or missing field, a value of the wrong type, or one that a neuron,
                synapse or network refuses; the sentence names where.
        """
        return read_network(text, cls)

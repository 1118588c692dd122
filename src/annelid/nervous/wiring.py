"""What a network is made of: neurons, connections, inputs and outputs, each by its name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from annelid.errors import ConfigError, require_finite, shown, suggest
from annelid.nervous.neurons import ConnectionKind, GapJunction, Neuron, Synapse


@dataclass(frozen=True, slots=True)
class Connection:
    """A synapse or gap junction between two named neurons.

    Attributes:
        source: Name of the presynaptic neuron.
        target: Name of the postsynaptic neuron.
        kind: What joins them.
    """

    source: str
    target: str
    kind: ConnectionKind


class Wiring:
    """Neurons, connections, inputs and outputs by name, in the order in which they were added: a `Network`'s data."""

    def __init__(self, name: str = "network") -> None:
        self.name = name
        self.neurons: dict[str, Neuron] = {}
        self.initial_mV: dict[str, float] = {}
        self.connections: list[Connection] = []
        self.inputs: dict[str, tuple[str, ...]] = {}
        self.outputs: dict[str, str] = {}

    def add_neuron(self, name: str, neuron: Neuron, initial_mV: float | None = None) -> None:
        """Adds a neuron.

        Args:
            name: Its name.
            neuron: Its properties; one object may serve many names.
            initial_mV: Potential at the start; default: the neuron's rest.

        Raises:
            ConfigError: The name is taken, or is no text; the potential is not finite.
        """
        _refuse_duplicate("neuron", name, self.neurons)
        require_finite(**{f"neuron {shown(name)}: initial_mV": initial_mV})
        self.neurons[name] = neuron
        self.initial_mV[name] = neuron.rest_mV if initial_mV is None else float(initial_mV)

    def add_synapse(self, source: str, target: str, synapse: Synapse) -> None:
        """Adds a synapse; currents of several add up.

        Args:
            source: Name of the presynaptic neuron.
            target: Name of the postsynaptic neuron.
            synapse: Its properties.

        Raises:
            ConfigError: No neuron has one of the names; the sentence suggests the nearest.
        """
        self._require_neurons(source, target)
        self.connections.append(Connection(source, target, synapse))

    def add_gap_junction(self, source: str, target: str, junction: GapJunction) -> None:
        """Adds a gap junction between two neurons; the order matters only for a rectified one.

        Args:
            source: Name of one neuron.
            target: Name of the other.
            junction: Its properties.

        Raises:
            ConfigError: No neuron has one of the names; the sentence suggests the nearest.
        """
        self._require_neurons(source, target)
        self.connections.append(Connection(source, target, junction))

    def add_input(self, name: str, targets: str | Sequence[str]) -> None:
        """Adds an input.

        Args:
            name: Its name.
            targets: Name of the neuron that its current (nA) flows into, or of several, each of which gets all of it.

        Raises:
            ConfigError: The name is taken, or no neuron has the name of a target.
        """
        _refuse_duplicate("input", name, self.inputs)
        neurons = (targets,) if isinstance(targets, str) else tuple(targets)
        self._require_neurons(*neurons)
        self.inputs[name] = neurons

    def add_output(self, name: str, source: str) -> None:
        """Adds an output.

        Args:
            name: Its name.
            source: Name of the neuron whose potential (mV) it reads.

        Raises:
            ConfigError: The name is taken, or no neuron has the name of the source.
        """
        _refuse_duplicate("output", name, self.outputs)
        self._require_neurons(source)
        self.outputs[name] = source

    def _require_neurons(self, *names: str) -> None:
        for name in names:
            if name not in self.neurons:
                hint = suggest(name, self.neurons) if self.neurons else "the network has no neurons yet"
                raise ConfigError(f"unknown neuron {shown(name)}: {hint}")


def _refuse_duplicate(kind: str, name: str, taken: Mapping[str, object]) -> None:
    if name in taken:
        raise ConfigError(f"{kind} {shown(name)} exists already: every {kind} needs a name of its own")
    try:
        name.encode()
    except (UnicodeEncodeError, AttributeError):
        raise ConfigError(f"{kind} {shown(name)}: its name must be a text that can be written as UTF-8") from None

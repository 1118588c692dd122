"""Bridge to SNS-Toolbox (Nourse et al. 2023): its non-spiking networks into ours, and ours into it.

Needs the optional extra: ``pip install "annelid[sns]"``. Traces agree when ours is compiled with
``scheme="toolbox"`` and started with ``gate_start="toolbox"``, at the same time step in ms.

SNS-Toolbox 1.5.2 advances a membrane by ``dt Gm / C`` times the current instead of ``dt / C``, which is right
only for Gm = 1 uS. The import keeps the traces, with the capacitance C / Gm; the export keeps the equation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from annelid.errors import ConfigError, MissingDependency
from annelid.nervous import Channel, GapJunction, Gate, Network, Neuron, Synapse
from annelid.text import numbered

if TYPE_CHECKING:
    from types import ModuleType


def import_network(toolbox_network: Any) -> Network:
    """Turns any non-spiking SNS-Toolbox network into ours.

    Populations become single neurons (``name_0``, ``name_1``, ..); pattern and matrix connections, electrical
    synapses (also rectified), gated channels, biases, inputs and outputs are all carried over, as the
    toolbox's own compiler resolves them. Names that occur more than once are numbered.

    Args:
        toolbox_network: A ``sns_toolbox.networks.Network``.

    Returns:
        The network, everything in the toolbox's order.

    Raises:
        MissingDependency: SNS-Toolbox or torch is not installed.
        ConfigError: The network has spiking neurons or synapses, is no toolbox network, has a neuron without
            leak.
    """
    toolbox = _toolbox()
    if not isinstance(toolbox_network, toolbox.networks.Network):
        raise ConfigError(f"import_network takes a sns_toolbox.networks.Network, not {type(toolbox_network).__name__}")
    title = toolbox_network.params["name"]
    if toolbox_network.params["spiking"]:
        raise ConfigError(f"network {title!r} has spiking neurons or synapses; only non-spiking ones can come over")
    with np.errstate(divide="ignore"):  # it divides by a leak of zero
        model = toolbox_network.compile(dt=1.0, backend="numpy")
    populations = [(population["name"], population["number"]) for population in toolbox_network.populations]
    names = numbered([name if size == 1 else f"{name}_{i}" for name, size in populations for i in range(size)])
    network = Network(title)
    for i, name in enumerate(names):
        leak = float(model.g_m[i])
        if leak == 0.0:
            raise ConfigError(f"neuron {name!r} has no leak, so SNS-Toolbox never moves it: give it one there")
        neuron = Neuron(
            capacitance_nF=float(model.c_m[i]) / leak,
            leak_conductance_uS=leak,
            rest_mV=float(model.V_rest[i]),
            bias_nA=float(model.i_b[i]),
            channels=_channels(model, i),
        )
        network.add_neuron(name, neuron, float(model.V_0[i]))
    for post, pre in np.argwhere(model.g_max_non != 0.0).tolist():
        numbers = (float(matrix[post, pre]) for matrix in (model.g_max_non, model.del_e, model.e_lo, model.e_hi))
        network.add_synapse(names[pre], names[post], Synapse(*numbers))
    if model.electrical:
        for post, pre in np.argwhere(np.triu(model.g_electrical, 1) != 0.0).tolist():
            network.add_gap_junction(names[pre], names[post], GapJunction(float(model.g_electrical[post, pre])))
    if model.electrical_rectified:
        for post, pre in np.argwhere(model.g_rectified != 0.0).tolist():
            if post != pre:
                junction = GapJunction(float(model.g_rectified[post, pre]), rectified=True)
                network.add_gap_junction(names[pre], names[post], junction)

    input_names = numbered([entry["name"] for entry in toolbox_network.inputs for _ in range(entry["size"])])
    for column, name in enumerate(input_names):
        network.add_input(name, [names[i] for i in np.flatnonzero(model.input_connectivity[:, column])])
    outputs = [(entry["name"], populations[entry["source"]][1]) for entry in toolbox_network.outputs]
    output_names = numbered([name for name, size in outputs for _ in range(size)])
    for row, name in enumerate(output_names):
        network.add_output(name, names[int(np.argmax(model.output_voltage_connectivity[row]))])
    return network


def export_network(network: Network) -> Any:
    """Turns our network into a ``sns_toolbox.networks.Network``.

    Capacitances are written as C Gm, so that the toolbox's ``dt Gm / C`` steps our equation.

    Args:
        network: Any network whose neurons all leak.

    Returns:
        The toolbox's network; populations, inputs and outputs in our order and under our names.

    Raises:
        MissingDependency: SNS-Toolbox or torch is not installed.
        ConfigError: Something the toolbox cannot express: two synapses between the same two neurons, an input into
            several neurons, a neuron without leak, or more than one instantaneous or two slow gates in a channel; the
            sentence names it.
    """
    toolbox = _toolbox()
    if not network.neurons:
        raise ConfigError(f"network {network.name!r} has no neurons to export")
    exported = toolbox.networks.Network(name=network.name)
    n_channels = max(len(neuron.channels) for neuron in network.neurons.values())
    for name, neuron in network.neurons.items():
        if neuron.leak_conductance_uS == 0:
            raise ConfigError(f"neuron {name!r} has no leak, and SNS-Toolbox divides by it")
        membrane: dict[str, Any] = {
            "membrane_capacitance": neuron.capacitance_nF * neuron.leak_conductance_uS,
            "membrane_conductance": neuron.leak_conductance_uS,
            "resting_potential": neuron.rest_mV,
            "bias": neuron.bias_nA,
        }
        kind = toolbox.neurons.NonSpikingNeuron
        if neuron.channels:
            kind = toolbox.neurons.NonSpikingNeuronWithGatedChannels
            membrane |= _channel_arguments(name, neuron.channels, n_channels)
        exported.add_neuron(kind(**membrane), name=name, initial_value=network.initial_mV[name])
    pairs = Counter()
    for connection in network.connections:
        kind, source, target = connection.kind, connection.source, connection.target
        if isinstance(kind, Synapse):
            pair = "synapse", source, target
            numbers = kind.conductance_uS, kind.reversal_mV, kind.threshold_mV, kind.saturation_mV
            names = "max_conductance", "reversal_potential", "e_lo", "e_hi"
            synapse = toolbox.connections.NonSpikingSynapse(**dict(zip(names, numbers, strict=True)))
        else:
            pair = (kind.rectified, source, target) if kind.rectified else (False, *sorted((source, target)))
            synapse = toolbox.connections.ElectricalSynapse(kind.conductance_uS, rect=kind.rectified)
        pairs[pair] += 1
        exported.add_connection(synapse, source, target)
    for (_, source, target), count in pairs.items():
        if count > 1:
            raise ConfigError(
                f"{count} connections of one kind join {source!r} and {target!r}; SNS-Toolbox keeps only the last"
            )
    for name, targets in network.inputs.items():
        if len(targets) != 1:
            raise ConfigError(
                f"input {name!r} drives {len(targets)} neurons; an SNS-Toolbox input drives one, so split it"
            )
        exported.add_input(targets[0], name=name)
    for name, source in network.outputs.items():
        exported.add_output(source, name=name)
    return exported


def _toolbox() -> ModuleType:
    try:
        for module in ("connections", "networks", "neurons"):
            import_module(f"sns_toolbox.{module}")
        return import_module("sns_toolbox")
    except ImportError as error:
        raise MissingDependency(
            f"SNS-Toolbox cannot be imported ({error}): install it with  pip install 'annelid[sns]'"
        ) from None


def _channels(model: Any, neuron: int) -> tuple[Channel, ...]:
    """Reads one neuron's channels; a gate of power 0 has no effect and is left out."""
    if not model.gated:
        return ()
    channels = []
    for c in np.flatnonzero(model.g_ion[:, neuron]):
        gates = []
        for letter in "abc":
            values = {key: float(getattr(model, f"{key}_{letter}")[c, neuron]) for key in ("slope", "e", "k", "pow")}
            tau = None if letter == "a" else float(getattr(model, f"tau_max_{letter}")[c, neuron])
            if values["pow"] != 0.0:
                gates.append(Gate(values["slope"], values["e"], values["k"], values["pow"], tau))
        channels.append(Channel(float(model.g_ion[c, neuron]), float(model.e_ion[c, neuron]), tuple(gates)))
    return tuple(channels)


def _channel_arguments(name: str, channels: Sequence[Channel], n_channels: int) -> dict[str, Any]:
    """Keyword arguments of the toolbox's gated neuron, filled up with channels that conduct nothing.

    The toolbox needs the same number of channels in every gated neuron of a network, and plain lists.
    """
    for channel in channels:
        if len(channel.instant_gates) > 1 or len(channel.slow_gates) > 2:
            raise ConfigError(
                f"neuron {name!r} has a channel with {len(channel.instant_gates)} instantaneous and "
                f"{len(channel.slow_gates)} slow gates; SNS-Toolbox has room for one and two"
            )
    none = Gate(slope_per_mV=0.0, power=0.0, time_constant_ms=1.0)
    filled = [*channels, *[Channel(0.0, 0.0)] * (n_channels - len(channels))]
    arguments: dict[str, Any] = {
        "g_ion": [channel.conductance_uS for channel in filled],
        "e_ion": [channel.reversal_mV for channel in filled],
    }
    gates = {
        "a": [(*channel.instant_gates, none)[0] for channel in filled],
        "b": [(*channel.slow_gates, none)[0] for channel in filled],
        "c": [(*channel.slow_gates, none, none)[1] for channel in filled],
    }
    for letter, each in gates.items():
        arguments[f"pow_{letter}"] = [gate.power for gate in each]
        arguments[f"k_{letter}"] = [gate.factor for gate in each]
        arguments[f"slope_{letter}"] = [gate.slope_per_mV for gate in each]
        arguments[f"e_{letter}"] = [gate.midpoint_mV for gate in each]
        if letter != "a":
            arguments[f"tau_max_{letter}"] = [gate.time_constant_ms for gate in each]
    return arguments

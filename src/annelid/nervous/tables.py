"""Networks as Markdown tables, and what a connection does to its target."""

from __future__ import annotations

from typing import Literal

from annelid.markdown import Table, plain_table, words
from annelid.nervous.neurons import GapJunction, Neuron, Synapse
from annelid.nervous.wiring import Connection, Wiring

Effect = Literal["excitatory", "inhibitory", "gap junction", "rectified gap junction"]


def effect_of(network: Wiring, connection: Connection) -> Effect:
    """Returns what a connection does: a reversal potential above its target's rest excites, another inhibits."""
    kind = connection.kind
    if isinstance(kind, GapJunction):
        return "rectified gap junction" if kind.rectified else "gap junction"
    return "excitatory" if kind.reversal_mV > network.neurons[connection.target].rest_mV else "inhibitory"


def markdown_tables(network: Wiring) -> str:
    """Returns neurons, connections, inputs and outputs as Markdown tables."""
    neurons = [
        (
            name,
            *(f"{n:g}" for n in (neuron.capacitance_nF, neuron.leak_conductance_uS, neuron.rest_mV, neuron.bias_nA)),
            f"{network.initial_mV[name]:g}",
            _specials(neuron),
        )
        for name, neuron in network.neurons.items()
    ]
    connections = [(c.source, c.target, effect_of(network, c), *_numbers(c.kind)) for c in network.connections]
    inputs = [(name, ", ".join(targets)) for name, targets in network.inputs.items()]
    tables = {
        f"Neurons ({len(neurons)})": Table(
            ("neuron", "C (nF)", "Gm (uS)", "rest (mV)", "bias (nA)", "start (mV)", "also"), neurons
        ),
        f"Connections ({len(connections)})": Table(
            ("source", "target", "effect", "g (uS)", "E (mV)", "also"), connections
        ),
        "Inputs": Table(("input (nA)", "neurons"), inputs),
        "Outputs": Table(("output (mV)", "neuron"), list(network.outputs.items())),
    }
    parts = [f"## {title}\n\n{plain_table(table)}\n" for title, table in tables.items() if table.rows]
    return "\n".join([f"# {words(network.name)}\n", *parts])


def _specials(neuron: Neuron) -> str:
    return "; ".join(
        f"channel {channel.conductance_uS:g} uS to {channel.reversal_mV:g} mV, "
        + (f"{len(channel.gates)} gates" if len(channel.gates) != 1 else "1 gate")
        + "".join(f", tau {gate.time_constant_ms:g} ms" for gate in channel.slow_gates)
        for channel in neuron.channels
    )


def _numbers(kind: Synapse | GapJunction) -> tuple[str, str, str]:
    """Returns conductance, reversal potential and what else a connection has."""
    if isinstance(kind, GapJunction):
        return f"{kind.conductance_uS:.6g}", "", ""
    reach = f"{kind.threshold_mV:g} to {kind.saturation_mV:g} mV"
    return f"{kind.conductance_uS:.6g}", f"{kind.reversal_mV:g}", reach

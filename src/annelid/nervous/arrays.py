"""The compiled form of a network: frozen arrays, such that one matrix product sums every current.

The right-hand side of every neuron is ``C dU/dt = I - G U``, where both the total conductance G and the current I at
potential zero are linear in a *drive* vector: the open fractions of the presynaptic terminals and of the channels, the
rectified differences and the plain potentials of gap junctions, the constant 1 and the inputs. So
``[G | I] = drive @ weights`` with one constant matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise, zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from annelid.errors import ConfigError
from annelid.nervous import neurons as parts
from annelid.nervous.neurons import Array
from annelid.nervous.wiring import Wiring

# Fills the slots of channels that have fewer gates than others: never moves, and counts as 1.
NO_GATE = parts.Gate(slope_per_mV=0.0, power=0.0)


@dataclass(frozen=True, slots=True)
class NetworkArrays:
    """Parameters of a compiled network; every array is read-only.

    Attributes:
        neurons: Names, ``n_neurons`` of them.
        inputs: Names, ``n_inputs`` of them.
        outputs: Names, ``n_outputs`` of them.
        output_neuron: Neuron that each output reads, ``(n_outputs,)``.
        capacitance_nF: Shape ``(n_neurons,)``.
        initial_mV: Shape ``(n_neurons,)``.
        terminal_neuron: Presynaptic neuron of each distinct terminal, ``(n_terminals,)``.
        terminal_threshold_mV: Shape ``(n_terminals,)``.
        terminal_slope_per_mV: One over saturation minus threshold, ``(n_terminals,)``.
        channel_neuron: Neuron that bears each channel, ``(n_channels,)``.
        gates: The gates by slot and channel, slow slots first.
        n_slow: Number of slow slots.
        rectified_source: Higher side of each rectified gap junction, ``(n_rectified,)``.
        rectified_target: Its other side, same shape.
        drive: Where in the drive vector the entries of each kind lie.
        weights: Shape ``(n_drive, 2 n_neurons)``, conductances (uS) beside currents (nA).
    """

    neurons: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    output_neuron: NDArray[np.intp]
    capacitance_nF: Array
    initial_mV: Array
    terminal_neuron: NDArray[np.intp]
    terminal_threshold_mV: Array
    terminal_slope_per_mV: Array
    channel_neuron: NDArray[np.intp]
    gates: tuple[tuple[parts.Gate, ...], ...]
    n_slow: int
    rectified_source: NDArray[np.intp]
    rectified_target: NDArray[np.intp]
    drive: Mapping[str, slice]
    weights: Array


def build_arrays(network: Wiring) -> NetworkArrays:
    """Writes a network as arrays."""
    if not network.neurons:
        raise ConfigError(f"network {network.name!r} has no neurons: add_neuron comes first")
    index = {name: i for i, name in enumerate(network.neurons)}
    neurons = list(network.neurons.values())
    n = len(neurons)

    ends = [(index[c.source], index[c.target], c.kind) for c in network.connections]
    synapses = [(pre, post, s) for pre, post, s in ends if isinstance(s, parts.Synapse)]
    rectified = [(pre, post, s) for pre, post, s in ends if isinstance(s, parts.GapJunction) and s.rectified]
    plain = [(pre, post, s) for pre, post, s in ends if isinstance(s, parts.GapJunction) and not s.rectified]
    distinct = sorted({(pre, s.threshold_mV, s.saturation_mV) for pre, _, s in synapses})
    terminals = {terminal: place for place, terminal in enumerate(distinct)}
    channels = [(i, channel) for i, neuron in enumerate(neurons) for channel in neuron.channels]
    gates, n_slow = _slots([channel for _, channel in channels])

    kinds = ("terminals", "channels", "rectified", "potentials", "one", "inputs")
    lengths = (len(terminals), len(channels), len(rectified), n * bool(plain), 1, len(network.inputs))
    ends = accumulate(lengths, initial=0)
    drive = {kind: slice(start, end) for kind, (start, end) in zip(kinds, pairwise(ends), strict=True)}
    weights = np.zeros((sum(lengths), 2 * n))

    def rows(kind: str) -> tuple[Array, Array]:
        return weights[drive[kind], :n], weights[drive[kind], n:]

    opened: dict[str, list[tuple[int, int, parts.Synapse | parts.Channel]]] = {
        "terminals": [(terminals[pre, s.threshold_mV, s.saturation_mV], post, s) for pre, post, s in synapses],
        "channels": [(row, neuron, channel) for row, (neuron, channel) in enumerate(channels)],
    }
    for kind, entries in opened.items():
        conductance, current = rows(kind)
        for row, neuron, part in entries:
            conductance[row, neuron] += part.conductance_uS
            current[row, neuron] += part.conductance_uS * part.reversal_mV
    _, current = rows("rectified")
    for row, (source, target, junction) in enumerate(rectified):
        current[row, target] += junction.conductance_uS
        current[row, source] -= junction.conductance_uS
    [leak], [offset] = rows("one")
    _, current = rows("potentials")
    for source, target, junction in plain:
        for here, there in ((source, target), (target, source)):
            current[there, here] += junction.conductance_uS
            leak[here] += junction.conductance_uS
    for i, neuron in enumerate(neurons):
        leak[i] += neuron.leak_conductance_uS
        offset[i] += neuron.leak_conductance_uS * neuron.rest_mV + neuron.bias_nA
    _, current = rows("inputs")
    for row, targets in enumerate(network.inputs.values()):
        for target in targets:
            current[row, index[target]] += 1.0

    return NetworkArrays(
        neurons=tuple(network.neurons),
        inputs=tuple(network.inputs),
        outputs=tuple(network.outputs),
        output_neuron=_frozen([index[source] for source in network.outputs.values()], np.intp),
        capacitance_nF=_frozen([neuron.capacitance_nF for neuron in neurons]),
        initial_mV=_frozen(list(network.initial_mV.values())),
        terminal_neuron=_frozen([pre for pre, _, _ in terminals], np.intp),
        terminal_threshold_mV=_frozen([low for _, low, _ in terminals]),
        terminal_slope_per_mV=_frozen([1.0 / (high - low) for _, low, high in terminals]),
        channel_neuron=_frozen([neuron for neuron, _ in channels], np.intp),
        gates=gates,
        n_slow=n_slow,
        rectified_source=_frozen([source for source, _, _ in rectified], np.intp),
        rectified_target=_frozen([target for _, target, _ in rectified], np.intp),
        drive=drive,
        weights=_frozen(weights),
    )


def _slots(channels: Sequence[parts.Channel]) -> tuple[tuple[tuple[parts.Gate, ...], ...], int]:
    """Arranges gates as (slot, channel), slow slots first, and returns the number of slow slots."""
    slow = zip_longest(*(channel.slow_gates for channel in channels), fillvalue=NO_GATE)
    instant = zip_longest(*(channel.instant_gates for channel in channels), fillvalue=NO_GATE)
    slow = tuple(slow)
    return (*slow, *instant), len(slow)


def _frozen(values: Sequence[float] | Array, kind: type[np.generic] = np.float64) -> NDArray[Any]:
    array = np.array(values, dtype=kind)
    array.flags.writeable = False
    return array

"""The compiled form of a network: frozen arrays, laid out so that one matrix product sums every current.

The right-hand side of every neuron is ``C dU/dt = I - G U``, where both the total conductance ``G`` and the
current ``I`` at potential zero are linear in a *drive* vector: the open fractions of the presynaptic
terminals, the releases of spiking synapses, the open fractions of the channels, the rectified and plain
potentials of gap junctions, the constant 1 and the inputs. So ``[G | I] = drive @ weights`` with one constant
matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from annelid.nervous.neurons import Array, Channel, Gate
from annelid.nervous.synapses import GapJunction, Modulated, ModulatorySynapse, SpikingSynapse, Synapse

if TYPE_CHECKING:
    from annelid.nervous.network import Network

# Fills the slots of channels that have fewer gates than others: never moves, and counts as 1.
_NO_GATE = Gate(slope_per_mV=0.0, power=0.0)


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
        firing_neuron: The neurons that spike, ``(n_firing,)``.
        threshold_mV: Their resting thresholds, ``(n_firing,)``.
        reset_mV: Their potentials after a spike, ``(n_firing,)``.
        adaptation: Threshold gained per mV of depolarisation, ``(n_firing,)``.
        adaptation_time_constant_ms: Shape ``(n_firing,)``.
        rest_mV: Resting potentials of all neurons, ``(n_neurons,)``.
        leak_conductance_uS: Leaks of all neurons, ``(n_neurons,)``.
        release_source: For each distinct release, which of the firing neurons makes it, ``(n_releases,)``.
        release_time_constant_ms: Shape ``(n_releases,)``.
        release_increment: Shape ``(n_releases,)``.
        modulated: Quantity and neuron of each modulation factor, ``n_modulated`` of them.
        log_modulation: Logarithm of each factor when a terminal is open, ``(n_terminals, n_modulated)``.
        rectified_source: Higher side of each rectified gap junction, ``(n_rectified,)``.
        rectified_target: Its other side, same shape.
        has_gap_junctions: Whether the drive holds the plain potentials.
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
    gates: tuple[tuple[Gate, ...], ...]
    n_slow: int
    firing_neuron: NDArray[np.intp]
    threshold_mV: Array
    reset_mV: Array
    adaptation: Array
    adaptation_time_constant_ms: Array
    rest_mV: Array
    leak_conductance_uS: Array
    release_source: NDArray[np.intp]
    release_time_constant_ms: Array
    release_increment: Array
    modulated: tuple[tuple[Modulated, int], ...]
    log_modulation: Array
    rectified_source: NDArray[np.intp]
    rectified_target: NDArray[np.intp]
    has_gap_junctions: bool
    weights: Array

    def drive_slices(self) -> dict[str, slice]:
        """Returns where in the drive vector each kind of entry lies."""
        lengths = {
            "terminals": self.terminal_neuron.size,
            "releases": self.release_source.size,
            "channels": self.channel_neuron.size,
            "rectified": self.rectified_source.size,
            "potentials": len(self.neurons) if self.has_gap_junctions else 0,
            "one": 1,
            "inputs": len(self.inputs),
        }
        slices, start = {}, 0
        for kind, length in lengths.items():
            slices[kind] = slice(start, start + length)
            start += length
        return slices


def build_arrays(network: Network) -> NetworkArrays:
    """Lays a network out as arrays.

    Args:
        network: A network of at least one neuron.

    Returns:
        Its frozen arrays.
    """
    names = tuple(network.neurons)
    index = {name: i for i, name in enumerate(names)}
    n = len(names)

    ends = [(index[c.source], index[c.target], c.kind) for c in network.connections]
    synapses = [(pre, post, s) for pre, post, s in ends if isinstance(s, Synapse)]
    spiking = [(pre, post, s) for pre, post, s in ends if isinstance(s, SpikingSynapse)]
    modulatory = [(pre, post, s) for pre, post, s in ends if isinstance(s, ModulatorySynapse)]
    rectified = [(pre, post, s) for pre, post, s in ends if isinstance(s, GapJunction) and s.rectified]
    plain = [(pre, post, s) for pre, post, s in ends if isinstance(s, GapJunction) and not s.rectified]
    terminals = sorted({(pre, s.threshold_mV, s.saturation_mV) for pre, _, s in [*synapses, *modulatory]})
    releases = sorted({(pre, s.time_constant_ms, s.increment) for pre, _, s in spiking})
    firing = {index[name]: neuron.firing for name, neuron in network.neurons.items() if neuron.firing is not None}
    modulated: tuple[tuple[Modulated, int], ...] = tuple(sorted({(m.quantity, post) for _, post, m in modulatory}))
    log_modulation = np.zeros((len(terminals), len(modulated)))
    for pre, post, m in modulatory:
        row = terminals.index((pre, m.threshold_mV, m.saturation_mV))
        log_modulation[row, modulated.index((m.quantity, post))] += np.log(m.factor)
    channels = [(index[name], channel) for name, neuron in network.neurons.items() for channel in neuron.channels]
    gates, n_slow = _slots([channel for _, channel in channels])

    sizes = (len(terminals), len(releases), len(channels), len(rectified), n if plain else 0, 1, len(network.inputs))
    starts = np.cumsum((0, *sizes))
    conductance = np.zeros((starts[-1], n))
    current = np.zeros((starts[-1], n))

    opened = [(terminals.index((pre, s.threshold_mV, s.saturation_mV)), post, s) for pre, post, s in synapses]
    opened += [
        (starts[1] + releases.index((pre, s.time_constant_ms, s.increment)), post, s) for pre, post, s in spiking
    ]
    for row, post, synapse in opened:
        conductance[row, post] += synapse.conductance_uS
        current[row, post] += synapse.conductance_uS * synapse.reversal_mV
    for row, (neuron, channel) in enumerate(channels, start=starts[2]):
        conductance[row, neuron] = channel.conductance_uS
        current[row, neuron] = channel.conductance_uS * channel.reversal_mV
    for row, (source, target, junction) in enumerate(rectified, start=starts[3]):
        current[row, target] += junction.conductance_uS
        current[row, source] -= junction.conductance_uS
    one = starts[5]
    for source, target, junction in plain:
        for here, there in ((source, target), (target, source)):
            current[starts[4] + there, here] += junction.conductance_uS
            conductance[one, here] += junction.conductance_uS
    for i, neuron in enumerate(network.neurons.values()):
        conductance[one, i] += neuron.leak_conductance_uS
        current[one, i] += neuron.leak_conductance_uS * neuron.rest_mV + neuron.bias_nA
    for row, targets in enumerate(network.inputs.values(), start=starts[6]):
        for target in targets:
            current[row, index[target]] += 1.0

    neurons = list(network.neurons.values())
    return NetworkArrays(
        neurons=names,
        inputs=tuple(network.inputs),
        outputs=tuple(network.outputs),
        output_neuron=_indices([index[source] for source in network.outputs.values()]),
        capacitance_nF=_frozen([neuron.capacitance_nF for neuron in neurons]),
        initial_mV=_frozen(list(network.initial_mV.values())),
        terminal_neuron=_indices([pre for pre, _, _ in terminals]),
        terminal_threshold_mV=_frozen([low for _, low, _ in terminals]),
        terminal_slope_per_mV=_frozen([1.0 / (high - low) for _, low, high in terminals]),
        channel_neuron=_indices([neuron for neuron, _ in channels]),
        gates=gates,
        n_slow=n_slow,
        firing_neuron=_indices(list(firing)),
        threshold_mV=_frozen([f.threshold_mV for f in firing.values()]),
        reset_mV=_frozen([f.reset_mV for f in firing.values()]),
        adaptation=_frozen([f.adaptation for f in firing.values()]),
        adaptation_time_constant_ms=_frozen([f.adaptation_time_constant_ms for f in firing.values()]),
        rest_mV=_frozen([neuron.rest_mV for neuron in neurons]),
        leak_conductance_uS=_frozen([neuron.leak_conductance_uS for neuron in neurons]),
        release_source=_indices([list(firing).index(pre) for pre, _, _ in releases]),
        release_time_constant_ms=_frozen([tau for _, tau, _ in releases]),
        release_increment=_frozen([increment for _, _, increment in releases]),
        modulated=modulated,
        log_modulation=_frozen(log_modulation),
        rectified_source=_indices([source for source, _, _ in rectified]),
        rectified_target=_indices([target for _, target, _ in rectified]),
        has_gap_junctions=bool(plain),
        weights=_frozen(np.hstack([conductance, current])),
    )


def _slots(channels: Sequence[Channel]) -> tuple[tuple[tuple[Gate, ...], ...], int]:
    """Arranges gates as (slot, channel), slow slots first, and returns the number of slow slots."""
    n_slow = max((len(channel.slow_gates) for channel in channels), default=0)
    n_instant = max((len(channel.instant_gates) for channel in channels), default=0)
    columns = []
    for channel in channels:
        slow, instant = channel.slow_gates, channel.instant_gates
        columns.append((*slow, *[_NO_GATE] * (n_slow - len(slow)), *instant, *[_NO_GATE] * (n_instant - len(instant))))
    return tuple(zip(*columns, strict=True)), n_slow


def _frozen(values: Sequence[float] | Array) -> Array:
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


def _indices(values: Sequence[int]) -> NDArray[np.intp]:
    array = np.array(values, dtype=np.intp)
    array.flags.writeable = False
    return array

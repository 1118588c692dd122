"""The C99 of a network or a controller: tables and statements, put into the templates beside this module."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from annelid.control import SENSED, CircuitController
from annelid.errors import ConfigError
from annelid.nervous import NO_GATE, Network, NetworkState, Scheme, Stepper
from annelid.text import numbered
from annelid_lab.firmware.files import Firmware, Real, comment, filled, identifier

LONGEST_NAME = 24
"""Characters of the name with which everything global begins; C99 promises 31 of a whole one."""
N_BLOCKS, STEPS = 16, 300
"""Of the self-test: blocks under one sensation each, and steps of a block."""
MOST_LATE = 4
TOLERANCES = {"double": (1e-6, 0), "float": (0.1, MOST_LATE)}
"""Of the self-test, by type: of potentials, mV, and by how many steps one may be late."""
_SCHEMES: dict[Scheme, str] = {
    "euler": "forward Euler",
    "toolbox": "forward Euler, gates before potentials",
    "heun": "Heun's method",
}
_INTERFACE = re.compile(r"\b(EXP|POW)\(")


@dataclass(frozen=True, slots=True)
class Vectors:
    """What the self-test compares: sensors of every block, and potentials and what is returned at its end."""

    sensed: list[dict[str, NDArray[Any]]] = field(default_factory=list)
    potential: list[NDArray[Any]] = field(default_factory=list)
    returned: list[NDArray[Any]] = field(default_factory=list)

    def add(self, sensed: dict[str, NDArray[Any]], potential: ArrayLike, returned: ArrayLike) -> None:
        """Adds a block with what was there after each of its steps, of which the last few are kept."""
        self.sensed.append(sensed)
        for kept, values in ((self.potential, potential), (self.returned, returned)):
            kept.append(np.array(values)[-MOST_LATE - 1 :])


class Writer:
    """Fills the templates with a network, and with the circuit that it is of, if any."""

    def __init__(
        self,
        network: Network,
        stepper: Stepper,
        start: NetworkState,
        real: Real,
        title: str,
        vectors: Vectors,
        controller: CircuitController | None = None,
    ) -> None:
        self._network, self._stepper, self._start, self._vectors = network, stepper, start, vectors
        self._controller = controller
        self._real: Real = real
        self._title = comment(title)
        name = identifier(title.strip(), LONGEST_NAME).strip("_").lower() or "network"
        self._name = name if name[0].isalpha() else f"n{name}"[:LONGEST_NAME]
        self._tables: list[str] = []

    def firmware(self, returned: str, n_returned: int) -> Firmware:
        """Returns the three texts."""
        words = self._network_words() | self._circuit_words() | self._interface_words(returned, n_returned)
        words["tables"] = "\n".join(self._tables)
        header = filled("firmware.h.txt", words)
        body = filled("firmware.c.txt", words | {"includes": "", "macros": "", "functions": ""})
        used = sorted(set(_INTERFACE.findall(body)))
        words["includes"] = "#include <math.h>\n" if used or "INFINITY" in body else ""
        suffix = "f" if self._real == "float" else ""
        words |= {
            "macros": "".join(f"#define {macro} {macro.lower()}{suffix}\n" for macro in used),
            "functions": f" but {', '.join(macro.lower() + suffix for macro in used)}" if used else "",
        }
        sensors = {name: np.shape(value) for name, value in self._vectors.sensed[0].items()}
        source, self_test = filled("firmware.c.txt", words), filled("firmware_selftest.c.txt", words)
        return Firmware(
            self._name,
            header,
            source,
            self_test,
            self._real,
            sensors,
            (returned, n_returned),
            self._stepper.arrays.neurons,
        )

    # What the templates have of the network.

    @cached_property
    def _gates(self) -> list[tuple[int, int]]:
        """Slot and channel of every gate that is there, slow ones first."""
        rows = enumerate(self._stepper.arrays.gates)
        return [(slot, channel) for slot, row in rows for channel, gate in enumerate(row) if gate != NO_GATE]

    def _network_words(self) -> dict[str, Any]:
        a, stepper = self._stepper.arrays, self._stepper
        n, n_channels, n_terminals = len(a.neurons), len(a.channel_neuron), len(a.terminal_neuron)
        gates = self._gates
        slow = [(slot, channel) for slot, channel in gates if slot < a.n_slow]
        at = {kind: part.start for kind, part in a.drive.items()}
        affine = [n_terminals + slot * n_channels + channel for slot, channel in gates]
        powers = np.array([a.gates[slot][channel].power for slot, channel in gates])
        plain = bool((powers == 1.0).all())
        pairs = plain and n_channels > 0 and len(a.gates) == 2 and a.n_slow == 1 and len(gates) == 2 * n_channels
        whole = bool(np.isin(powers, np.arange(9)).all())

        if n_terminals:
            self._table("terminal_neuron", a.terminal_neuron, "presynaptic neurons of the terminals")
            self._table("terminal_slope", stepper.affine_slope[:n_terminals], "one over their operating ranges, 1/mV")
            self._table("terminal_offset", stepper.affine_offset[:n_terminals])
        if gates:
            self._table("gate_neuron", a.channel_neuron[[channel for _, channel in gates]], "neurons of the gates")
            self._table("gate_slope", stepper.affine_slope[affine], "half their slopes, negative, 1/mV")
            self._table("gate_offset", stepper.affine_offset[affine])
            if not pairs:
                self._table("gate_channel", np.array([channel for _, channel in gates]), "channels of the gates")
            if not plain:
                self._table("gate_power", powers.astype(int) if whole else powers, "exponents of the gates")
        if slow:
            rates = [stepper.gate_rate[slot, 0, channel] for slot, channel in slow]
            self._table("gate_rate", np.array(rates), "step over time constant of the slow gates")
        if len(a.rectified_source):
            self._table("rectified_source", a.rectified_source, "higher sides of rectified gap junctions")
            self._table("rectified_target", a.rectified_target)
        is_sparse = self._weights(stepper.weights, n)
        raised = "raised(%s, gate_power[i])" if whole else "POW(%s, gate_power[i])"
        slow_power, instant_power = "gate[i]", "1 / gate_sum[i]"
        if not plain:
            slow_power, instant_power = raised % slow_power, raised % instant_power
        counts = {
            "n_neurons": n,
            "n_drive": len(stepper.weights),
            "n_terminals": n_terminals,
            "n_channels": n_channels,
            "n_gates": len(gates),
            "n_slow": len(slow),
            "n_rectified": len(a.rectified_source),
        }
        flags = {
            "terminals": n_terminals,
            "gates": gates,
            "slow": slow,
            "instant": len(gates) > len(slow),
            "heun": stepper.scheme == "heun",
            "toolbox": stepper.scheme == "toolbox",
            "gates_last": slow and stepper.scheme != "toolbox",
            "raised": not plain and whole,
            "nothing_seen": not n_terminals and not gates,
            "pairs": pairs,
            "products": n_channels and not pairs,
            "rectified": len(a.rectified_source),
            "potentials": a.drive["potentials"].stop > at["potentials"],
            "sparse": is_sparse,
            "dense": not is_sparse,
        }
        drive_words = ", ".join(kind for kind, part in a.drive.items() if part.stop > part.start)
        return {
            **{name: bool(flag) for name, flag in flags.items()},
            **counts,
            **{f"at_{kind}": start for kind, start in at.items()},
            "slow_power": slow_power,
            "instant_power": instant_power,
            "drive_words": drive_words,
            "gate_parameter": ", const real *gate" if slow else "",
            "gate_now": ", now.gate" if slow else "",
            "gate_ahead": ", gate_ahead" if slow else "",
            "neurons": self._labelled("NEURON", a.neurons, [_of_neuron(self._network, name) for name in a.neurons]),
            "size": f"{n} neurons, {len(self._network.connections)} connections, currents by a "
            f"{'sparse' if is_sparse else 'dense'} table.",
        }

    def _weights(self, weights: NDArray[np.float64], n: int) -> bool:
        """Writes the weights in the smaller form, and returns whether that is the sparse one."""
        conductance, current = weights[:, :n].T, weights[:, n:].T
        used = (conductance != 0.0) | (current != 0.0)
        number = 8 if self._real == "double" else 4
        index = _index_type(max(len(weights), int(used.sum())))[1]
        is_sparse = int(used.sum()) * (2 * number + index) + (n + 1) * index < weights.size * number
        if is_sparse:
            # The entries of each neuron that are used, one neuron after the other.
            neurons, sources = np.nonzero(used)
            first = np.searchsorted(neurons, np.arange(n + 1))
            self._table("drive_first", first, "where the entries of each neuron begin")
            self._table("drive_source", sources)
            self._table("drive_conductance", conductance[used], "times dt / C")
            self._table("drive_current", current[used], "times dt / C")
        else:
            self._table("drive_conductance", conductance, "dt / C times conductances, by neuron and drive")
            self._table("drive_current", current, "dt / C times currents")
        return is_sparse

    def _table(self, name: str, values: ArrayLike, meaning: str = "") -> None:
        array = np.asarray(values)
        kind = "real" if array.dtype.kind == "f" else _index_type(int(array.max(initial=0)))[0]
        shape = "".join(f"[{length}]" for length in array.shape)
        if meaning:
            self._tables.append(f"/* {meaning[0].upper()}{meaning[1:]}. */")
        self._tables.append(f"static const {kind} {name}{shape} = {self._values(array)};")

    def _values(self, values: ArrayLike) -> str:
        """Numbers as C writes them, in braces for every dimension."""
        array = np.asarray(values)
        if array.ndim == 0:
            return self._number(array.item())
        if array.ndim > 1:
            return "{\n" + ",\n".join(f"    {self._values(row)}" for row in array) + "\n}"
        lines = [""]
        for text in map(self._number, array.tolist()):
            if len(lines[-1]) + len(text) > 100:
                lines.append("")
            lines[-1] += f" {text},"
        return ("{" + "\n   ".join(lines)).removesuffix(",") + " }"

    def _number(self, value: float | bool) -> str:
        if isinstance(value, bool | int):
            return str(int(value))
        if abs(value) == np.inf:
            return "INFINITY" if value > 0 else "-INFINITY"
        if self._real == "double":
            return repr(value)
        with np.errstate(over="ignore"):
            single = np.float32(value)
        if not np.isfinite(single):
            raise ConfigError(f"{value:g} is too large for float: export in double")
        text = str(single)
        return f"{text if '.' in text or 'e' in text else text + '.0'}f"

    def _labelled(self, kind: str, names: Sequence[str], meanings: Sequence[str]) -> str:
        """Lines of an enumeration."""
        labels = numbered(map(identifier, names))
        lines = zip(labels, names, meanings, strict=True)
        prefix = f"{self._name.upper()}_{kind}"
        return "\n".join(f"    {prefix}_{label}, /* {comment(name)}: {meaning} */" for label, name, meaning in lines)

    # What they have of the circuit.

    def _circuit_words(self) -> dict[str, Any]:
        names = ("sensing", "linear", "switches", "windows", "expanding", "sigmoid", "line", "clips")
        words: dict[str, Any] = dict.fromkeys(names, False) | {"controller": self._controller is not None}
        words |= {"n_segments": 0, "n_muscles": 0, "per_segment": 0, "n_linear": 0, "n_switches": 0, "read_out": ""}
        if self._controller is None:
            outputs = enumerate(self._stepper.arrays.output_neuron.tolist())
            lines = [f"    activation->output_mV[{place}] = now.potential_mV[{neuron}];" for place, neuron in outputs]
            return words | {"read_out": "\n".join(lines) or "    activation->output_mV[0] = 0;"}
        circuit, table, readout = self._controller.circuit, self._controller.table, self._controller.circuit.readout
        sensed = [[place for place in row if place < self._n_sensed] for row in table.place.tolist()]
        if sensed:
            self._table("row_input", table.input, "inputs that are set, first by what rises linearly, then by switches")
            self._table("row_first", np.cumsum([0, *map(len, sensed)]), "where the places of what each senses begin")
            self._table("row_place", np.array([*chain(*sensed), 0]), "places in the struct of what is sensed")
            self._table("row_gain", table.gain, "nA")
            self._table("row_threshold", table.threshold)
        if table.n_linear:
            self._table("row_span", table.span[: table.n_linear])
            self._table("row_least", table.least[: table.n_linear])
            self._table("row_most", table.most[: table.n_linear])
        if n_switches := len(table.hysteresis):
            self._table("switch_hysteresis", table.hysteresis)
        if windows := bool(table.first.any() or table.end.any()):
            self._table("row_begin", table.first, "steps from which on they act")
            self._table("row_end", table.end, "steps from which on they do not, 0 for always")
        self._table("contracting", circuit.places(readout.contracting), "neurons that the activation goes by")
        if readout.expanding:
            self._table("expanding", circuit.places(readout.expanding), "neurons that are taken off")
        if readout.slope_per_mV is not None:
            self._table("slope_per_mV", np.array(readout.slope_per_mV))
        else:
            for name, number in zip(("low_mV", "high_mV", "length_mV", "offset"), readout.line, strict=True):
                self._table(f"line_{name}", np.array(number))
        return words | {
            "sensing": len(sensed) > 0,
            "linear": table.n_linear > 0,
            "switches": n_switches > 0,
            "windows": windows,
            "expanding": bool(readout.expanding),
            "sigmoid": readout.slope_per_mV is not None,
            "line": readout.slope_per_mV is None,
            "clips": table.n_linear > 0 or readout.slope_per_mV is None,
            "n_segments": circuit.n_segments,
            "n_muscles": circuit.n_segments * self._controller.muscles_per_segment,
            "per_segment": self._controller.muscles_per_segment,
            "n_linear": table.n_linear,
            "n_switches": n_switches,
        }

    @property
    def _n_sensed(self) -> int:
        """Numbers that the circuit senses, which come first in the struct."""
        assert self._controller is not None
        circuit = self._controller.circuit
        return sum(int(np.prod(SENSED[name].shape(circuit.n_segments))) for name in circuit.senses)

    def _interface_words(self, returned: str, n_returned: int) -> dict[str, Any]:
        network, name, a = self._network, self._name, self._stepper.arrays
        prefix, real, n_inputs = name.upper(), f"{name}_real", len(network.inputs)
        targets = [", ".join(map(comment, each)) for each in network.inputs.values()]
        is_controller, sensed = self._controller is not None, self._vectors.sensed[0]
        sensors = [
            f"    {real} {field}{_lengths(value)}; /* {SENSED[field].meaning if field in SENSED else 'by input'} */"
            for field, value in sensed.items()
        ]
        state: dict[str, NDArray[Any]] = {}
        if self._controller is not None and (n_switches := len(self._controller.table.hysteresis)):
            state["sensor_on"] = np.zeros(n_switches)
        parts = [("potential_mV", self._start.potential[0])]
        slow = [(slot, channel) for slot, channel in self._gates if slot < a.n_slow]
        if slow:
            parts.append(("gate", np.array([self._start.gate[0, slot, channel] for slot, channel in slow])))
        start = [f"    {self._values(value)}, /* {label} */" for label, value in [*parts, *state.items()]]
        (tolerance_mV, late), vectors = TOLERANCES[self._real], self._vectors
        potential, back = np.array(vectors.potential)[:, -late - 1 :], np.array(vectors.returned)[:, -late - 1 :]
        blocks = [", ".join(self._values(value) for value in block.values()) or "0" for block in vectors.sensed]
        return {
            "title": self._title,
            "name": name,
            "NAME": prefix,
            "version": version("annelid"),
            "real": self._real,
            "timestep_ms": repr(self._stepper.timestep_ms),
            "scheme_words": _SCHEMES[self._stepper.scheme],
            "inputs": self._labelled("INPUT", list(network.inputs), targets),
            "n_inputs": n_inputs,
            "outputs": self._labelled("OUTPUT", list(network.outputs), [comment(s) for s in network.outputs.values()]),
            "n_outputs": len(network.outputs),
            "sizes": f"\n#define {prefix}_N_MUSCLES {n_returned}\n" if is_controller else "",
            "sensors": "\n".join(sensors) or f"    {real} nothing;",
            "activation": f"    {real} {returned}[{n_returned}]; /* {_RETURNED[returned]} */",
            "state": "\n".join(f"    {real} {label}{_lengths(value)};" for label, value in state.items()),
            "start": "\n".join([*start, "    0 /* n_steps */"]),
            "any_inputs": n_inputs > 0,
            "no_inputs": n_inputs == 0,
            "given": "input_nA" if is_controller and n_inputs else "sensors->input_nA" if sensed and n_inputs else "0",
            "nothing_sensed": not sensed or (not is_controller and not n_inputs),
            "n_steps": N_BLOCKS * STEPS,
            "n_blocks": N_BLOCKS,
            "steps": STEPS,
            "n_returned": n_returned,
            "sensed": "{\n" + ",\n".join(f"    {{{block}}}" for block in blocks) + "\n}",
            "lowest_mV": self._values(potential.min(axis=1)),
            "highest_mV": self._values(potential.max(axis=1)),
            "lowest": self._values(back.min(axis=1)),
            "highest": self._values(back.max(axis=1)),
            "returned": returned,
            "tolerance_mV": f"{tolerance_mV:g}",
            "tolerance": f"{tolerance_mV * (0.1 if is_controller else 1.0):g}",
            "late": f", or what they were up to {late} steps before" if late else "",
        }


_RETURNED = {"activation": "of every muscle, 0 .. 1", "output_mV": "by output"}


def _lengths(value: ArrayLike) -> str:
    return "".join(f"[{length}]" for length in np.shape(value))


def _index_type(most: int) -> tuple[str, int]:
    """The smallest type of a place, and its bytes."""
    return next(
        kind for kind in (("unsigned char", 1), ("unsigned short", 2), ("unsigned long", 4)) if most < 256 ** kind[1]
    )


def _of_neuron(network: Network, name: str) -> str:
    neuron = network.neurons[name]
    kinds = [f"C {neuron.capacitance_nF:g} nF, Gm {neuron.leak_conductance_uS:g} uS, rest {neuron.rest_mV:g} mV"]
    if neuron.bias_nA:
        kinds.append(f"bias {neuron.bias_nA:g} nA")
    if neuron.channels:
        kinds.append(f"{len(neuron.channels)} gated channel{'s' if len(neuron.channels) > 1 else ''}")
    return ", ".join(kinds)

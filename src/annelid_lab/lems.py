"""A network as LEMS, the language that NeuroML 2 is defined in.

The file has one component type, whose equations are those of `annelid.nervous`, and one component with the numbers:
its attributes are the fields of the network's TOML text, ``neuron_1_capacitance_nF="5.0nF"``. It includes no other
file, and runs as it is in pyLEMS and jNeuroML. Cannon et al. 2014, doi:10.3389/fninf.2014.00079.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from annelid.errors import ConfigError, require_finite, require_positive, shown
from annelid.nervous import Network, network_tables

DIMENSIONS = {
    "per_mV": ("per_voltage", {"m": "-1", "l": "-2", "t": "3", "i": "1"}, "3"),
    "mV": ("voltage", {"m": "1", "l": "2", "t": "-3", "i": "-1"}, "-3"),
    "uS": ("conductance", {"m": "-1", "l": "-2", "t": "3", "i": "2"}, "-6"),
    "nF": ("capacitance", {"m": "-1", "l": "-2", "t": "4", "i": "2"}, "-9"),
    "nA": ("current", {"i": "1"}, "-9"),
    "ms": ("time", {"t": "1"}, "-3"),
}
"""Dimension of every unit with which a field may end, its exponents, and the unit's power of ten."""
TYPE, INPUT_CURRENT = "annelid_network", "current_nA"
_SIMULATION = f"""<Lems>
<ComponentType name="OutputColumn">
  <Path name="quantity"/>
  <Simulation><Record quantity="quantity"/></Simulation>
</ComponentType>
<ComponentType name="OutputFile">
  <Text name="path"/><Text name="fileName"/>
  <Children name="columns" type="OutputColumn"/>
  <Simulation><DataWriter path="path" fileName="fileName"/></Simulation>
</ComponentType>
<ComponentType name="Simulation">
  <Parameter name="length" dimension="time"/><Parameter name="step" dimension="time"/>
  <ComponentReference name="target" type="{TYPE}"/>
  <Children name="outputs" type="OutputFile"/>
  <Dynamics><StateVariable name="t" dimension="time"/></Dynamics>
  <Simulation><Run component="target" variable="t" increment="step" total="length"/></Simulation>
</ComponentType>
</Lems>"""
_IN_XML = re.compile("[\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]*")
"""Characters that XML 1.0 can hold."""


def lems_text(
    network: Network,
    currents_nA: Mapping[str, float] | None = None,
    *,
    timestep_ms: float = 0.1,
    duration_ms: float = 1000.0,
) -> str:
    """Returns a network as LEMS text, with every number to the last bit.

    It has a simulation that writes all potentials (V) over time (s) into a file.

    Args:
        network: The network.
        currents_nA: Constant currents of inputs, nA, by their names; 0 for the others.
        timestep_ms: Step, ms.
        duration_ms: Duration, ms.

    Raises:
        ConfigError: The network has no neurons, a time is not positive, or a name has a character that XML cannot hold.
    """
    for check in (require_finite, require_positive):
        check(timestep_ms=timestep_ms, duration_ms=duration_ms)
    if not network.neurons:
        raise ConfigError(f"network {shown(network.name)} has no neurons to export")
    root = ET.Element("Lems")
    ET.SubElement(root, "Target", component="simulation")
    for unit, (dimension, exponents, power) in DIMENSIONS.items():
        ET.SubElement(root, "Dimension", {"name": dimension, **exponents})
        ET.SubElement(root, "Unit", symbol=unit, dimension=dimension, power=power)
    fields = dict(_flat(network_tables(network)))
    for number, name in enumerate(network.inputs, start=1):
        fields[f"input_{number}_{INPUT_CURRENT}"] = float((currents_nA or {}).get(name, 0.0))
    root.append(_type(network, fields))
    root.extend(ET.fromstring(_SIMULATION))
    values = {key: _text(value, _unit(key)) for key, value in fields.items()}
    for key, value in values.items():
        if not _IN_XML.fullmatch(value):
            raise ConfigError(
                f"{key} = {shown(value)} has a character that XML cannot hold, and would be lost: rename it"
            )
    ET.SubElement(root, "Component", {"id": "network", "type": TYPE, **values})
    attributes = {"id": "simulation", "type": "Simulation", "target": "network"}
    times = {"length": f"{duration_ms!r}ms", "step": f"{timestep_ms!r}ms"}
    simulation = ET.SubElement(root, "Component", attributes | times)
    written = ET.SubElement(simulation, "OutputFile", id="potentials", fileName="potentials.dat")
    for number in range(1, len(network.neurons) + 1):
        ET.SubElement(written, "OutputColumn", id=f"neuron_{number}", quantity=f"neuron_{number}_v")
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every number, flag and text of nested tables by a name that is made of the keys, lists counted from 1."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}_")
        elif isinstance(value, Sequence) and not isinstance(value, str):
            for number, item in enumerate(value, start=1):
                if isinstance(item, Mapping):
                    yield from _flat(item, f"{prefix}{key}_{number}_")
                else:
                    yield f"{prefix}{key}_{number}", item
        elif value is not None:
            yield prefix + key, value


def _unit(key: str) -> str:
    """The unit with which a field's name ends, "" for a plain number."""
    return next((unit for unit in DIMENSIONS if key.endswith(f"_{unit}")), "")


def _text(value: Any, unit: str) -> str:
    if isinstance(value, str):
        return value
    return str(value).lower() if isinstance(value, bool) else f"{float(value)!r}{unit}"


def _type(network: Network, fields: Mapping[str, Any]) -> ET.Element:
    """The component type: a parameter for every number, and the equations of all neurons."""
    made = ET.Element("ComponentType", name=TYPE)
    for key, value in fields.items():
        if isinstance(value, str | bool):
            ET.SubElement(made, "Text", name=key)
        else:
            ET.SubElement(
                made, "Parameter", name=key, dimension=DIMENSIONS[unit][0] if (unit := _unit(key)) else "none"
            )
    ET.SubElement(made, "Constant", name="one_per_mV", dimension="per_voltage", value="1per_mV")
    for number in range(1, len(network.neurons) + 1):
        ET.SubElement(made, "Exposure", name=f"neuron_{number}_v", dimension="voltage")
    made.append(_Dynamics(network).element)
    return made


class _Dynamics:
    """The equations of a network."""

    def __init__(self, network: Network) -> None:
        self.element = ET.Element("Dynamics")
        self._states: list[tuple[str, str, str, str]] = []
        place = {name: f"neuron_{number}" for number, name in enumerate(network.neurons, start=1)}
        tables = network_tables(network)
        currents: dict[str, list[str]] = {name: [] for name in place.values()}
        for number, each in enumerate(tables["connection"], start=1):
            here, pre, post = f"connection_{number}", place[each["source"]], place[each["target"]]
            if each["kind"] == "synapse":
                low = f"{here}_threshold_mV"
                # LEMS has no minimum and no maximum, and its step H is not in all simulators.
                self._derived(f"{here}_x", f"({pre}_v - {low}) / ({here}_saturation_mV - {low})")
                self._derived(f"{here}_above_0", f"({here}_x + abs({here}_x)) / 2")
                self._derived(f"{here}_open", f"({here}_above_0 + 1 - abs({here}_above_0 - 1)) / 2")
                currents[post].append(f"{here}_conductance_uS * {here}_open * ({here}_reversal_mV - {post}_v)")
            else:
                difference = f"({pre}_v - {post}_v)"
                if each["rectified"]:
                    difference = f"(({difference} + abs({difference} * one_per_mV) / one_per_mV) / 2)"
                self._derived(f"{here}_current", f"{here}_conductance_uS * {difference}", "current")
                currents[post].append(f"{here}_current")
                currents[pre].append(f"(0 - 1) * {here}_current")
        for number, each in enumerate(tables["input"], start=1):
            for target in each["targets"]:
                currents[place[target]].append(f"input_{number}_{INPUT_CURRENT}")
        for name, neuron in zip(place.values(), tables["neuron"], strict=True):
            self._neuron(name, neuron, currents[name])
        self._finish()

    def _neuron(self, name: str, neuron: Mapping[str, Any], currents: list[str]) -> None:
        terms = [f"{name}_leak_conductance_uS * ({name}_rest_mV - {name}_v)", f"{name}_bias_nA"]
        for number, channel in enumerate(neuron["channels"], start=1):
            here = f"{name}_channels_{number}"
            open_gates = []
            for gate_number, gate in enumerate(channel["gates"], start=1):
                at = f"{here}_gates_{gate_number}"
                closing = f"{at}_factor * exp({at}_slope_per_mV * ({at}_midpoint_mV - {{}}))"
                self._derived(f"{at}_closing", closing.format(f"{name}_v"))
                value = f"(1 / (1 + {at}_closing))"
                if gate["time_constant_ms"] is not None:
                    tau = f"({at}_time_constant_ms * {value} * sqrt({at}_closing))"
                    start = f"1 / (1 + {closing.format(f'{name}_initial_mV')})"
                    self._state(f"{at}_z", "none", start, f"({value} - {at}_z) / {tau}")
                    value = f"{at}_z"
                open_gates.append(f"({value} ^ {at}_power)")
            self._derived(f"{here}_open", " * ".join(open_gates) or "1")
            terms.append(f"{here}_conductance_uS * {here}_open * ({here}_reversal_mV - {name}_v)")
        self._derived(f"{name}_current", " + ".join([*terms, *currents]), "current")
        self._state(f"{name}_v", "voltage", f"{name}_initial_mV", f"{name}_current / {name}_capacitance_nF")

    def _state(self, name: str, dimension: str, start: str, rate: str) -> None:
        self._states.append((name, dimension, start, rate))

    def _derived(self, name: str, value: str, dimension: str = "none") -> None:
        ET.SubElement(self.element, "DerivedVariable", name=name, dimension=dimension, value=value)

    def _finish(self) -> None:
        """Writes states before what is derived of them, then rates and starts."""
        start = ET.Element("OnStart")
        for place, (name, dimension, first, rate) in enumerate(self._states):
            shown_as = {"exposure": name} if name.endswith("_v") else {}
            self.element.insert(place, ET.Element("StateVariable", {"name": name, "dimension": dimension, **shown_as}))
            ET.SubElement(start, "StateAssignment", variable=name, value=first)
            ET.SubElement(self.element, "TimeDerivative", variable=name, value=rate)
        self.element.append(start)

"""Networks as TOML text and back, to the last bit.

One table for each neuron, connection, input and output, whose keys are the fields of the classes, with their units in
the names. The order of the tables is the order in the network.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import MISSING, asdict, fields
from typing import Any, TypeVar

from annelid.errors import ConfigError, require_finite, shown, suggest
from annelid.nervous import neurons
from annelid.nervous.wiring import Wiring
from annelid.textfiles import parse_toml, toml_text

Built = TypeVar("Built", bound=Wiring)

KINDS: dict[str, type[neurons.ConnectionKind]] = {
    "synapse": neurons.Synapse,
    "gap_junction": neurons.GapJunction,
}
"""What a connection's ``kind`` is called in the text."""
CIRCUIT_TABLES = ("sense", "switch", "pulse", "readout")
"""Tables of a controller's text that are beside the network's, and no part of it."""
GONE = {"firing", "spiking_synapse", "modulatory_synapse"}
"""What older texts may have: neurons that spike, and modulation."""


def write_network(network: Wiring) -> str:
    """Returns a network as TOML text; every field is written, defaults too."""
    return toml_text(network_tables(network))


def network_tables(network: Wiring) -> dict[str, Any]:
    """Returns a network as the tables of its text, plain values with every field."""
    names = {kind: name for name, kind in KINDS.items()}
    return {
        "name": network.name,
        "neuron": [
            {"name": name, "initial_mV": network.initial_mV[name], **asdict(neuron)}
            for name, neuron in network.neurons.items()
        ],
        "connection": [
            {"source": each.source, "target": each.target, "kind": names[type(each.kind)], **asdict(each.kind)}
            for each in network.connections
        ],
        "input": [{"name": name, "targets": targets} for name, targets in network.inputs.items()],
        "output": [{"name": name, "source": source} for name, source in network.outputs.items()],
    }


def read_network(text: str, make: type[Built]) -> Built:
    """Builds a network of the class ``make`` from TOML text."""
    document = parse_toml(text, "the network")
    _refuse_unknown(document, {"name", "neuron", "connection", "input", "output", *CIRCUIT_TABLES}, "the network")
    network = make(_string(document.get("name", "network"), "the network's name"))
    for place, entry in _tables(document, "neuron"):
        [name] = _strings(entry, place, "name")
        initial = _number(entry["initial_mV"], f"{place}: initial_mV") if "initial_mV" in entry else None
        network.add_neuron(name, _build(neurons.Neuron, {"name", "initial_mV"}, entry, place), initial)
    for place, entry in _tables(document, "connection"):
        source, target, kind = _strings(entry, place, "source", "target", "kind")
        if kind in GONE:
            raise ConfigError(f"{place}: kind {shown(kind)} has been removed: neurons neither spike nor modulate")
        if kind not in KINDS:
            raise ConfigError(f"{place}: unknown kind {shown(kind)}: {suggest(kind, KINDS)}")
        built = _build(KINDS[kind], {"source", "target", "kind"}, entry, place)
        add = network.add_gap_junction if kind == "gap_junction" else network.add_synapse
        add(source, target, built)
    for place, entry in _tables(document, "input"):
        _refuse_unknown(entry, {"name", "targets"}, place)
        targets = _of_type(list, "a list of names")(_required(entry, "targets", place), f"{place}: targets")
        names = [_string(target, f"{place}: targets") for target in targets]
        network.add_input(_strings(entry, place, "name")[0], names)
    for place, entry in _tables(document, "output"):
        _refuse_unknown(entry, {"name", "source"}, place)
        network.add_output(*_strings(entry, place, "name", "source"))
    return network


def _build(kind: type, others: Collection[str], entry: Any, place: str) -> Any:
    """Makes one of the frozen classes from a table, after naming whatever does not fit."""
    known = {field.name: field for field in fields(kind)}
    _refuse_unknown(_table(entry, place), {*known, *others}, place)
    values: dict[str, Any] = {}
    for name, field in known.items():
        if name in entry or field.default is MISSING:
            values[name] = _READERS.get(name, _number)(_required(entry, name, place), f"{place}: {name}")
    try:
        return kind(**values)
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from None


def _tables(document: Mapping[str, Any], key: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tables of an array, each with words that say where it is."""
    entries = _of_type(list, f"an array of tables, [[{key}]]")(document.get(key, []), key)
    for number, entry in enumerate(entries, start=1):
        name = _table(entry, f"{key} {number}").get("name")
        yield f"{key} {number}" + (f" ({shown(name)})" if name is not None else ""), entry


def _refuse_unknown(entry: Mapping[str, Any], known: Collection[str], place: str) -> None:
    for key in entry:
        if key in GONE:
            raise ConfigError(f"{place}: {key} has been removed: neurons do not spike")
        if key not in known:
            raise ConfigError(f"{place}: unknown field {shown(key)}: {suggest(key, known)}")


def _required(entry: Mapping[str, Any], key: str, place: str) -> Any:
    if key not in entry:
        raise ConfigError(f"{place}: {key} is missing")
    return entry[key]


def _strings(entry: Mapping[str, Any], place: str, *keys: str) -> list[str]:
    return [_string(_required(entry, key, place), f"{place}: {key}") for key in keys]


def _of_type(kind: type, words: str) -> Callable[[Any, str], Any]:
    """A reader that lets values of one type pass."""

    def read(value: Any, place: str) -> Any:
        if not isinstance(value, kind):
            raise ConfigError(f"{place} must be {words}, not {shown(value)}")
        return value

    return read


_string, _table, _array = _of_type(str, "a string"), _of_type(dict, "a table"), _of_type(list, "an array of tables")


def _number(value: Any, place: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigError(f"{place} must be a number, not {shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        raise ConfigError(f"{place} must be a finite number, not {shown(value)}") from None
    require_finite(**{place: number})
    return number


def _several(kind: type) -> Callable[[Any, str], Any]:
    return lambda value, place: tuple(_build(kind, (), part, place) for part in _array(value, place))


_READERS: dict[str, Callable[[Any, str], Any]] = {
    "channels": _several(neurons.Channel),
    "gates": _several(neurons.Gate),
    "rectified": _of_type(bool, "true or false"),
}
"""How fields are read that are no numbers."""

"""Networks as TOML text and back, to the last bit.

One table for each neuron, connection, input and output, whose keys are the fields of the classes, with their units in
the names. The order of the tables is the order in the network.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, asdict, fields
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from annelid.errors import ConfigError, shown, suggest
from annelid.nervous.neurons import Channel, Firing, Gate, Neuron
from annelid.nervous.synapses import ConnectionKind, GapJunction, ModulatorySynapse, SpikingSynapse, Synapse
from annelid.textfiles import parse_toml, toml_text

if TYPE_CHECKING:
    from annelid.nervous.network import Network

KINDS: dict[str, type[ConnectionKind]] = {
    "synapse": Synapse,
    "gap_junction": GapJunction,
    "spiking_synapse": SpikingSynapse,
    "modulatory_synapse": ModulatorySynapse,
}
"""What a connection's ``kind`` is called in the text."""

_NESTED: dict[str, type] = {"channels": Channel, "gates": Gate, "firing": Firing}
_KEYS = {
    "network": {"name", "neuron", "connection", "input", "output"},
    "neuron": {"name", "initial_mV"},
    "connection": {"source", "target", "kind"},
    "input": {"name", "targets"},
    "output": {"name", "source"},
}


def write_network(network: Network) -> str:
    """Returns a network as TOML text; every field is written, defaults too."""
    names = {kind: name for name, kind in KINDS.items()}
    return toml_text(
        {
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
    )


def read_network(text: str, make: type[Network]) -> Network:
    """Builds a network from TOML text.

    Args:
        text: As `write_network` writes it; fields with a default may be left out.
        make: The network's class.

    Returns:
        The network.

    Raises:
        ConfigError: No valid TOML, an unknown or missing field, a value of the wrong type, or one that is refused.
    """
    document = parse_toml(text, "the network")
    _refuse_unknown(document, _KEYS["network"], "the network")
    network = make(_string(document.get("name", "network"), "the network's name"))
    for place, entry in _tables(document, "neuron"):
        name = _string(_required(entry, "name", place), f"{place}: name")
        neuron = _build(Neuron, entry, place, _KEYS["neuron"])
        initial = entry.get("initial_mV")
        network.add_neuron(name, neuron, None if initial is None else _number(initial, f"{place}: initial_mV"))
    for place, entry in _tables(document, "connection"):
        source, target, kind = (
            _string(_required(entry, key, place), f"{place}: {key}") for key in ("source", "target", "kind")
        )
        if kind not in KINDS:
            raise ConfigError(f"{place}: unknown kind {shown(kind)}: {suggest(kind, KINDS)}")
        built = _build(KINDS[kind], entry, place, _KEYS["connection"])
        if isinstance(built, GapJunction):
            network.add_gap_junction(source, target, built)
        else:
            network.add_synapse(source, target, built)
    for place, entry in _tables(document, "input"):
        _refuse_unknown(entry, _KEYS["input"], place)
        targets = _required(entry, "targets", place)
        if not isinstance(targets, list):
            raise ConfigError(f"{place}: targets must be a list of names, not {shown(targets)}")
        names = [_string(target, f"{place}: targets") for target in targets]
        network.add_input(_string(_required(entry, "name", place), f"{place}: name"), names)
    for place, entry in _tables(document, "output"):
        _refuse_unknown(entry, _KEYS["output"], place)
        name, source = (_string(_required(entry, key, place), f"{place}: {key}") for key in ("name", "source"))
        network.add_output(name, source)
    return network


def _build(kind: type, entry: Mapping[str, Any], place: str, others: set[str] | None = None) -> Any:
    """Makes one of the frozen classes from a table, after naming whatever does not fit."""
    known = {field.name: field for field in fields(kind)}
    _refuse_unknown(entry, set(known) | (others or set()), place)
    values: dict[str, Any] = {}
    for name, field in known.items():
        if name not in entry:
            if field.default is MISSING:
                raise ConfigError(f"{place}: {name} is missing")
            continue
        value, where = entry[name], f"{place}: {name}"
        if name in _NESTED:
            many = isinstance(field.default, tuple)
            if not isinstance(value, list if many else dict):
                raise ConfigError(f"{where} must be {'an array of tables' if many else 'a table'}, not {shown(value)}")
            if many:
                values[name] = tuple(_build(_NESTED[name], _table(part, where), where) for part in value)
            else:
                values[name] = _build(_NESTED[name], _table(value, where), where)
        elif name == "quantity":
            values[name] = _string(value, where)
        elif name == "rectified":
            if not isinstance(value, bool):
                raise ConfigError(f"{where} must be true or false, not {shown(value)}")
            values[name] = value
        else:
            values[name] = _number(value, where)
    try:
        return kind(**values)
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from None


def _tables(document: Mapping[str, Any], key: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tables of an array, each with words that say where it is."""
    entries = document.get(key, [])
    if not isinstance(entries, list):
        raise ConfigError(f"{key} must be an array of tables, [[{key}]], not {shown(entries)}")
    for number, entry in enumerate(entries, start=1):
        name = _table(entry, f"{key} {number}").get("name")
        yield f"{key} {number}" + (f" ({shown(name)})" if name is not None else ""), entry


def _table(value: Any, place: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ConfigError(f"{place} must be a table, not {shown(value)}")
    return value


def _required(entry: Mapping[str, Any], key: str, place: str) -> Any:
    if key not in entry:
        raise ConfigError(f"{place}: {key} is missing")
    return entry[key]


def _refuse_unknown(entry: Mapping[str, Any], known: set[str], place: str) -> None:
    for key in entry:
        if key not in known:
            raise ConfigError(f"{place}: unknown field {shown(key)}: {suggest(key, known)}")


def _string(value: Any, place: str) -> str:
    if not isinstance(value, str):
        raise ConfigError(f"{place} must be a string, not {shown(value)}")
    return value


def _number(value: Any, place: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigError(f"{place} must be a number, not {shown(value)}")
    try:
        number = float(value)
    except OverflowError:
        number = inf
    if not isfinite(number):
        raise ConfigError(f"{place} must be a finite number, not {shown(value)}")
    return number

"""A network with its senses and its readout as one TOML text, and the controller that such a text is.

Beside the tables of the network (`annelid.nervous.toml`) the text has a table for each input that is set, with the
fields of `Sense`, `Switch` or `Pulse`, and the table ``[readout]`` with those of `Readout`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, replace
from math import isfinite, isnan
from typing import Any, Literal

from pydantic import Field

from annelid.config.run import RunConfig
from annelid.control.circuit import Circuit, Readout
from annelid.control.circuit_controller import CircuitKind
from annelid.control.network import OwnCircuitController
from annelid.control.senses import Pulse, Sense, Source, Switch
from annelid.control.sns import Sns
from annelid.errors import ConfigError, shown, suggest
from annelid.nervous import Network
from annelid.nervous.toml import CIRCUIT_TABLES, network_tables
from annelid.protocols import Plant
from annelid.textfiles import parse_toml, toml_text

SOURCES: dict[str, type[Any]] = dict(zip(CIRCUIT_TABLES, (Sense, Switch, Pulse), strict=False))
"""What the tables of inputs that are set are called."""
HOW = "annelid export-network PRESET --to toml writes one, and in Python annelid.control.circuit_text"


def circuit_text(circuit: Circuit) -> str:
    """Returns a circuit as TOML text, which `circuit_of_text` reads; fields with their default values are left out.

    Raises:
        ConfigError: An input is set by a function of Python, or the start is drawn at random.
    """
    tables: dict[str, Any] = network_tables(circuit.network) | {name: [] for name in SOURCES}
    names = {kind: name for name, kind in SOURCES.items()}
    for name, given in circuit.inputs.items():
        source = Pulse(float(given), float("inf")) if isinstance(given, int | float) else given
        if type(source) not in names:
            raise ConfigError(f"input {shown(name)} is set by a function of Python, which no text can have")
        tables[names[type(source)]].append({"input": name, **_stated(source)})
    if circuit.random_start_mV is not None:
        raise ConfigError("a start that is drawn at random cannot be written: set controller.start = 'design'")
    start = {"scheme": circuit.scheme, "gate_start": circuit.gate_start}
    return toml_text({**tables, "readout": {**_stated(circuit.readout), **start}})


def circuit_of_text(text: str) -> Circuit:
    """Builds the circuit of a TOML text.

    Raises:
        ConfigError: It is no such text; the sentence names the table and the field.
    """
    document = parse_toml(text, "the network")
    if not isinstance(readout := document.get("readout"), Mapping):
        raise ConfigError(f"the network has no table [readout], which says what drives the muscles: {HOW}")
    inputs: dict[str, Source] = {}
    for table, kind in SOURCES.items():
        entries = document.get(table, [])
        for number, entry in enumerate(entries if isinstance(entries, list) else [entries], start=1):
            place = f"{table} {number}"
            if not isinstance(entry, Mapping) or not isinstance(name := entry.get("input"), str):
                raise ConfigError(f"{place}: input = .. must name the input that it sets")
            if name in inputs:
                raise ConfigError(f"{place}: input {shown(name)} is set twice")
            inputs[name] = _built(kind, {key: value for key, value in entry.items() if key != "input"}, place)
    own = dict(readout)
    start = {name: own.pop(name) for name in ("scheme", "gate_start") if name in own}
    for name, valid in (("scheme", ("euler", "toolbox", "heun")), ("gate_start", ("steady", "toolbox"))):
        if start.get(name, valid[0]) not in valid:
            raise ConfigError(f"readout: {name} = {shown(start[name])}: {suggest(str(start[name]), valid)}")
    return Circuit(Network.from_toml(text), inputs, _built(Readout, own, "readout"), **start)


def _stated(part: Any) -> dict[str, Any]:
    """The fields of a part that differ from their defaults; tuples of names as lists."""
    values = {field.name: (getattr(part, field.name), field.default) for field in fields(part)}
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, (value, default) in values.items()
        if value != default
    }


def _built(kind: type[Any], entry: Mapping[str, Any], place: str) -> Any:
    """Makes a part from a table, after naming whatever does not fit."""
    known = {field.name: field for field in fields(kind)}
    for name, value in entry.items():
        if name not in known:
            raise ConfigError(f"{place}: unknown field {shown(name)}: {suggest(name, known)}")
        wanted = _WANTED.get(name, (int, float))
        if isinstance(value, bool) or not isinstance(value, wanted):
            raise ConfigError(f"{place}: {name} = {shown(value)} must be {_WORDS.get(name, 'a number')}")
        if name in _WORDS and isinstance(value, list) and not all(type(one) is _OF[name] for one in value):
            raise ConfigError(f"{place}: {name} = {shown(value)} must be {_WORDS[name]}")
        if isinstance(value, float) and (isnan(value) or not (isfinite(value) or name in _UNBOUNDED)):
            raise ConfigError(f"{place}: {name} = {shown(value)} must be a finite number")
        if name == "place" and (value == [] or min(value if isinstance(value, list) else [value]) < 0):
            raise ConfigError(f"{place}: {name} = {shown(value)} must be {_WORDS[name]}")
    for name, field in known.items():
        if name not in entry and field.default is MISSING:
            raise ConfigError(f"{place}: {name} is missing")
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in entry.items()}
    try:
        return kind(**values)
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from None


_WANTED: dict[str, Any] = {"quantity": str, "place": (int, list), "contracting": list, "expanding": list}
_UNBOUNDED = {"least_nA", "most_nA", "until_s"}
_OF = {"place": int, "contracting": str, "expanding": str}
_WORDS = {
    "quantity": "a text in quotes",
    "place": "a number counted from 0, or a list of such",
    "contracting": "a list of outputs",
    "expanding": "a list of outputs",
}


class NetworkFile(CircuitKind):
    """A network of your own with its senses and its readout, as ``annelid run --network FILE.toml`` reads it.

    The tolerance of the section `sensor` acts with an empty text only: else the text has the thresholds.
    """

    sensor_fields = frozenset({"noise_m"})
    cites = (("riddle2022", "the neurons"),)
    kind: Literal["network"] = "network"
    text: str = Field(default="", max_length=1_000_000, description=f"the TOML text: {HOW}; empty: the paper's network")

    def check_with(self, config: RunConfig) -> None:
        """Checks the text, and its number of segments against the body's."""
        try:
            n_segments = self.circuit(config, config.body.n_segments).n_segments
        except ConfigError as error:
            raise ValueError(f"controller.text: {error}") from None
        if n_segments != config.body.n_segments:
            raise ValueError(
                f"controller.text: the readout drives {n_segments} segments, and the body has "
                f"{config.body.n_segments}: name an output for each in readout.contracting"
            )

    def circuit(self, config: RunConfig, n_segments: int) -> Circuit:
        """Returns the circuit, as `CircuitKind.circuit`."""
        return circuit_of_text(self.text) if self.text else replace(Sns().circuit(config, n_segments), constants={})

    def build(self, config: RunConfig, plant: Plant) -> OwnCircuitController:
        """Builds the controller, as `ControllerKind.build`, which records all of the network by name."""
        circuit = self.circuit(config, plant.n_segments)
        return OwnCircuitController(circuit, plant.n_muscles, config.clock.control_timestep_s)


def differing_networks(configs: Sequence[RunConfig], lacking: Any) -> dict[str, tuple[Any, ...]] | None:
    """Finds in what networks of worms differ, where one of them is from a file, value by value.

    Args:
        configs: The worms.
        lacking: Stands for a value that a network does not have.

    Returns:
        Values by what they are of, as ``synapse a to b: conductance_uS``; None without a network from a file, or where
        a controller is no circuit.
    """
    kinds = [config.controller for config in configs]
    if not any(isinstance(kind, NetworkFile) for kind in kinds) or not all(isinstance(k, CircuitKind) for k in kinds):
        return None
    # Only a file states thresholds; those of a preset follow from its body.
    senses = all(isinstance(kind, NetworkFile) and kind.text for kind in kinds)
    own = [_network_values(config, senses=senses) for config in configs]
    rows = {name: tuple(one.get(name, lacking) for one in own) for name in dict.fromkeys(n for one in own for n in one)}
    return {name: values for name, values in rows.items() if any(value != values[0] for value in values)}


def _network_values(config: RunConfig, *, senses: bool) -> dict[str, Any]:
    """All values of a network by what they are of; with ``senses`` also those of senses and readout, of its text."""
    kind: Any = config.controller
    tables = network_tables(kind.circuit(config, config.body.n_segments).network)
    if senses:
        tables |= {name: one for name, one in parse_toml(kind.text, "the network").items() if name in CIRCUIT_TABLES}
    values: dict[str, list[Any]] = {}
    for table, entries in tables.items():
        for entry in [entries] if isinstance(entries, Mapping) else entries if isinstance(entries, list) else []:
            own, label = dict(entry), f"{table} {entry.get('name', entry.get('input', ''))}".strip()
            if table == "connection":
                label = f"{own.pop('kind')} {own.pop('source')} to {own.pop('target')}"
            for field, value in own.items():
                if field not in ("name", "input"):
                    values.setdefault(f"{label}: {field}", []).append(value)
    # Several connections of one kind may join the same two neurons.
    return {name: of_all[0] if len(of_all) == 1 else of_all for name, of_all in values.items()}

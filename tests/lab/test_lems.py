"""Networks as LEMS: read back to the last bit, run by pyLEMS to the same potentials, and read warily."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from typer.testing import CliRunner

from annelid.cli import app
from annelid.errors import ConfigError
from annelid.nervous import (
    Channel,
    GapJunction,
    Gate,
    Network,
    Neuron,
    PeristalsisParameters,
    Synapse,
    peristalsis_network,
)
from annelid.nervous.toml import network_tables
from annelid_lab.lems import lems_text, read_lems

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def benchmark() -> Iterator[ModuleType]:
    names = ("other_simulators", "firmware")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield importlib.import_module("other_simulators")
    for name in names:
        sys.modules.pop(name, None)


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "network.xml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def all_parts() -> Network:
    """A network with every part, and names that need care."""
    network = Network('<a & "b">\n')
    gate = Gate(0.05, 20.0, 0.5, 2.0, 300.0)
    network.add_neuron("a", Neuron(channels=(Channel(0.1 + 0.2, 110.0, (gate, Gate(-0.1, factor=0.0))),)), 1 / 3)
    network.add_neuron("ä\t'", Neuron(bias_nA=10.0))
    network.add_synapse("a", "ä\t'", Synapse(0.5, -40.0))
    network.add_gap_junction("a", "ä\t'", GapJunction(0.1))
    network.add_gap_junction("a", "ä\t'", GapJunction(0.1, rectified=True))
    network.add_input("none", [])
    network.add_input("both", ["a", "ä\t'"])
    network.add_output("out", "a")
    return network


@pytest.mark.parametrize(
    "make", [all_parts, lambda: peristalsis_network(6, PeristalsisParameters(bifurcation_mV=0.03))]
)
def test_a_network_is_read_back_to_the_last_bit(make: Callable[[], Network], file: Callable[[str], Path]) -> None:
    assert network_tables(read_lems(file(lems_text(make())))) == network_tables(make())


def test_random_networks_are_read_back(benchmark: ModuleType, file: Callable[[str], Path]) -> None:
    for seed in range(30):
        network = benchmark.random_network(seed)
        assert network_tables(read_lems(file(lems_text(network)))) == network_tables(network)


def test_pylems_computes_the_same_potentials(benchmark: ModuleType, tmp_path: Path) -> None:
    found = benchmark.difference_mV(peristalsis_network(3), benchmark.PYLEMS, tmp_path, 0.5, 200.0)
    assert found < 1e-9
    for network in (all_parts(), benchmark.random_network(7)):
        assert benchmark.difference_mV(network, benchmark.PYLEMS, tmp_path, 0.1, 100.0) < 1e-9


@pytest.mark.slow
def test_jneuroml_computes_the_same_potentials(benchmark: ModuleType, tmp_path: Path) -> None:
    command = benchmark.jneuroml()
    if command is None:
        pytest.skip("needs Java and pyNeuroML")
    # It writes seven digits.
    for network in (peristalsis_network(3), all_parts(), benchmark.random_network(7)):
        assert benchmark.difference_mV(network, command, tmp_path, 0.5, 500.0) < 1e-5


def test_numbers_and_names_may_be_edited(file: Callable[[str], Path]) -> None:
    text = lems_text(peristalsis_network(3)).replace(
        'neuron_1_capacitance_nF="5.0nF"', 'neuron_1_capacitance_nF=" 7 nF"'
    )
    assert next(iter(read_lems(file(text)).neurons.values())).capacitance_nF == 7.0


BOMB = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "bbbbbbbb"><!ENTITY c "&b;&b;">]><Lems>&c;</Lems>'
EXTERNAL = '<?xml version="1.0"?><!DOCTYPE a SYSTEM "http://example.org/a.dtd"><Lems/>'
REFUSED: dict[str, tuple[Callable[[str], str], str]] = {
    "entities": (lambda _: BOMB, "document type"),
    "an external DTD": (lambda _: EXTERNAL, "document type"),
    "an include": (lambda text: text.replace("<Lems>", '<Lems><Include file="/etc/passwd"/>'), "includes another file"),
    "another root": (lambda _: "<neuroml/>", "begins with <neuroml>"),
    "no XML": (lambda _: "[[neuron]]", "not valid XML"),
    "no network": (lambda _: "<Lems/>", "one component"),
    "another type": (lambda _: '<Lems><Component id="a" type="iafCell"/></Lems>', "iafCell"),
    "one more component": (
        lambda text: text.replace("</Lems>", '<Component id="a" type="iafCell"/></Lems>'),
        "annelid_network, iafCell",
    ),
    "other equations": (lambda text: text.replace("exp(", "2 * exp("), "ComponentType .* not what annelid writes"),
    "other units": (lambda text: text.replace('power="-9"', 'power="-12"'), "Unit .* not what annelid writes"),
    "a word as a number": (lambda text: text.replace('"5.0nF"', '"five nF"', 1), "must be a number in nF"),
    "another unit": (lambda text: text.replace('"5.0nF"', '"5.0pF"', 1), "must be a number in nF"),
    "an infinite number": (lambda text: text.replace('"5.0nF"', '"1e999nF"', 1), "finite"),
    "a long number": (lambda text: text.replace('"5.0nF"', f'"{"1" * 200}nF"', 1), "must be a number"),
    "an unknown neuron": (
        lambda text: re.sub('connection_1_source="[^"]*"', 'connection_1_source="x"', text),
        "unknown",
    ),
    "a gap in the numbers": (lambda text: text.replace(" neuron_2_", " neuron_9999999_"), "none may be missing"),
    "an unknown attribute": (lambda text: text.replace(' type="annelid', ' colour="red" type="annelid'), "colour"),
    "a field within a number": (
        lambda text: text.replace(' type="annelid', ' input_1_targets_1_x="y" type="annelid'),
        "input_1_targets_1_x",
    ),
    "a number as an input": (lambda text: text.replace(' type="annelid', ' input_99="y" type="annelid'), "none may be"),
    "too many levels": (lambda _: "<Lems>" + "<a>" * 20 + "</a>" * 20 + "</Lems>", "nested deeper"),
}


def test_a_strange_file_is_refused_with_a_sentence(subtests: pytest.Subtests, file: Callable[[str], Path]) -> None:
    for what in REFUSED:
        with subtests.test(f"{what!r:.60}"):
            change, sentence = REFUSED[what]
            text = lems_text(peristalsis_network(3))
            assert change(text) != text
            with pytest.raises(ConfigError, match=sentence):
                read_lems(file(change(text)))


def test_a_large_file_is_refused(file: Callable[[str], Path]) -> None:
    with pytest.raises(ConfigError, match="too long"):
        read_lems(file("<Lems>" + " " * 9_000_000))


def test_what_would_be_lost_is_said() -> None:
    network = Network("bell")
    network.add_neuron("ring\x07", Neuron())
    with pytest.raises(ConfigError, match=r"neuron_1_name .* XML cannot hold, and would be lost"):
        lems_text(network)
    with pytest.raises(ConfigError, match="no neurons"):
        lems_text(Network("empty"))


def test_the_command_writes_and_reads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke
    assert run(app, ["export-network", "riddle2022-planar", "--to", "lems"]).exit_code == 0
    assert run(app, ["export-network", "network.xml", "--to", "toml"]).exit_code == 0
    assert run(app, ["export-network", "network.toml", "--to", "lems", "-o", "again.xml"]).exit_code == 0
    assert (tmp_path / "network.xml").read_text() == (tmp_path / "again.xml").read_text()
    network = Network.from_toml((tmp_path / "network.toml").read_text())
    assert list(network.neurons) == list(peristalsis_network(3).neurons)
    assert run(app, ["export-network", "network.xml", "--to", "toml"]).exit_code != 0, "it exists"
    for arguments in (["--to", "nir"], ["--to", "lems", "--scheme", "heun"], ["--to", "toml", "--timestep-ms", "1"]):
        assert run(app, ["export-network", "network.xml", *arguments]).exit_code == 2


def test_times_of_the_simulation_are_checked(subtests: pytest.Subtests) -> None:
    for value in (np.inf, np.nan, 0.0):
        with subtests.test(f"{value!r:.60}"), pytest.raises(ConfigError, match="timestep_ms"):
            lems_text(peristalsis_network(3), timestep_ms=value)

"""Networks as LEMS: every number to the last bit, run by pyLEMS to the same potentials."""

from __future__ import annotations

import importlib
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
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
    Synapse,
    peristalsis_network,
)
from annelid_lab.lems import lems_text

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def benchmark() -> Iterator[ModuleType]:
    names = ("other_simulators", "firmware")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield importlib.import_module("other_simulators")
    for name in names:
        sys.modules.pop(name, None)


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


def test_every_number_is_written_to_the_last_bit() -> None:
    component = ET.fromstring(lems_text(all_parts()).encode()).find("Component[@id='network']")
    assert component is not None
    conductance = component.attrib["neuron_1_channels_1_conductance_uS"]
    assert float(conductance.removesuffix("uS")) == 0.1 + 0.2
    assert float(component.attrib["neuron_1_initial_mV"].removesuffix("mV")) == 1 / 3
    assert component.attrib["neuron_2_name"] == "ä\t'"


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


def test_what_would_be_lost_is_said() -> None:
    network = Network("bell")
    network.add_neuron("ring\x07", Neuron())
    with pytest.raises(ConfigError, match=r"neuron_1_name .* XML cannot hold, and would be lost"):
        lems_text(network)
    with pytest.raises(ConfigError, match="no neurons"):
        lems_text(Network("empty"))


def test_the_command_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke
    assert run(app, ["export-network", "riddle2022-planar", "--to", "lems"]).exit_code == 0
    assert run(app, ["export-network", "riddle2022-planar", "--to", "toml"]).exit_code == 0
    assert run(app, ["export-network", "network.toml", "--to", "lems", "-o", "again.xml"]).exit_code == 0
    assert (tmp_path / "network.xml").read_text() == (tmp_path / "again.xml").read_text()
    network = Network.from_toml((tmp_path / "network.toml").read_text())
    assert list(network.neurons) == list(peristalsis_network(3).neurons)
    assert run(app, ["export-network", "network.toml", "--to", "toml"]).exit_code != 0, "it exists"
    for arguments in (["--to", "nir"], ["--to", "lems", "--scheme", "heun"], ["--to", "toml", "--timestep-ms", "1"]):
        assert run(app, ["export-network", "network.toml", *arguments]).exit_code == 2


def test_times_of_the_simulation_are_checked(subtests: pytest.Subtests) -> None:
    for value in (np.inf, np.nan, 0.0):
        with subtests.test(f"{value!r:.60}"), pytest.raises(ConfigError, match="timestep_ms"):
            lems_text(peristalsis_network(3), timestep_ms=value)

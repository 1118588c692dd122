"""A network with senses and readout as text drives a worm as the preset that it is of, and says what does not fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from annelid import open_run
from annelid.config import load_config
from annelid.control import CircuitKind, circuit_of_text, circuit_text
from annelid.errors import ConfigError
from outcome import Command


@pytest.mark.parametrize("preset", ["riddle2022-planar", "riddle2025-adaptive", "crawler"])
def test_a_circuit_is_read_back_as_it_was(preset: str) -> None:
    config = load_config(preset)
    assert isinstance(config.controller, CircuitKind)
    circuit = config.controller.circuit(config, config.body.n_segments)
    again = circuit_of_text(circuit_text(circuit))
    assert circuit_text(again) == circuit_text(circuit)
    assert again.network.to_toml() == circuit.network.to_toml()
    assert list(again.inputs) == sorted(circuit.inputs, key=list(again.inputs).index)


def test_a_run_of_an_exported_network_is_the_presets_and_an_edited_synapse_acts(annelid: Command) -> None:
    assert annelid("export-network", "riddle2022-planar", "--to", "toml", "-o", "net.toml").exit_code == 0
    text = Path("net.toml").read_text()
    weaker = text.replace("conductance_uS = 0.5166527546484051", "conductance_uS = 0.4", 1)
    Path("weaker.toml").write_text(weaker)
    short = ("riddle2022-planar", "--duration", "1", "--no-video", "-q")
    for name, words in {"own": ("--network", "net.toml"), "weaker": ("--network", "weaker.toml"), "preset": ()}.items():
        done = annelid("run", *short, *words, "-o", name)
        assert done.exit_code == 0, done.err
    own, edited, preset = (open_run(name).data["potential"].values for name in ("own", "weaker", "preset"))
    assert np.array_equal(own, preset)
    assert weaker != text
    assert not np.array_equal(edited, preset)


def test_what_is_no_controller_is_refused_with_its_place(subtests: pytest.Subtests) -> None:
    config = load_config("riddle2022-planar")
    text = circuit_text(config.controller.circuit(config, 3))  # type: ignore[attr-defined]
    for change, words in (
        (("[readout]", "[[pulse]]\ninput = 'x'\n[ignored]"), "has no table .readout."),
        (("quantity = ", "quantiti = "), "switch 1: unknown field 'quantiti': did you mean 'quantity'"),
        (("place = 0", "place = 0.5"), "switch 1: place = 0.5 must be a number counted from 0"),
        (("place = 0", "place = -1"), "switch 1: place = -1 must be a number counted from 0"),
        (("from_mV = -20.0", "from_mV = nan"), "readout: from_mV = nan must be a finite number"),
        (('input = "stretch_2"', 'input = "stretch_1"'), "switch 2: input 'stretch_1' is set twice"),
        (('input = "stretch_2"', 'input = "strech_2"'), "no input 'strech_2': did you mean 'stretch_2'"),
        (('scheme = "euler"', 'scheme = "eule"'), "readout: scheme = 'eule': did you mean 'euler'"),
        (('["contraction_1", ', "["), "expand and 2 contract"),
    ):
        own = {"controller.kind": "network", "controller.text": text.replace(*change, 1)}
        with subtests.test(words), pytest.raises(ConfigError, match=f"controller.text: .*{words}"):
            load_config("riddle2022-planar", own)
    with pytest.raises(ConfigError, match="the readout drives 3 segments, and the body has 4"):
        load_config("riddle2022-planar", {"body.n_segments": 4, "controller.kind": "network", "controller.text": text})

from __future__ import annotations

import json

import pytest

from outcome import Command


def test_json_holds_the_numbers_and_nothing_else(annelid: Command) -> None:
    done = annelid("study", "limit-cycle", "--json", "--neuron", "contraction_2", "--threshold", "12")
    read = json.loads(done.out)
    assert (read["name"], read["n_segments"]) == ("riddle2022-planar", 3)
    assert read["period_s"] == pytest.approx(2.622, abs=0.003)
    response = read["phase_response_s"]
    assert len(response) == len(read["phase_s"])
    assert len(response[0]) == len(read["states"]) == 21


def test_bad_input_ends_in_one_sentence(annelid: Command) -> None:
    done = annelid("study", "limit-cycle", "--neuron", "contractoin_1")
    assert done.exit_code == 2
    assert "did you mean 'contraction_1'" in done.sentence()

"""Runs side by side: differences, the fields that differ, and worms of different kinds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from annelid.analysis import summary
from annelid.analysis.comparison import LACKING, compare, differing_fields, relative_difference, run_labels
from annelid.config import load_config
from annelid.control import Sns, circuit_text
from annelid.draw.summary_table import fields_table
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run

NUMBERS = st.floats(-1e6, 1e6).filter(lambda x: x == 0 or abs(x) > 1e-6)


@pytest.fixture(scope="module")
def rods(tmp_path_factory: pytest.TempPathFactory) -> Run:
    config = load_config("riddle2023-rods", {"duration_s": 0.1, "body.mesh.n_segments": 4})
    return simulate(config, tmp_path_factory.mktemp("two") / "rods", progress=False)


@given(NUMBERS, NUMBERS)
def test_a_difference_takes_the_first_to_the_other(first: float, other: float) -> None:
    share = relative_difference(first, other)
    if first == 0:
        assert share is None
    else:
        assert isinstance(share, float)
        assert first + share * abs(first) == pytest.approx(other, abs=1e-6 * max(abs(first), abs(other)))


@given(st.lists(st.none() | NUMBERS, max_size=5), st.lists(st.none() | NUMBERS, max_size=5))
def test_differences_go_segment_by_segment_or_not_at_all(one: list[float | None], other: list[float | None]) -> None:
    shares = relative_difference(one, other)
    if len(one) != len(other):
        assert shares is None
    else:
        assert shares == [relative_difference(a, b) for a, b in zip(one, other, strict=True)]


def test_what_cannot_be_compared_is_none() -> None:
    assert {relative_difference(None, 1.0), relative_difference(1.0, None), relative_difference(1.0, [1.0])} == {None}


def test_worms_of_different_kinds_stand_side_by_side(planar_run: Run, rods: Run) -> None:
    both = compare([planar_run, rods])
    assert both.labels == ("planar", "rods")
    assert both.numbers["ring_length_min_m"] == tuple(summary(run).ring_length_min_m for run in (planar_run, rods))
    assert both.numbers["pin_gap_max_m"] == (None, None)
    assert both.numbers["travel_m"] == (None, summary(rods).travel_m)
    assert both.numbers["energy_muscle_work_J"][1] == summary(rods).energy_muscle_work_J
    assert both.differences("travel_m") == [None, None]
    assert both.differences("elongation_mean_max_m") == [None, None], "three and four segments"
    assert both.fields["body.kind"] == ("riddle2022", "worm")
    assert both.fields["arena.friction"] == (LACKING, 1.0)
    written = json.loads(json.dumps(both.to_dict(), allow_nan=False))["configuration"]
    assert written["body.kind"] == ["riddle2022", "worm"]
    assert written["arena.friction"] == [None, 1.0]


def test_exactly_the_fields_that_were_changed_differ() -> None:
    changes = {"arena.friction": 0.3, "controller.gate_time_constant_ms": 200.0, "name": "other"}
    base = load_config("riddle2023-rods")
    fields = differing_fields([base, load_config("riddle2023-rods", changes), base])
    assert set(fields) == {"arena.friction", "controller.gate_time_constant_ms"}
    assert fields["arena.friction"] == (1.0, 0.3, 1.0)


def test_labels_are_as_much_of_the_paths_as_tells_them_apart(planar_run: Run) -> None:
    def at(*paths: str) -> list[Run]:
        return [replace(planar_run, path=Path(path) / "run.nc") for path in paths]

    assert run_labels(at("/a/one", "/a/two")) == ("one", "two")
    assert run_labels(at("/a/one", "/b/one")) == ("a/one", "b/one")
    assert run_labels(at("/a/one", "/a/one")) == ("one (1)", "one (2)")


def test_networks_from_files_are_compared_part_by_part(rods: Run) -> None:
    before = rods.config
    text = circuit_text(Sns().circuit(before, 4))
    head, of_connection, rest = text.partition("[[connection]]")
    whole = next(line for line in rest.splitlines() if line.startswith("conductance_uS"))
    changed = head + of_connection + rest.replace(whole, "conductance_uS = 0.1", 1)
    of_file = [load_config("riddle2023-rods", _network(one)) for one in (text, changed)]
    runs = [replace(rods, config=config) for config in (before, *of_file)]
    assert compare(runs[:1] * 2).network is None
    assert compare(runs[:2]).network == {}
    assert fields_table(compare(runs[:2])).count("the networks are the same") == 1
    [(row, values)] = (compare(runs[1:]).network or {}).items()
    assert row.endswith(": conductance_uS")
    assert values == (float(whole.partition("=")[2]), 0.1)
    assert "name =" not in fields_table(compare(runs))


def _network(text: str) -> dict[str, object]:
    return {"body.mesh.n_segments": 4, "duration_s": 0.1, "controller.kind": "network", "controller.text": text}

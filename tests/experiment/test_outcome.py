from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from annelid.analysis import rhythm_score, summary
from annelid.experiment.case import Case
from annelid.experiment.outcome import outcome, read_outcome, write_outcome
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run
from annelid_studies.worms import FAST, RODS, one_after_the_other

HOLD_S, REST_S = 0.3, 0.2
PROGRAM = one_after_the_other(hold_s=HOLD_S, rest_s=REST_S)


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A worm with soft crossings whose segments contract one after the other."""
    return simulate(Case(FAST, PROGRAM).config, tmp_path_factory.mktemp("held"), progress=False)


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A worm with rigid crossings, its run over in the middle of the third contraction."""
    case = Case(RODS, {**PROGRAM, "duration_s": 1.15})
    return simulate(case.config, tmp_path_factory.mktemp("cut"), progress=False)


def test_an_outcome_is_written_and_read_back_whole(held: Run, tmp_path: Path) -> None:
    read = outcome(held)
    assert read.holds
    write_outcome(read, tmp_path / "outcome.json")
    assert read_outcome(tmp_path / "outcome.json") == replace(read, path=tmp_path)


def test_an_outcome_is_the_runs_own_numbers(held: Run) -> None:
    read = outcome(held)
    assert (read.path, read.message) == (held.path.parent, "")
    assert read.summary == summary(held)
    assert read.rhythm == rhythm_score(held)
    assert read.summary.energy_muscle_work_J is not None


def test_another_readers_outcome_is_refused(held: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_outcome(outcome(held), tmp_path / "outcome.json")
    monkeypatch.setattr("annelid.experiment.outcome.code_fingerprint", lambda *_: "other")
    with pytest.raises(ValueError, match="other code"):
        read_outcome(tmp_path / "outcome.json")


def test_an_incomplete_outcome_is_refused(held: Run, tmp_path: Path) -> None:
    path = tmp_path / "outcome.json"
    for loss in ("summary", "rhythm", "holds", "message"):
        write_outcome(outcome(held), path)
        content = json.loads(path.read_text())
        del content[loss]
        path.write_text(json.dumps(content))
        with pytest.raises(ValueError, match="no outcome"):
            read_outcome(path)


def test_holds_are_read_at_the_end_of_each_contraction(held: Run) -> None:
    holds = outcome(held).holds
    assert [hold.segment for hold in holds] == [1, 2, 3]
    largest = float(held.data["muscle_force"].max())
    for hold in holds:
        assert max(range(3), key=hold.elongation_mean_m.__getitem__) + 1 == hold.segment
        assert hold.elongation_first_helix_m[hold.segment - 1] > 0.0
        assert hold.ring_length_m == pytest.approx(ring_length_at_end(held, hold.segment))
        assert hold.force_N is not None
        assert 0.0 < hold.force_N <= largest


def test_an_unfinished_contraction_has_no_reading(cut: Run) -> None:
    assert [hold.segment for hold in outcome(cut).holds] == [1, 2]


def test_only_pins_that_can_part_have_a_gap(held: Run, cut: Run) -> None:
    assert all(hold.pin_gap_m is None for hold in outcome(cut).holds)
    assert all(hold.pin_gap_m is not None and hold.pin_gap_m > 0.0 for hold in outcome(held).holds)


def ring_length_at_end(run: Run, segment: int) -> float:
    stop_s = (segment - 1) * (HOLD_S + REST_S) + HOLD_S
    ring = run.data["ring_length"].sel(time=stop_s, method="nearest")
    return float(ring.values.reshape(3, -1)[segment - 1].sum())

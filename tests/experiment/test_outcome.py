from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from annelid.experiment.case import Case
from annelid.experiment.outcome import outcome, read_outcome, write_outcome
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import Run
from annelid_studies.standard_cases import FAST, RODS, one_after_the_other

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


def ring_length_at_end(run: Run, segment: int) -> float:
    stop_s = (segment - 1) * (HOLD_S + REST_S) + HOLD_S
    ring = run.data["ring_length"].sel(time=stop_s, method="nearest")
    return float(ring.values.reshape(3, -1)[segment - 1].sum())

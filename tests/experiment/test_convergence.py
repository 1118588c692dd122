"""A run beside one at half the step and one of more elements: what is refined, what moves, and what is said of it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment import store
from annelid.experiment.convergence import RESOLVED, Check, check, compare, refinements
from annelid.experiment.outcome import Outcome, outcome
from annelid.experiment.store import Done
from annelid.output import write_json
from annelid.simulation import Run, open_run
from annelid.textfiles import read_json
from outcome import Command


@pytest.fixture(scope="module")
def planar(planar_run: Run) -> Outcome:
    return outcome(planar_run)


def of(run: Outcome, **numbers: Any) -> Outcome:
    return replace(run, summary=replace(run.summary, **numbers))


HALF = "half the step (0.5 ms)"


def compared(run: Outcome, finer: Done) -> Check:
    return compare(run, refinements(load_config("riddle2022-planar")), {HALF: finer})


def test_rods_are_refined_in_step_and_mesh_and_others_in_step_alone() -> None:
    (half, more) = refinements(load_config("riddle2023-rods")).items()
    assert half[0] == "half the step (5 ms)"
    assert half[1]["clock.physics_timestep_s"] == 0.005
    assert more == ("one more element a side (3)", {"body.mesh.elements_per_side": 3})
    for preset in ("riddle2023", "riddle2022-planar"):
        (only,) = refinements(load_config(preset))
        assert only.startswith("half the step")


def test_a_check_says_that_only_the_step_is_finer(planar: Outcome) -> None:
    for factor in (1.0, 2.0):
        found = compared(planar, Done(of(planar, travel_m=factor)))
        assert "Only the step is finer: this body has no finer mesh." in found.sentence


@settings(max_examples=25)
@given(factor=st.floats(0.5, 2.0))
def test_a_number_moves_by_its_relative_change_and_a_share_by_its_own(planar: Outcome, factor: float) -> None:
    assume(abs(abs(factor - 1.0) - RESOLVED) > 1e-9)
    assert planar.summary.period_s is not None
    found = compared(planar, Done(of(planar, period_s=factor * planar.summary.period_s)))
    assert found.largest("period_s") == pytest.approx(abs(factor - 1.0))
    assert found.resolved == (abs(factor - 1.0) < RESOLVED)
    assert found.sentence.startswith("Resolved" if found.resolved else "Not resolved")
    assert found.cell("period_s").endswith("!") != found.resolved
    share = compared(of(planar, middle_deficit_mean=0.01), Done(of(planar, middle_deficit_mean=0.01 + 0.02 * factor)))
    assert share.largest("middle_deficit_mean") == pytest.approx(0.02 * factor)


def test_a_segment_that_has_no_number_is_not_compared(planar: Outcome) -> None:
    name = "elongation_mean_max_m"
    for before, after, moved in (
        ([2.0, None], [2.5, None], 0.25),
        ([2.0, None], [2.0, 2.0], math.inf),
        ([None], [None], 0.0),
    ):
        assert compared(of(planar, **{name: before}), Done(of(planar, **{name: after}))).largest(name) == moved


def test_what_is_lost_or_in_another_order_is_said(planar: Outcome, tmp_path: Path) -> None:
    lost = compared(planar, Done(of(planar, period_s=None)))
    assert lost.cell("period_s") == "lost !"
    assert "period (lost)" in lost.sentence
    assert "Try --set clock.physics_timestep_s=0.0005" in lost.sentence
    assert read_json(write_json(tmp_path / "check.json", lost.to_dict()))["moved"]["period_s"] == {HALF: None}
    for finer, words in (
        (Done(of(planar, wave=not planar.summary.wave)), "the order of contractions is another one with half the step"),
        (Done(replace(planar, message="edge strain is 0.1")), "is stopped (edge strain is 0.1)"),
        (Done(None, ConfigError("no solution")), "fails (no solution)"),
    ):
        found = compared(planar, finer)
        assert not found.resolved
        assert words in found.sentence


@pytest.mark.usefixtures("runs_in_this_process")
def test_a_checked_run_is_the_plain_run_and_a_second_call_computes_nothing(
    planar_run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = planar_run.config
    run, found = check(config, tmp_path)
    assert (run.status, run.path) == ("complete", tmp_path / "run.nc")
    assert run.data.drop_vars("wall_time").equals(planar_run.data.drop_vars("wall_time"))
    assert found.resolved, "the rhythm of this worm converges as its steps go to zero"
    assert 0.0 < found.largest("period_s") < 0.01
    monkeypatch.setattr(store, "attempt", None)
    again, same = check(config, tmp_path)
    assert (again.config, same.to_dict()) == (run.config, found.to_dict())
    with pytest.raises(ConfigError, match="has another run in it"):
        check(load_config("riddle2022-planar", {"duration_s": 2.0}), tmp_path)


@pytest.mark.usefixtures("runs_in_this_process")
def test_whoever_interrupts_the_finer_runs_keeps_the_run_itself(
    annelid: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed: list[str] = []

    def interrupted(key: str, *rest: Any) -> None:
        if computed:
            raise KeyboardInterrupt
        computed.append(key)
        attempt(key, *rest)

    attempt = store.attempt
    monkeypatch.setattr(store, "attempt", interrupted)
    command = ("run", "riddle2022-planar", "--duration", "0.5", "--check", "-o", str(tmp_path / "walk"))
    done = annelid(*command)
    assert done.exit_code == 130
    assert "go on with:\n  annelid run" in done.err
    assert "interrupted: step and mesh are not checked" in done.out
    assert ", 3 segments, 0.5 s" in done.out
    assert done.out.splitlines()[-1] == str(tmp_path / "walk/run.nc")
    assert (open_run(tmp_path / "walk").status, len(computed)) == ("complete", 1)
    assert not (tmp_path / "walk/check.json").exists()


def test_a_folder_in_use_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ConfigError, match="is not empty"):
        check(load_config("riddle2022-planar"), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]

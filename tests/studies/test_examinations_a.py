"""The examinations of pins, ranges, springs, radius and friction: what they say follows from their runs."""

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from annelid.analysis import RhythmScore
from annelid.body.assemble import build_spec
from annelid.body.worm import WormBody
from annelid.experiment.case import Case
from annelid.experiment.outcome import Hold, Outcome, outcome
from annelid.experiment.store import Store, case_key
from annelid.simulation.loop import simulate
from annelid.simulation.runfile import open_run
from annelid_studies.riddle2023.examinations import friction, ranges, springs
from annelid_studies.riddle2023.examinations.design import held_elongation
from annelid_studies.riddle2023.examinations.friction import FRICTION
from annelid_studies.riddle2023.examinations.pins import PINS, tie_stiffness_N_per_m
from annelid_studies.riddle2023.examinations.radius import RADIUS
from annelid_studies.riddle2023.examinations.ranges import EQUAL, RANGES, compiled_ranges
from annelid_studies.riddle2023.examinations.springs import SPRINGS
from annelid_studies.worms import chain, fast, one_after_the_other, rods

open_once = cache(open_run)

ALL = (PINS, RANGES, SPRINGS, RADIUS, FRICTION)
WAVE = RhythmScore("ordered", "a wave", (1, 2, 3, 1, 2, 3), 2.63, 0.01, 1.0, 1, 1, 1.0, 4.2)
SILENT = replace(WAVE, verdict="silent", direction=0, wave_fronts=None, period_s=None, last_onset_s=0.7)


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A real run of a few steps: its file stands in where an examination reads one."""
    folder = tmp_path_factory.mktemp("run") / "short"
    simulate(rods({"duration_s": 0.02}).config, folder, progress=False)
    return outcome(open_run(folder))


@pytest.fixture(autouse=True)
def _opened_once(monkeypatch):
    """Examinations open the run of every case, and all of them are the short one here."""
    monkeypatch.setattr(springs, "open_run", open_once)


@pytest.fixture
def undrawn(monkeypatch):
    """Leaves the figures unwritten, for tests of what is said."""
    for module in (friction, ranges, springs):
        monkeypatch.setattr(module, "save_both", lambda figure, stem: None)


def synthetic(short: Outcome, case: Case, deficit: float, score: RhythmScore) -> Outcome:
    """An outcome whose segments elongate by 5, 5 (1 - deficit), 5 cm."""
    values = [0.05, 0.05 * (1.0 - deficit), 0.05]
    summary = replace(
        short.summary,
        elongation_first_helix_pp_m=values,
        elongation_mean_max_m=values,
        middle_deficit=deficit,
        travel_m=0.02,
        contraction_force_median_N=2.5,
    )
    opened = case.config.controller.kind == "program"
    holds = tuple(Hold(k, tuple(values), tuple(values), 0.35, 0.01, 2.0) for k in (1, 2, 3)) if opened else ()
    return Outcome(short.path, summary, score, holds, "")


class Made(Store):
    """A store whose outcomes are made up."""

    def __init__(self, outcomes: Mapping[str, Outcome]) -> None:
        super().__init__(Path("unused"))
        self.outcomes = outcomes

    def __getitem__(self, case: Case) -> Outcome:
        return self.outcomes[case_key(case)]


def results(examination, effort, make) -> Made:
    return Made({case_key(case): make(case) for case in examination.cases(effort)})


@pytest.mark.parametrize("examination", ALL, ids=lambda examination: examination.name)
def test_every_examination_is_whole(examination, short, tmp_path):
    made = results(examination, "full", lambda case: synthetic(short, case, 0.4, WAVE))
    findings = examination.examine(made, "full", tmp_path / "figure")

    assert (tmp_path / "figure.svg").stat().st_size > 1000
    assert (tmp_path / "figure.png").stat().st_size > 1000
    assert findings.answer.endswith(".")
    words = " ".join([findings.answer, findings.caption, *findings.remarks])
    assert "nan" not in words.lower().split()
    assert "None" not in words
    assert all(len(row) == len(findings.table.header) for row in findings.table.rows)
    json.dumps(dict(findings.numbers), allow_nan=False)


@pytest.mark.parametrize("examination", ALL, ids=lambda examination: examination.name)
def test_runs_that_ended_early_leave_gaps_and_no_error(examination, short, tmp_path):
    def ended(case):
        whole = synthetic(short, case, 0.4, SILENT)
        nothing = replace(whole.summary, elongation_first_helix_pp_m=None, elongation_mean_max_m=None, travel_m=None)
        return replace(whole, holds=whole.holds[:1], summary=nothing)

    findings = examination.examine(results(examination, "full", ended), "full", tmp_path / "figure")
    json.dumps(dict(findings.numbers), allow_nan=False)


@pytest.mark.parametrize("examination", ALL, ids=lambda examination: examination.name)
def test_the_quick_effort_has_a_part_of_the_cases(examination):
    shared = {case_key(chain()), case_key(chain(one_after_the_other()))}
    quick, full = ({case_key(case): case for case in examination.cases(effort)} for effort in ("quick", "full"))
    assert quick.keys() <= full.keys()
    assert sum(case.preset == "riddle2023" and key not in shared for key, case in quick.items()) <= 1


@pytest.mark.usefixtures("undrawn")
def test_ranges_reports_what_equal_ranges_leave(short, tmp_path):
    def make(case):
        body = case.config.body
        assert isinstance(body, WormBody)
        equal = len({tuple(limits) for limits in body.rings.length_ranges(3)}) == 1
        return synthetic(short, case, 0.1 if equal else 0.4, WAVE)

    numbers = RANGES.examine(results(RANGES, "full", make), "full", tmp_path / "figure").numbers
    for worm in ("chain", "fast", "rods"):
        for loop in ("open", "closed"):
            assert numbers[f"deficit_{loop}_compiled_{worm}"] == pytest.approx(0.4)
            assert numbers[f"deficit_mean_{loop}_equal_{worm}"] == pytest.approx(0.1)


def test_equal_ranges_are_the_mean_of_those_compiled():
    np.testing.assert_allclose(np.mean(compiled_ranges(), axis=0), EQUAL, atol=1e-3)


@pytest.mark.usefixtures("undrawn")
def test_answers_follow_the_rhythm(short, tmp_path):
    walking = SPRINGS.examine(
        results(SPRINGS, "full", lambda c: synthetic(short, c, 0.4, WAVE)), "full", tmp_path / "a"
    )
    silent = SPRINGS.examine(
        results(SPRINGS, "full", lambda c: synthetic(short, c, 0.4, SILENT)), "full", tmp_path / "b"
    )
    assert (
        "keep the order 1-2-3: the paper's chain, rods with soft crossings and rods with rigid crossings; these do "
        "not: none" in walking.answer
    )
    assert "keep the order 1-2-3: none; these do not: the paper's chain (silent" in silent.answer
    assert silent.numbers["verdict_tension_only_chain"] == "silent after 0.70 s"


@pytest.mark.usefixtures("undrawn")
def test_friction_tells_its_share_of_the_deficit(short, tmp_path):
    def make(case):
        return synthetic(short, case, 0.2 if case.config.arena.friction == 1.0 else 0.05, WAVE)

    numbers = FRICTION.examine(results(FRICTION, "quick", make), "quick", tmp_path / "figure").numbers
    assert numbers["deficit_open_mean_friction_1_fast"] == pytest.approx(0.2)
    assert numbers["deficit_open_mean_friction_0.05_rods"] == pytest.approx(0.05)
    assert numbers["travel_friction_1_m"] == pytest.approx(0.02), "forwards is positive"


@pytest.mark.parametrize("time_constant_s", [0.02, 0.008])
def test_the_stiffness_of_the_chains_pins_is_the_engines(time_constant_s):
    impedance = [0.95, 0.95, 0.001]
    formulation = "body.formulation"
    case = chain({f"{formulation}.pin_time_constant_s": time_constant_s, f"{formulation}.pin_impedance": impedance})
    model = build_spec(case.config).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pins = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    reference = data.efc_KBIP[pins, 0] * data.efc_KBIP[pins, 2]
    assert tie_stiffness_N_per_m(case) == pytest.approx(float((reference / data.efc_R[pins]).mean()), rel=1e-6)


def test_the_stiffness_of_rods_is_stated_or_infinite():
    assert tie_stiffness_N_per_m(fast({"body.formulation.pin_stiffness_N_per_m": 50.0})) == 50.0
    assert tie_stiffness_N_per_m(rods()) == np.inf


def test_a_hold_that_never_came_is_nan(short):
    whole = synthetic(short, fast(one_after_the_other()), 0.4, WAVE)
    np.testing.assert_allclose(held_elongation(whole), [0.05, 0.03, 0.05])
    np.testing.assert_array_equal(np.isnan(held_elongation(replace(whole, holds=whole.holds[:1]))), [0, 1, 1])

"""The examinations: what they say follows from their runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from made_up import SILENT, WAVE, results, synthetic

from annelid.body.assemble import build_spec
from annelid.body.worm import WormBody
from annelid.config import load_config
from annelid.experiment.case import Case
from annelid.experiment.outcome import Outcome, outcome
from annelid.experiment.store import Store, case_key
from annelid.simulation.runfile import Run
from annelid_studies.papers.report_parts import Examination
from annelid_studies.riddle2023.examinations import EXAMINATIONS, timestep
from annelid_studies.riddle2023.examinations.design import RIGID, held_elongation
from annelid_studies.riddle2023.examinations.discretization import convergence_order
from annelid_studies.riddle2023.examinations.friction import FRICTION
from annelid_studies.riddle2023.examinations.noise import MAPS, handled_noise
from annelid_studies.riddle2023.examinations.noise import steady_tolerances as steady
from annelid_studies.riddle2023.examinations.pins import tie_stiffness_N_per_m
from annelid_studies.riddle2023.examinations.ranges import EQUAL, RANGES, compiled_ranges
from annelid_studies.riddle2023.examinations.timestep import EARLY_S, Start, read_start, start_case, velocity_limit
from annelid_studies.standard_cases import CHAIN, chain, fast, one_after_the_other, rods

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

LIMP = replace(WAVE, regularity=0.6)
BACKWARDS = replace(WAVE, direction=-1)
OF_OUTCOMES = [one for one in EXAMINATIONS if one.name != "timestep"]
"""Examinations that read no run but what is known of it."""


@pytest.fixture(scope="module")
def short(rods_run: Run) -> Outcome:
    """A real run of a moment: its file stands in where an examination reads one."""
    return outcome(rods_run)


@pytest.mark.parametrize("examination", OF_OUTCOMES, ids=lambda one: one.name)
def test_every_examination_is_whole(examination: Examination, short: Outcome) -> None:
    made = results(examination, "full", lambda case: synthetic(short, case, 0.4, WAVE))
    findings = examination.examine(made, "full")
    assert findings.answer.endswith(".")
    words = " ".join([findings.answer, *findings.remarks])
    assert "nan" not in words.lower().split()
    assert not [sign for sign in ("None", "{", "}") if sign in words]
    assert all(len(row) == len(findings.table.header) for row in findings.table.rows)


def test_runs_that_ended_early_leave_gaps_and_no_error(short: Outcome, subtests: pytest.Subtests) -> None:
    def ended(case: Case) -> Outcome:
        whole = synthetic(short, case, 0.4, SILENT)
        nothing = replace(whole.summary, elongation_first_helix_pp_m=None, elongation_mean_max_m=None, travel_m=None)
        return replace(whole, holds=whole.holds[:1], summary=nothing)

    for name in ("pins", "ranges", "friction"):
        (examination,) = [one for one in OF_OUTCOMES if one.name == name]
        with subtests.test(name):
            examination.examine(results(examination, "full", ended), "full")


def test_the_quick_effort_has_a_part_of_the_cases(subtests: pytest.Subtests) -> None:
    shared = {case_key(one) for one in (Case(CHAIN), chain(), chain(one_after_the_other()))}
    for one in EXAMINATIONS:
        with subtests.test(one.name):
            quick, full = ({case_key(case): case for case in one.cases(effort)} for effort in ("quick", "full"))
            assert quick.keys() <= full.keys()
            slow = [key for key, case in quick.items() if case.preset == CHAIN and key not in shared]
            assert len(slow) <= (3 if one.name == "timestep" else 1)


def test_ranges_reports_what_equal_ranges_leave(short: Outcome) -> None:
    def make(case: Case) -> Outcome:
        body = case.config.body
        assert isinstance(body, WormBody)
        equal = len({tuple(limits) for limits in body.rings.length_ranges(3)}) == 1
        return synthetic(short, case, 0.1 if equal else 0.4, WAVE)

    numbers = RANGES.examine(results(RANGES, "full", make), "full").numbers
    for worm in ("chain", "fast", "rods"):
        for loop in ("open", "closed"):
            assert numbers[f"deficit_mean_{loop}_compiled_{worm}"] == pytest.approx(0.4)
            assert numbers[f"deficit_mean_{loop}_equal_{worm}"] == pytest.approx(0.1)


def test_equal_ranges_are_the_mean_of_those_compiled() -> None:
    np.testing.assert_allclose(np.mean(compiled_ranges(), axis=0), EQUAL, atol=1e-3)


def test_friction_has_its_share_of_the_deficit(short: Outcome) -> None:
    def make(case: Case) -> Outcome:
        return synthetic(short, case, 0.2 if case.config.arena.friction == 1.0 else 0.05, WAVE)  # type: ignore[union-attr]

    numbers = FRICTION.examine(results(FRICTION, "quick", make), "quick").numbers
    assert numbers["deficit_open_mean_friction_1_fast"] == pytest.approx(0.2)
    assert numbers["deficit_open_mean_friction_0.05_rods"] == pytest.approx(0.05)
    assert numbers["travel_friction_1_chain_m"] == pytest.approx(0.02), "forwards is positive"


@pytest.mark.parametrize("time_constant_s", [0.02, 0.008])
def test_the_stiffness_of_the_chains_pins_is_the_engines(time_constant_s: float) -> None:
    impedance = [0.95, 0.95, 0.001]
    formulation = "body.formulation"
    case = chain({f"{formulation}.pin_time_constant_s": time_constant_s, f"{formulation}.pin_impedance": impedance})
    model = build_spec(case.config).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pins = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    reference = data.efc_KBIP[pins, 0] * data.efc_KBIP[pins, 2]
    assert tie_stiffness_N_per_m(case) == pytest.approx(float((reference / data.efc_R[pins]).mean()), rel=1e-6)


def test_the_stiffness_of_rods_is_stated_or_infinite() -> None:
    assert tie_stiffness_N_per_m(fast({"body.formulation.pin_stiffness_N_per_m": 50.0})) == 50.0
    assert tie_stiffness_N_per_m(rods()) == np.inf


def test_a_hold_that_never_came_is_nan(short: Outcome) -> None:
    whole = synthetic(short, fast(one_after_the_other()), 0.4, WAVE)
    np.testing.assert_allclose(held_elongation(whole), [0.05, 0.03, 0.05])
    np.testing.assert_array_equal(np.isnan(held_elongation(replace(whole, holds=whole.holds[:1]))), [0, 1, 1])


def test_a_cell_has_one_run_for_each_seed_but_only_one_without_noise() -> None:
    for chart in (*MAPS["quick"], *MAPS["full"]):
        for (_, noise), cases in chart.cells().items():
            assert len({case_key(case) for case in cases}) == (chart.n_seeds if noise else 1)


def test_a_tolerance_is_steady_if_every_run_walks() -> None:
    cells = {(0.01, 0.0): [WAVE], (0.02, 0.0): [LIMP], (0.01, 0.001): [WAVE, SILENT], (0.02, 0.001): [WAVE, LIMP]}
    assert steady(cells, 0.0) == [0.01, 0.02]
    assert steady(cells, 0.001) == [0.02]
    assert handled_noise(cells) == 0.001
    assert handled_noise({(0.01, 0.0): [SILENT]}) is None


def test_the_velocity_limit_is_that_of_the_papers_muscle() -> None:
    # 1.5 optimal lengths of (1.052 - 0.548) / 0.3 = 1.68 m a second.
    assert velocity_limit(load_config(CHAIN)) == pytest.approx(2.52)


def test_shortening_is_measured_by_what_the_limit_allows() -> None:
    time = np.linspace(0.0, 0.1, 11)
    start = Start(time, 1.0 - 6.0 * time, limit_m_per_s=2.0)
    assert start.times_limit(EARLY_S) == pytest.approx(3.0)
    assert np.isnan(start.at(0.2))


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
def test_the_order_of_convergence_is_found(order: float) -> None:
    elements = np.array([1.0, 2.0, 3.0, 4.0])
    difference = 0.3 * (elements**-order - 6.0**-order)
    assert convergence_order(elements, difference, 6.0) == pytest.approx(order, abs=0.011)


def test_no_order_where_there_is_none() -> None:
    assert convergence_order([1, 2], [0.1, 0.0], 3) is None
    assert convergence_order([1], [0.1], 3) is None
    assert convergence_order([1, 2, 3], [0.1, 0.2, 0.4], 4) is None


def test_tight_rods_keep_within_the_muscles_limit(tmp_path: Path) -> None:
    case = start_case(RIGID, 0.005)
    store = Store(tmp_path)
    store.compute([case])
    assert 0.3 < read_start(store[case]).times_limit(EARLY_S) < 1.0
    assert store[case].message == ""


def test_the_time_step_is_examined_in_the_quick_effort(short: Outcome, monkeypatch: pytest.MonkeyPatch) -> None:
    time = np.linspace(0.0, 0.1, 11)
    monkeypatch.setattr(timestep, "read_start", lambda one: Start(time, 1.0 - 3.0 * time, 2.0))
    made = results(timestep.TIMESTEP, "quick", lambda case: synthetic(short, case, 0.4, WAVE))
    findings = timestep.TIMESTEP.examine(made, "quick")
    assert findings.numbers["times_velocity_limit_chain_1ms"] == pytest.approx(1.5)
    assert "1.5, 1.5 and 1.5 times as far in the paper's chain" in findings.answer

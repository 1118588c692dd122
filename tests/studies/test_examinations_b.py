"""The examinations of noise, time step, discretization and gates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from annelid.analysis import RhythmScore
from annelid.config import load_config
from annelid.experiment.case import Case
from annelid.experiment.store import Store, case_key
from annelid_studies.riddle2023.contents import Examination
from annelid_studies.riddle2023.examinations.design import RIGID
from annelid_studies.riddle2023.examinations.discretization import DISCRETIZATION, convergence_order
from annelid_studies.riddle2023.examinations.gate import FLAT, GATE, read_beat
from annelid_studies.riddle2023.examinations.noise import (
    MAPS,
    NOISE,
    handled_noise,
    is_even,
    majority,
    share,
    steady_tolerances,
)
from annelid_studies.riddle2023.examinations.timestep import (
    EARLY_S,
    TIMESTEP,
    Start,
    read_start,
    start_case,
    velocity_limit,
)
from annelid_studies.worms import CHAIN, Effort, chain, rods

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

EXAMINATIONS = (NOISE, TIMESTEP, DISCRETIZATION, GATE)
WALK = RhythmScore("ordered", "", (1, 2, 3), 2.6, 0.0, 1.0, 1, 1, 1.0, 4.0)
LIMP = replace(WALK, regularity=0.6)
SILENT = replace(WALK, verdict="silent", direction=0, wave_fronts=None)
BACKWARDS = replace(WALK, direction=-1)


def keys(examination: Examination, effort: Effort) -> set[str]:
    return {case_key(case) for case in examination.cases(effort)}


@pytest.mark.parametrize("examination", EXAMINATIONS, ids=lambda each: each.name)
def test_the_quick_runs_are_among_the_full_ones(examination: Examination) -> None:
    assert keys(examination, "quick") <= keys(examination, "full")


@pytest.mark.parametrize("examination", EXAMINATIONS, ids=lambda each: each.name)
def test_runs_are_shared_with_the_worms_as_they_come(examination: Examination) -> None:
    shared = {case_key(case) for case in (Case(CHAIN), chain(), rods())}
    assert shared & keys(examination, "quick")


def test_a_cell_has_one_run_for_each_seed_but_only_one_without_noise() -> None:
    for effort in ("quick", "full"):
        for chart in MAPS[effort]:
            for (_, noise), cases in chart.cells().items():
                assert len({case_key(case) for case in cases}) == (chart.n_seeds if noise else 1)


def test_a_tolerance_is_steady_if_every_run_walks() -> None:
    cells = {(0.01, 0.0): [WALK], (0.02, 0.0): [LIMP], (0.01, 0.001): [WALK, SILENT], (0.02, 0.001): [WALK, LIMP]}
    assert steady_tolerances(cells, 0.0) == [0.01, 0.02]
    assert steady_tolerances(cells, 0.0, is_even) == [0.01]
    assert steady_tolerances(cells, 0.001) == [0.02]
    assert handled_noise(cells) == 0.001
    assert handled_noise(cells, is_even) == 0.0
    assert handled_noise({(0.01, 0.0): [SILENT]}) is None


def test_another_wave_does_not_walk() -> None:
    assert share({(0.01, 0.0): [BACKWARDS], (0.02, 0.0): [WALK, LIMP, SILENT, SILENT]}) == pytest.approx(0.25)


def test_of_kinds_as_frequent_the_less_ordered_stands_for_a_cell() -> None:
    assert majority([WALK, WALK, SILENT]) == "1-2-3"
    assert majority([WALK, SILENT]) == "silent"
    assert majority([LIMP, WALK]) == "limping"


def test_the_velocity_limit_is_that_of_the_papers_muscle() -> None:
    # 1.5 optimal lengths of (1.052 - 0.548) / 0.3 = 1.68 m a second.
    assert velocity_limit(load_config(CHAIN)) == pytest.approx(2.52)
    with pytest.raises(ValueError, match="planar"):
        velocity_limit(load_config("riddle2022-planar"))


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


def test_no_order_is_told_where_there_is_none() -> None:
    assert convergence_order([1, 2], [0.1, 0.0], 3) is None
    assert convergence_order([1], [0.1], 3) is None
    assert convergence_order([1, 2, 3], [0.1, 0.2, 0.4], 4) is None


def test_tight_rods_keep_within_the_muscles_limit(tmp_path: Path) -> None:
    case = start_case(RIGID, 0.005)
    store = Store(tmp_path)
    store.compute([case])
    outcome = store[case]
    assert 0.3 < read_start(outcome).times_limit(EARLY_S) < 1.0
    assert outcome.message == ""


def test_the_planar_worms_gates_draw_and_tell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import annelid_studies.riddle2023.examinations.gate as gate

    pairs = (("toolbox", "euler"), ("toolbox", "toolbox"), ("steady", "euler"))
    monkeypatch.setattr(gate, "VARIANTS", {"quick": {FLAT: pairs}})
    store = Store(tmp_path)
    store.compute(GATE.cases("quick"))
    findings = GATE.examine(store, "quick", tmp_path / "gate")
    # Measured independently on the authors' network: forward Euler, and SNS-Toolbox's order.
    assert findings.numbers["period_planar_toolbox_euler_s"] == pytest.approx(2.625, abs=0.001)
    assert findings.numbers["period_planar_toolbox_toolbox_s"] == pytest.approx(2.631, abs=0.001)
    assert {"gate.svg", "gate.png"} <= {path.name for path in tmp_path.iterdir()}
    cases = {start: gate.variant(FLAT, start, "euler") for start in gate.STARTS}
    long, short = (read_beat(FLAT, start, "euler", store[case]).first_s for start, case in cases.items())
    assert long > 5 * short

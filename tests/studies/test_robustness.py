"""The robustness study: its sample, its verdicts, and its shares."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from annelid.analysis.rhythm import RhythmScore
from annelid.experiment import Case, Store
from annelid_studies import robustness as study
from annelid_studies.robustness import CONTROLLERS, Judged, judge, sample, shares, tolerance_m
from rods import tolerance_window_m

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

WAVE = RhythmScore("ordered", "a wave", (1, 2, 3), 2.625, 0.0, 1.0, 1, 1, 1.0, 5.0)
WORM = sample(8)[3]
STEP_S = 0.01


def judged(worm: int, controller: str = "sns", walks: bool = True, message: str = "", step_s: float = STEP_S) -> Judged:
    wave = WAVE if walks else replace(WAVE, verdict="disordered")
    return judge(replace(WORM, number=worm), controller, step_s, wave, wave, message)


def test_the_sample_is_a_latin_hypercube_within_its_ranges() -> None:
    n = 64
    worms = sample(n)
    for values in (
        [one.noise_m / 0.005 for one in worms],
        [np.log(one.friction / 0.05) / np.log(30.0) for one in worms],
        [np.log(one.young_modulus_Pa / 0.3e9) / np.log(2.0 / 0.3) for one in worms],
    ):
        # Values are rounded by less than a twentieth of a stratum.
        off = np.sort(values) * n - np.arange(n)
        assert off.min() > -0.05
        assert off.max() < 1.05


def test_a_worm_becomes_a_run_by_every_controller() -> None:
    configs = [WORM.case(kind).config for kind in CONTROLLERS]
    assert [config.controller.kind for config in configs] == ["sns", "sns", "sns-robust", "timed"]
    low_m, high_m = tolerance_window_m(configs[0]) or (0.0, 0.0)
    assert configs[0].sensor.tolerance_m == 0.015
    assert low_m < configs[1].sensor.tolerance_m == tolerance_m(WORM.case("sns")) < high_m
    for config in configs:
        assert config.sensor.noise_m == WORM.noise_m
        assert config.duration_s >= 2 * 0.875 + 2.2 * 3 * 0.875
        assert config.seed == WORM.number
    halved = WORM.case("sns-tolerance", half_step=True).config
    assert 2 * halved.clock.physics_timestep_s == configs[1].clock.physics_timestep_s
    assert halved.sensor.tolerance_m == configs[1].sensor.tolerance_m


def test_verdicts(subtests: pytest.Subtests) -> None:
    for change, walked, in_time in (
        ({}, True, True),
        ({"period_s": 2.625 * 1.11}, True, False),
        ({"period_s": 2.625 * 0.89}, True, False),
        ({"direction": -1}, False, False),
        ({"wave_fronts": 2}, False, False),
        ({"verdict": "disordered"}, False, False),
        ({"verdict": None}, False, False),
        ({"period_s": None}, True, False),
    ):
        with subtests.test(f"{change!r:.60}"):
            changed = replace(WAVE, **change)  # type: ignore[arg-type]
            found = judge(WORM, "sns", STEP_S, changed, WAVE)
            assert (found.walked, found.in_time, found.lengthened) == (walked, in_time, in_time)
            assert judge(WORM, "sns", STEP_S, WAVE, changed).lengthened == walked


def test_a_run_that_a_guard_stopped_did_not_walk_and_says_why() -> None:
    found = judged(0, message="too much energy")
    assert (found.walked, found.in_time, found.lengthened) == (False, False, False)
    assert (found.stopped, found.reason) == (True, "too much energy")


def test_a_stopped_worm_counts_as_at_half_the_step_and_others_as_at_their_own() -> None:
    half = {"step_s": STEP_S / 2}
    runs = [judged(0, message="energy"), judged(0, **half)]  # type: ignore[arg-type]
    runs += [judged(1, walks=False), judged(1, **half)]  # type: ignore[arg-type]
    runs += [judged(2), judged(2, **half), judged(3, walks=False)]  # type: ignore[arg-type]
    runs += [judged(0, "timed")]
    sns, timed = shares(runs)
    assert (sns.worms, sns.walked, sns.in_time, sns.lengthened) == (4, 2, 2, 2)
    assert (sns.stopped, sns.halved, sns.same) == (1, 2, 1)
    assert (timed.controller, timed.worms, timed.share, timed.halved) == ("timed", 1, 1.0, 0)


def test_the_interval_holds_the_shares_that_a_score_test_accepts(subtests: pytest.Subtests) -> None:
    for successes, n in ((0, 10), (7, 10), (10, 10), (285, 300)):
        with subtests.test(f"{successes} of {n}"):
            [found] = shares([judged(i, walks=i < successes) for i in range(n)])
            for share in (found.low, found.high):
                if 1e-9 < share < 1.0 - 1e-9:
                    assert abs(successes / n - share) == pytest.approx(1.959964 * np.sqrt(share * (1.0 - share) / n))
            assert 0.0 <= found.low < found.high <= 1.0


def test_the_study_runs_stopped_worms_again_and_writes_both_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "CYCLES", 0.05)
    monkeypatch.setattr(study, "CONTROLLERS", ("timed",))
    monkeypatch.setattr(study, "sample", lambda _: [replace(WORM, number=1, noise_m=0.0), replace(WORM, number=4)])
    plain = study.Worm.case

    def case(worm: study.Worm, controller: str, half_step: bool = False) -> Case:
        made = plain(worm, controller, half_step)
        return made.but({"guard.edge_strain": 1e-9}) if worm.number == 1 else made

    monkeypatch.setattr(study.Worm, "case", case)
    written, [table] = study.study(Store(tmp_path / "runs"), tmp_path, "full")
    assert [path.name for path in written] == ["robustness.csv", "robustness_runs.csv"]
    counted, rows = (list(csv.DictReader(path.read_text().splitlines())) for path in written)
    assert [(row["worm"], row["step_s"], row["stopped"]) for row in rows] == [
        *(("1", "0.01", "True"), ("1", "0.005", "True")),
        *(("4", "0.01", "False"), ("4", "0.005", "False")),
    ]
    assert [[row[name] for name in ("worms", "stopped", "halved")] for row in counted] == [["2", "1", "1"]]
    assert table.row_count == 1

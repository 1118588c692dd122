"""The robustness study: its sample, its verdicts, and its shares."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from annelid.analysis.rhythm import RhythmScore
from annelid.errors import ConfigError
from annelid_studies import robustness as study
from annelid_studies.robustness import CONTROLLERS, Judged, judge, points, shares
from rods import tolerance_window_m

pytestmark = pytest.mark.usefixtures("runs_in_this_process")

WAVE = RhythmScore("ordered", "a wave", (1, 2, 3), 2.625, 0.0, 1.0, 1, 1, 1.0, 5.0)


def test_the_sample_is_a_latin_hypercube() -> None:
    """Spread quantities have one point a stratum; rounded ones as many points a value as its share of the range."""
    sample = points()
    n = len(sample)
    assert n == 300
    shares_of = {
        "noise_m": [p.noise_m / 0.005 for p in sample],
        "friction": [np.log(p.friction / 0.05) / np.log(30.0) for p in sample],
        "young_modulus_Pa": [np.log(p.young_modulus_Pa / 0.3e9) / np.log(2.0 / 0.3) for p in sample],
    }
    for values in shares_of.values():
        # Values are rounded when written, by less than a tenth of a stratum.
        assert np.abs(np.sort(values) - (np.arange(n) + 0.5) / n).max() <= 0.6 / n
    segments = np.array([p.n_segments for p in sample])
    assert set(segments) == set(range(3, 25))
    assert np.abs(np.bincount(segments)[3:] - n / 22).max() <= 1.0
    assert {p.physics_timestep_ms for p in sample} == set(range(1, 11))
    assert len({p.seed for p in sample}) == n


def test_a_point_becomes_a_run_under_every_controller() -> None:
    point = replace(points()[3], n_segments=5)
    configs = [point.case(kind).config for kind in CONTROLLERS]
    assert [config.controller.kind for config in configs] == ["sns", "sns", "sns-robust", "timed"]
    low_m, high_m = tolerance_window_m(configs[0]) or (0.0, 0.0)
    assert [config.sensor.tolerance_m for config in configs[:2]] == [0.015, point.tolerance_m]
    assert low_m < point.tolerance_m < high_m
    for config in configs:
        assert config.body.n_segments == 5
        assert config.sensor.noise_m == point.noise_m
        assert config.duration_s >= 2 * 0.875 + 2.2 * 5 * 0.875
        assert config.seed == point.seed


def test_verdicts(subtests: pytest.Subtests) -> None:
    for change, walked, in_time in (
        ({}, True, True),
        ({"period_s": 2.625 * 1.11}, True, False),
        ({"period_s": 2.625 * 0.89}, True, False),
        ({"direction": -1}, False, False),
        ({"wave_fronts": 2}, False, False),
        ({"verdict": "disordered"}, False, False),
        ({"verdict": None}, False, False),
    ):
        with subtests.test(f"{change!r:.60}"):
            point = replace(points()[0], n_segments=3)
            changed = replace(WAVE, **change)  # type: ignore[arg-type]
            found = judge(0, point, "sns", changed, WAVE)
            assert (found.walked, found.in_time, found.lengthened) == (walked, in_time, True)
            assert judge(0, point, "sns", WAVE, changed).lengthened == walked


def test_a_run_that_a_guard_stopped_did_not_walk() -> None:
    found = judge(0, replace(points()[0], n_segments=3), "sns", WAVE, WAVE, "too much energy")
    assert (found.walked, found.in_time, found.lengthened) == (False, False, False)
    assert found.reason == "too much energy"


def test_shares_count_by_controller() -> None:
    judged = [Judged(i, "sns", 3, "", None, i < 3, i < 2, i != 1) for i in range(4)]
    judged += [Judged(0, "sns-robust", 3, "", None, True, True, True)]
    found = shares(judged)
    assert [found["sns"][name] for name in ("points", "walked", "in_time", "lengthened")] == [4, 3, 2, 1]
    assert found["sns"]["share"] == 0.5
    assert found["sns-robust"]["share"] == 1.0


def test_the_interval_holds_the_shares_that_a_score_test_accepts(subtests: pytest.Subtests) -> None:
    for successes, n in ((0, 10), (7, 10), (10, 10), (285, 300)):
        with subtests.test(f"{successes!r:.60}"):
            judged = [Judged(i, "sns", 3, "", None, True, i < successes, True) for i in range(n)]
            low, high = shares(judged)["sns"]["interval"]
            for share in (low, high):
                if 1e-9 < share < 1.0 - 1e-9:
                    assert abs(successes / n - share) == pytest.approx(1.959964 * np.sqrt(share * (1.0 - share) / n))
            assert low >= 0.0
            assert high <= 1.0


@pytest.mark.parametrize("n_points", [0, 301])
def test_points_beyond_the_sample_are_refused(n_points: int, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"points must be in 1 \.\. 300"):
        study.robustness(tmp_path, n_points)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sample of one worm that stands for a moment."""
    sample = (replace(points()[0], n_segments=3, physics_timestep_ms=20, noise_m=0.0),)
    monkeypatch.setattr(study, "points", lambda: sample)
    monkeypatch.setattr(study, "CYCLES", 0.05)


@pytest.mark.usefixtures("short")
def test_the_study_keeps_its_results_and_goes_on(tmp_path: Path) -> None:
    ours = study.robustness(tmp_path, 1, controllers=["sns-robust"])
    assert [one.controller for one in ours] == ["sns-robust"]
    pair = ["sns", "sns-robust"]
    both = study.robustness(tmp_path, 1, controllers=pair)
    assert both[1:] == ours
    runs = {path: path.stat().st_mtime_ns for path in tmp_path.glob("runs/*/run.nc")}
    assert len(runs) == 2
    assert study.robustness(tmp_path, 1, controllers=pair) == both
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("runs/*/run.nc")} == runs
    text = (tmp_path / "robustness.json").read_text()
    assert [one["controller"] for one in json.loads(text)["judged"]] == pair
    assert json.loads(text)["shares"]["sns"]["in_time"] == 0
    assert study.robustness(tmp_path, 1, controllers=["sns-robust"]) == both, "a call for fewer leaves the others"
    assert (tmp_path / "robustness.json").read_text() == text


@pytest.mark.usefixtures("short")
def test_an_interrupted_call_leaves_the_tables_of_what_there_is(tmp_path: Path) -> None:
    def interrupt(stage: str, done: int, n: int, share: float) -> None:
        if done:  # By now this process has computed both, and told of one.
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study.robustness(tmp_path, 1, controllers=["sns", "sns-robust"], progress=interrupt)
    content = json.loads((tmp_path / "robustness.json").read_text())
    assert [one["controller"] for one in content["judged"]] == ["sns", "sns-robust"]
    assert "`sns`" in (tmp_path / "robustness.md").read_text()


def test_an_unknown_controller_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="unknown controller 'shc'"):
        study.robustness(tmp_path, 1, controllers=["shc"])


def test_the_committed_results_are_of_the_sample() -> None:
    results = Path(__file__).parents[2] / "docs" / "results" / "robustness_three_segments.json"
    judged = json.loads(results.read_text(encoding="utf-8"))["judged"]
    assert len({(one["controller"], one["point"]) for one in judged}) == len(judged) > 0
    for one in judged:
        assert one["n_segments"] == 3
        assert one["walked"] or not one["in_time"]

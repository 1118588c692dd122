"""The judge of slip detectors, on signals whose score can be counted by hand."""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from annelid.config import check_config
from annelid.errors import RunFileError
from annelid.protocols import Array
from annelid.simulation import Run
from annelid_studies.slip import speed_and_loss
from annelid_studies.slip_detector.scores import Detection, detect_slip, precision_recall, score_detections


def detection(slips: list[int], estimated: list[float]) -> Detection:
    truth = np.array(slips, dtype=bool)[:, None]
    speed = np.array(estimated)[:, None]
    time = np.arange(len(slips), dtype=np.float64) * 0.01
    return Detection(time, truth, np.where(truth, 0.2, 0.0), speed, np.ones_like(truth))


def test_a_perfect_detector_scores_full_marks() -> None:
    truth = [0] * 20 + [1] * 10 + [0] * 20
    got = score_detections([detection(truth, [0.3 * one for one in truth])], 0.1)
    assert (got.precision, got.recall, got.found, got.episodes) == (1.0, 1.0, 1.0, 1)
    assert (got.delay_s, got.false_alarms_per_s) == (0.0, 0.0)
    assert got.base_rate == pytest.approx(0.2)
    assert got.correlation == pytest.approx(1.0)


def test_late_false_and_missed_alarms_are_counted() -> None:
    truth = [0] * 10 + [1] * 10 + [0] * 10 + [1] * 10 + [0] * 11
    told = [0.0] * 51
    for i in (13, 14, 15, 16, 45, 46):
        told[i] = 0.3
    got = score_detections([detection(truth, told)], 0.1)
    assert got.precision == pytest.approx(4 / 6)
    assert got.recall == pytest.approx(4 / 20)
    assert (got.episodes, got.found) == (2, 0.5)
    assert got.delay_s == pytest.approx(0.03)
    assert got.false_alarms_per_s == pytest.approx(1 / 0.5)


def test_nothing_told_has_no_precision_and_no_slip_no_recall() -> None:
    silent = score_detections([detection([1] * 10, [0.0] * 10)], 0.1)
    assert isnan(silent.precision)
    assert silent.recall == 0.0
    resting = score_detections([detection([0] * 10, [0.0] * 10)], 0.1)
    assert isnan(resting.recall)


def test_recall_falls_with_the_limit() -> None:
    random = np.random.default_rng(1)
    truth = random.random(400) < 0.3
    estimated = 0.2 * truth + random.normal(0, 0.1, 400)
    recall, precision = precision_recall(
        [detection(truth.astype(int).tolist(), estimated.tolist())], np.linspace(0, 0.4, 9)
    )
    assert np.all(np.diff(recall) <= 0)
    assert recall[0] == pytest.approx(1.0)
    assert precision[-1] > precision[0] == pytest.approx(truth.mean(), abs=1e-9)


@dataclass
class Recorded:
    """As much of a run as the judge reads."""

    data: xr.Dataset
    path: Path = Path("run.nc")


def sliding(speed: Array, load: Array) -> Recorded:
    """A worm of three segments at constant length, whose first one slides."""
    n = len(speed)
    touch = np.zeros((n, 3, 4))
    touch[:, 0, 0] = load
    slip = np.zeros((n, 3))
    slip[:, 0] = speed
    rest = np.full((n, 3, 2), 0.07)
    sensors = ("time", "segment", "sensor")
    return Recorded(
        xr.Dataset(
            {
                "stretch_length": (sensors, rest),
                "stretch_rest_length": (sensors, rest),
                "touch": (("time", "segment", "side"), touch),
                "slip_speed": (("time", "segment"), slip),
            },
            coords={"time": 0.01 * np.arange(n)},
        )
    )


def test_true_slip_is_a_mean_over_a_window_weighted_by_load() -> None:
    speed = np.zeros(40)
    speed[20] = 0.5
    found = detect_slip(sliding(speed, np.full(40, 4.0)))  # type: ignore[arg-type]
    assert np.flatnonzero(found.slips[:, 0]).tolist() == [18, 19, 20, 21, 22]
    assert found.true_m_per_s[18:23, 0] == pytest.approx(np.full(5, 0.1))
    assert not found.slips[:, 1:].any()


def test_what_bears_no_load_does_not_slip() -> None:
    found = detect_slip(sliding(np.full(40, 0.5), np.full(40, 0.9)))  # type: ignore[arg-type]
    assert not found.slips.any()


def test_a_run_without_skin_is_refused() -> None:
    run = Recorded(xr.Dataset(coords={"time": np.arange(3.0)}))
    with pytest.raises(RunFileError, match="holds no touch of a skin"):
        detect_slip(run)  # type: ignore[arg-type]


def crawling(cycles: float) -> Run:
    """A worm of period 2 s that goes 0.1 m/s towards -x and loses 0.3 W, but far more before its first cycle."""
    time = 0.01 * np.arange(round(200 * cycles))
    phase = (time[:, None] - np.array([0.3, 1.0, 1.6])) % 2.0
    loss = 0.1 * time[:, None].repeat(3, axis=1) + 5.0 * (time[:, None] > 0.2)
    center = np.zeros((len(time), 3))
    center[:, 0] = -0.1 * time
    data = xr.Dataset(
        {
            "activation": (("time", "muscle"), ((phase < 0.6) & (time[:, None] > 0.1)).astype(float)),
            "slip_loss": (("time", "segment"), loss),
            "center_of_mass": (("time", "axis"), center),
        },
        coords={"time": time, "axis": ["x", "y", "z"], "frame_time": ("frame", [])},
    )
    return Run(Path("run.nc"), {}, {}, check_config({}), "complete", "").with_data(data)


def test_the_cost_of_slip_is_that_of_whole_cycles_behind_the_first() -> None:
    assert speed_and_loss(crawling(5.4)) == pytest.approx((0.1, 3.0), rel=1e-6)
    assert np.isnan(speed_and_loss(crawling(1.5))).all()

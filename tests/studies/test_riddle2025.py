"""The comparison with the authors' later robot: how speeds are read, what is run, and what it leaves behind."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from annelid.body import WormBody
from annelid.control.open_loop import TimedWave
from annelid_studies.riddle2025 import (
    PIPE_FRICTION,
    Point,
    Reading,
    cases,
    comparison_picture,
    comparison_table,
    points,
    repeated,
    speed_of_line,
)
from annelid_studies.tables import write_fields


def reading(**changes: object) -> Reading:
    values = {
        "ground": "bend",
        "gait": "3x1",
        "friction": 0.3,
        "radius_m": 0.5,
        "half_step": False,
        "runs": 3,
        "speed_m_per_s": 0.03,
        "low_m_per_s": 0.02,
        "high_m_per_s": 0.04,
        "came_out": 3,
        "passed": 2,
        "least_front_m": 1.1,
        "figure": "taken out",
        "command": "annelid run x",
    }
    return Reading(**{**values, **changes})  # type: ignore[arg-type]


def test_a_speed_is_the_slope_up_to_the_farthest_point() -> None:
    time = np.linspace(0.0, 10.0, 101)
    assert speed_of_line(time, 0.04 * time) == pytest.approx(0.04)
    assert speed_of_line(time, -0.02 * time) == pytest.approx(-0.02)
    stopped = 0.04 * np.minimum(time, 5.0) - 1e-6 * time
    assert speed_of_line(time, stopped) == pytest.approx(0.04, rel=1e-3)
    assert speed_of_line(time, np.zeros(101)) == 0.0


def test_a_path_goes_on_as_in_its_last_cycle() -> None:
    time = np.linspace(0.0, 12.0, 121)
    place = 0.04 * time + 0.01 * np.sin(2 * np.pi * time / 6.0)
    further_time, further = repeated(time, place, 80.0)
    assert further_time == pytest.approx(np.linspace(0.0, 80.0, 801))
    assert further == pytest.approx(0.04 * further_time + 0.01 * np.sin(2 * np.pi * further_time / 6.0))


def test_every_point_is_under_a_pattern_of_the_authors_with_a_cycle_of_six_seconds() -> None:
    for point in points():
        config = cases(point)[0].config
        body, wave = config.body, config.controller
        assert isinstance(body, WormBody)
        assert isinstance(wave, TimedWave)
        assert body.n_segments * wave.interval_s / wave.waves == 6.0
        assert (wave.rise_s, wave.hold_s, wave.fall_s, wave.level) == (1.0, 1.0, 1.0, 1.0)
        assert wave.waves == (2 if point.gait == "2x2" else 1)


def test_quick_points_are_some_of_all() -> None:
    assert {point[:3] for point in points(quick=True)} <= {point[:3] for point in points()}


def test_readings_are_written_told_and_drawn(tmp_path: Path) -> None:
    nan = float("nan")
    flat = reading(ground="flat", radius_m=nan, came_out=0, passed=0)
    finer = reading(half_step=True, runs=1, low_m_per_s=nan, high_m_per_s=nan)
    readings = [reading(), flat, finer]
    with write_fields(Reading, readings, tmp_path / "x.csv").open(newline="", encoding="utf-8") as file:
        assert [row["runs"] for row in csv.DictReader(file)] == ["3", "3", "1"]
    cells = [list(column.cells) for column in comparison_table(readings).columns]
    assert cells[0] == ["bend 0.5 m", "flat", "bend 0.5 m"]
    assert cells[1] == ["3x1", "3x1", "3x1,\nhalf step"]
    assert cells[4] == ["2.00..4.00", "2.00..4.00", "-"]
    assert cells[5] == ["3 of 3", "", "3 of 1"]
    for some in (readings, []):
        path = comparison_picture(some, tmp_path / "x")
        assert path.stat().st_size > 1000
        assert path.with_suffix(".svg").exists()


def test_the_bend_starts_as_far_ahead_as_the_authors_does() -> None:
    config = cases(Point("bend", "3x1", PIPE_FRICTION, 0.7, False))[0].config
    assert config.arena is not None
    assert config.arena.reach_m() == pytest.approx((0.25, 0.25 + 0.7 * np.pi / 2))

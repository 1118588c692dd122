"""The studies of slip: what they compare, what they write, and the saving itself."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from annelid.analysis import DetectionScore, SlipCost
from annelid.config import load_config
from annelid.control.sns import PressureSns, Sns
from annelid.errors import ConfigError
from annelid.experiment.store import Store
from annelid_studies.slip import (
    CASES,
    DURATION_S,
    EXTENSION,
    FEEDBACKS,
    GAITS,
    PLAIN,
    PRESSURE,
    TUNED_AT,
    Reading,
    case,
    compared,
    feedback_table,
    slip_feedback,
    write_readings,
    write_scores,
)


@pytest.mark.parametrize("preset", GAITS)
def test_only_the_feedback_differs(preset: str) -> None:
    plain, extension, pressure = (case(feedback, 1.0, preset).config for feedback in FEEDBACKS)
    published = load_config(preset)
    assert (plain.body, plain.controller, plain.sensor) == (published.body, published.controller, published.sensor)
    assert plain.duration_s == DURATION_S
    assert isinstance(plain.controller, Sns)
    assert isinstance(extension.controller, PressureSns)
    assert isinstance(pressure.controller, PressureSns)
    assert plain.controller == extension.controller.network == pressure.controller.network
    assert extension.controller == pressure.controller.model_copy(update={"hold": 0.0})
    assert pressure.controller == PressureSns(network=plain.controller)
    for one in (extension, pressure):
        assert one.model_copy(update={"controller": plain.controller}) == plain


def test_a_gait_of_another_robot_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="preset is 'riddle2023': must be one of riddle2025-muscles, crawler"):
        slip_feedback(Store(tmp_path), [1.0], "riddle2023")


def reading(feedback: str, friction: float, speed: float, loss: float) -> Reading:
    return Reading(feedback, friction, SlipCost(4, 2.0, speed, loss, loss / speed), True)


def test_savings_are_told_against_no_feedback_on_the_same_friction(tmp_path: Path) -> None:
    readings = [
        reading(PLAIN, 0.5, 0.1, 0.5),
        reading(PRESSURE, 0.5, 0.125, 0.4),
        reading(PLAIN, 1.0, 0.2, 2.0),
        reading(PRESSURE, 1.0, 0.2, 1.0),
        Reading(EXTENSION, 1.0, None, False),
    ]
    assert compared(readings, readings[1]) == pytest.approx((25.0, 20.0, 36.0))
    assert compared(readings, readings[3]) == pytest.approx((0.0, 50.0, 50.0))
    assert compared(readings, readings[4]) is None
    write_readings(readings, tmp_path / "slip.csv")
    rows = list(csv.DictReader((tmp_path / "slip.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["feedback"] for row in rows] == [one.feedback for one in readings]
    assert float(rows[1]["saved_per_m_percent"]) == pytest.approx(36.0)
    assert rows[4]["speed_m_per_s"] == "nan"
    assert feedback_table(readings).row_count == 5


def test_scores_are_written_under_their_names(tmp_path: Path) -> None:
    write_scores({"a": DetectionScore(0.5, 0.25, 0.1, 2.0, 7, 0.75, 0.03, 0.9)}, tmp_path / "d.csv")
    [row] = csv.DictReader((tmp_path / "d.csv").read_text(encoding="utf-8").splitlines())
    assert row["run"] == "a"
    assert [float(row[name]) for name in ("precision", "recall", "episodes", "delay_s")] == [0.5, 0.25, 7, 0.03]
    assert len(CASES) == len({one.stem + str(one.changes) for one in CASES.values()})


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.7, 1.0])
def test_pressure_feedback_saves_slip_at_no_less_speed(tmp_path: Path, friction: float) -> None:
    """On frictions that it was not tuned on."""
    assert friction not in TUNED_AT
    readings = slip_feedback(Store(tmp_path), [friction])
    pressure = next(one for one in readings if one.feedback == PRESSURE)
    assert pressure.one_wave
    gains = compared(readings, pressure)
    assert gains is not None
    faster, _, saved_per_m = gains
    assert faster >= 0.0
    assert saved_per_m >= 30.0

"""The studies of slip: what they compare, and what they write."""

from __future__ import annotations

import csv
from pathlib import Path

from annelid.control.open_loop import TimedWave
from annelid.control.sns import Sns
from annelid_studies.pressure import PressureSns
from annelid_studies.slip import (
    CASES,
    CONTROLLERS,
    EXTENSION,
    PLAIN,
    PRESSURE,
    TIMED,
    Reading,
    case,
    feedback_table,
    write_readings,
    write_scores,
)
from annelid_studies.slip_detector import DetectionScore


def test_only_the_controller_differs() -> None:
    configs = {name: case(name, 1.0).config for name in CONTROLLERS}
    kinds = {name: type(config.controller) for name, config in configs.items()}
    assert kinds == {PLAIN: Sns, EXTENSION: PressureSns, PRESSURE: PressureSns, TIMED: TimedWave}
    pressure, extension = configs[PRESSURE], configs[EXTENSION]
    assert isinstance(pressure.controller, PressureSns)
    assert extension.controller == pressure.controller.model_copy(update={"hold": 0.0})
    same = {"controller": configs[PLAIN].controller, "sensor": configs[PLAIN].sensor}
    assert all(config.model_copy(update=same) == configs[PLAIN] for config in configs.values())


def test_readings_are_written_with_their_intervals(tmp_path: Path) -> None:
    near, none = (1.0, 0.9, 1.1), (0.0, 0.0, 0.0)
    readings = [
        Reading(0.7, TIMED, 4, 4, (0.3, 0.29, 0.31), (4.0, 3.9, 4.1), none, none),
        Reading(0.7, PRESSURE, 3, 4, (0.2, 0.19, 0.21), near, (-0.33, -0.4, -0.3), (0.75, 0.7, 0.8)),
    ]
    write_readings(readings, tmp_path / "slip.csv")
    first, second = csv.DictReader((tmp_path / "slip.csv").read_text(encoding="utf-8").splitlines())
    assert (first["controller"], second["controller"]) == (TIMED, PRESSURE)
    assert [float(second[f"saved{end}"]) for end in ("", "_low", "_high")] == [0.75, 0.7, 0.8]
    assert feedback_table(readings).row_count == 2


def test_scores_are_written_under_their_names(tmp_path: Path) -> None:
    write_scores({"a": DetectionScore(0.5, 0.25, 0.1, 2.0, 7, 0.75, 0.03, 0.9)}, tmp_path / "d.csv")
    [row] = csv.DictReader((tmp_path / "d.csv").read_text(encoding="utf-8").splitlines())
    assert row["run"] == "a"
    assert [float(row[name]) for name in ("precision", "recall", "episodes", "delay_s")] == [0.5, 0.25, 7, 0.03]
    assert len(CASES) == len({one.stem + str(one.changes) for one in CASES.values()})

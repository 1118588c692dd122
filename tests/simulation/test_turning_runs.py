"""Runs of worms that turn: continued to the last bit, mirrored within bounds, steered to a heading."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_robot import assert_equal, small_config

from annelid import load_config, open_run, simulate
from annelid.analysis.track import track_of
from annelid.protocols import SIDES
from annelid_studies.turning import COUNTER, turn_of

RIGHT_POST = {"arena.posts": [[0.1, 0.185, 0.03]]}
TOUCH = {"turning": {"kind": "touch"}} | RIGHT_POST
HEADING = {"turning": {"kind": "heading", "heading_deg": 40.0}}


@pytest.fixture
def light_touch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces of the rule for a robot that weighs little."""
    for name, force_N in {"TOUCH_STARTS_N": 0.5, "TOUCH_LEAST_N": 0.1, "TOUCH_FULL_N": 2.0}.items():
        monkeypatch.setattr(f"annelid.control.turning.{name}", force_N)


def test_no_modulation_is_the_plain_run_bit_for_bit(tmp_path: Path) -> None:
    plain = simulate(small_config(), tmp_path / "plain", progress=False)
    turning = simulate(
        small_config(turning={"kind": "constant", "modulation": 0.0}), tmp_path / "turning", progress=False
    )
    assert_equal(turning, plain)
    assert np.all(turning.data["half_scale"] == 1.0)


@pytest.mark.usefixtures("light_touch")
@pytest.mark.parametrize("turning", [TOUCH, HEADING], ids=["touch", "heading"])
def test_a_continued_run_is_the_whole_run_bit_for_bit(turning: dict[str, Any], tmp_path: Path) -> None:
    whole = simulate(small_config(**turning), tmp_path / "whole", progress=False)
    simulate(small_config(**turning, duration_s=0.2), tmp_path / "first", progress=False)
    rest = simulate(small_config(**turning), tmp_path / "rest", resume=tmp_path / "first", progress=False)
    assert float(whole.data["half_scale"].min()) < 1.0, "it must turn"
    assert_equal(rest, whole, len(open_run(tmp_path / "first").data["time"]))


@pytest.mark.slow
def test_opposite_modulations_turn_to_opposite_sides(tmp_path: Path) -> None:
    turns = []
    for modulation in (-0.6, 0.6):
        turning = {"kind": "constant", "modulation": modulation, "shares": list(COUNTER)}
        own = {"body.rings.layout": "halves", "sensor.tolerance_m": 0.008, "duration_s": 15.0, "turning": turning}
        track = track_of(simulate(load_config("riddle2025-muscles", own), tmp_path / f"{modulation}", progress=False))
        turns.append(turn_of(track, 2.6, after_s=2.6))
        assert np.abs(track.roll_rad).max() < np.pi / 4
    right, left = turns
    assert right.curvature_per_m < -0.1
    assert left.curvature_per_m > 0.1


def test_the_touch_of_the_floor_alone_turns_nobody(tmp_path: Path) -> None:
    run = simulate(small_config(turning={"kind": "touch"}), tmp_path / "run", progress=False)
    sides = run.data["touch"].values[..., [SIDES.index("left"), SIDES.index("right")]]
    assert np.abs(np.diff(sides[:, 0], axis=-1)).max() < 2.0
    assert np.all(run.data["half_scale"] == 1.0)


@pytest.mark.usefixtures("light_touch")
def test_a_post_on_the_right_is_felt_there_and_turns_the_worm_away_from_it(tmp_path: Path) -> None:
    run = simulate(small_config(**TOUCH), tmp_path / "run", progress=False)
    front = run.data["touch"].values[:, 0]
    assert front[:, SIDES.index("right")].max() > 0.5
    assert front[:, SIDES.index("left")].max() == 0.0
    scales = run.data["half_scale"].values
    assert scales[..., 0].min() < 1.0
    assert np.all(scales[..., 1] == 1.0)

"""The study of pipes: what is compared with what, what it leaves behind, and a worm in a short pipe."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from annelid import load_config, open_run, simulate
from annelid.analysis import passage_of
from annelid.control.robust import RobustSns
from annelid.errors import RunFileError
from annelid_studies.pipes import (
    ADAPTIVE,
    FIXED,
    NARROW_ARENAS,
    PRESET,
    Course,
    Reading,
    pipes_picture,
    trials,
)


def reading(**changes: object) -> Reading:
    values = {
        "arena": "bend",
        "gait": "reactive",
        "radius_m": 0.6,
        "passed": True,
        "speed_m_per_s": 0.04,
        "drawn_speed_m_per_s": np.nan,
        "drawn_speed_low": np.nan,
        "drawn_speed_high": np.nan,
        "half_step_change_m_per_s": np.nan,
        "front_m": 1.2,
        "in_order": True,
        "work_J_per_m": 100.0,
        "slip_ratio": None,
        "command": "annelid run x",
    }
    return Reading(**{**values, **changes})  # type: ignore[arg-type]


def test_adaptation_is_all_that_the_adaptive_and_the_fixed_wave_differ_in() -> None:
    for arena in NARROW_ARENAS:
        fixed, adaptive = (
            next(one.case.config for one in trials() if (one.arena, one.gait) == (arena, gait))
            for gait in (FIXED, ADAPTIVE)
        )
        assert isinstance(fixed.controller, RobustSns)
        assert isinstance(adaptive.controller, RobustSns)
        assert fixed.controller.descending.lift == 0.0
        descending = adaptive.controller.descending.model_copy(update={"lift": 0.0})
        plain = adaptive.controller.model_copy(update={"descending": descending})
        assert adaptive.model_copy(update={"controller": plain}) == fixed


def test_quick_trials_are_some_of_all() -> None:
    every = [one.case for one in trials()]
    assert all(one.case in every for one in trials(quick=True))


def test_the_picture_shows_whatever_there_is(tmp_path: Path) -> None:
    front = np.linspace(0.0, 1.0, 20)
    course = Course(front, np.full(20, 0.15), 0.01 + 0.0 * front, front, 0.9 - 0.2 * front)
    some = [reading(), reading(radius_m=0.3, passed=False), reading(radius_m=0.9, speed_m_per_s=np.nan)]
    for readings, courses in ((some, {("taper", FIXED): course}), ([], {})):
        path = pipes_picture(readings, courses, tmp_path / "pipes")
        assert path.stat().st_size > 1000
        assert path.with_suffix(".svg").exists()


def test_a_worm_in_a_pipe_has_a_passage_and_one_on_the_floor_has_none(tmp_path: Path) -> None:
    short = {
        "duration_s": 0.3,
        "record.frames_interval_s": 0.1,
        "controller": {"kind": "sns-robust", "descending": {"lift": 0.45}},
    }
    pipe = {"arena.profile": "taper", "arena.narrowest": 0.13, "arena.profile_start": 0.05}
    config = load_config(PRESET, {**short, **pipe}, arena="pipe")
    passage = passage_of(open_run(simulate(config, tmp_path / "pipe", progress=False).path))
    assert passage.ring_arc_m.shape == (4, 6)
    assert passage.reach_m == pytest.approx((0.05, 0.55))
    # Rings start 0.112 m apart, three planes, the foremost behind the worm's front.
    assert -np.diff(passage.ring_arc_m[0]) == pytest.approx(np.full(5, 3 * 0.0374), abs=1e-3)
    assert -0.12 < passage.front_m[0] < 0.0
    on_the_floor = simulate(load_config(PRESET, {"duration_s": 0.1}), tmp_path / "floor", progress=False)
    with pytest.raises(RunFileError, match="holds a worm on a floor, and so no passage"):
        passage_of(open_run(on_the_floor.path))

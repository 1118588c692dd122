"""The paper of 2025: how speeds are read, what is run, how claims are judged, and what the report shows."""

from __future__ import annotations

import csv
from collections.abc import Callable
from math import nan
from pathlib import Path

import numpy as np
import pytest

from annelid.body import WormBody
from annelid.control.open_loop import TimedWave
from annelid_studies.papers.report_parts import Claim
from annelid_studies.riddle2025 import claims, paper
from annelid_studies.riddle2025.claims import FRAME_N, JUDGES, PIN_FRICTIONS_NM, Evidence
from annelid_studies.riddle2025.runs import (
    DRAWS,
    WIDE_M,
    Point,
    Reading,
    cases,
    cycle_s,
    points,
    repeated,
    speed_of_line,
)
from annelid_studies.standard_cases import Effort
from annelid_studies.tables import write_fields


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
    further_time, further = repeated(time, place, 6.0, 80.0)
    assert further_time == pytest.approx(np.linspace(0.0, 80.0, 801))
    assert further == pytest.approx(0.04 * further_time + 0.01 * np.sin(2 * np.pi * further_time / 6.0))


def test_every_point_is_under_a_pattern_of_the_authors_and_starts_its_bend_as_far_ahead() -> None:
    every = {(*point[:3], point.radius_m): point for point in points("full")}
    for point in every.values():
        config = cases(point, 1)[0].config
        body, wave = config.body, config.controller
        assert isinstance(body, WormBody)
        assert isinstance(wave, TimedWave)
        assert body.n_segments * wave.interval_s / wave.waves == cycle_s(point)
        assert (wave.rise_s, wave.hold_s, wave.fall_s, wave.level) == (1.0, 1.0, 1.0, 1.0)
        assert body.strands.young_modulus_Pa == 1e9 * point.modulus_GPa
        assert body.strands.shear_modulus_Pa == pytest.approx(point.modulus_GPa * 2e9 / 3, rel=0.003)
        if point.radius_m:
            assert config.arena is not None
            assert config.arena.reach_m() == pytest.approx((0.25, 0.25 + point.radius_m * np.pi / 2))


def test_a_quick_report_has_some_runs_of_the_full_one() -> None:
    quick, full = (
        {case.command for point in points(effort) for case in cases(point, DRAWS[effort])} for effort in Effort.__args__
    )
    assert quick - full == {
        cases(point, 1)[0].command for point in points("quick") if point.friction == 1.0 and point.gait == "2x1"
    }


def read(point: Point, speed_m_per_s: float, out: bool, draw: int) -> Reading:
    speed = speed_m_per_s * (1.0 + 0.001 * draw)
    return Reading(*point, point.friction * (1.0 + 0.001 * draw), speed, 0.5, out, "")


def evidence(speed_of: Callable[[Point], float], out: Callable[[Point], bool], draws: int = 3) -> Evidence:
    """Made-up runs of all points, the faster the later they are drawn, and a load frame as the authors'."""
    runs = [
        read(point, speed_of(point), out(point), draw)
        for point in points("full")
        for draw in range(1 if point.half_step else draws)
    ]
    pins = {(2.0, friction): 16.05 * (1.0 + 10.0 * friction) for friction in PIN_FRICTIONS_NM}
    return Evidence(runs, {**{(modulus, 0.0): peak for modulus, peak in FRAME_N.items()}, **pins})


def as_published(point: Point) -> float:
    if point.gait == "3x1, as in 2026":
        return 0.0415
    slope = 0.005 if point.modulus_GPa == 2.0 else -0.005
    bend = (0.01 if point.modulus_GPa == 2.0 else 0.0) if point.radius_m else 0.0
    return (0.02 if point.gait == "2x1" else 0.032) + bend + slope * point.friction


def passes(point: Point) -> bool:
    return point.modulus_GPa == 0.3 if point.bore_m < WIDE_M else point.radius_m >= 0.7 or "touch" in point.gait


def judged(of: Evidence) -> dict[str, Claim]:
    return dict(zip(claims.texts(claims.CLAIMS_TOML)["claims"], claims.claims(of), strict=True))


def test_claims_hold_for_worms_as_published() -> None:
    found = judged(evidence(as_published, passes))
    assert found.keys() == JUDGES.keys()
    verdicts = {name: (one.verdict, one.within) for name, one in found.items()}
    assert verdicts.pop("screws") == ("rests on", "the friction of the pins")
    assert set(verdicts.values()) == {("holds", "")}
    assert "servos, 0.3 GPa, friction 0.1 to 0.3: −0.10 (−0.10 to −0.10)" in found["friction_soft"].ours
    assert (
        "3x1, servos, 1 GPa, 0.3 m: 0 of 3 out, front at 0.50 (0.50 to 0.50) m, the end at 0.72 m"
        in found["tight_bend"].ours
    )


def test_a_verdict_rests_on_the_field_that_alone_decides_it() -> None:
    found = judged(evidence(lambda point: 0.04 * (1.5 if point.rings == "muscles" else 1.0), lambda point: True))
    assert (found["flat_speed"].verdict, found["flat_speed"].within) == ("rests on", "the actuators")
    assert (found["tight_bend"].verdict, found["tight_bend"].within) == ("does not hold", "")
    assert (found["drawn_radii"].verdict, found["drawn_radii"].within) == ("rests on", "the point")
    assert {found[name].verdict for name in ("gaits", "friction_stiff", "friction_soft", "wide_bends")} == {
        "does not hold"
    }


def test_a_difference_is_of_the_same_draws_and_a_stopped_run_decides_nothing() -> None:
    stiff, soft = (Point(modulus_GPa=modulus, bore_m=0.16, radius_m=0.5) for modulus in (2.0, 0.3))
    runs = [
        read(point, speed, True, draw)
        for draw in range(3)
        for point, speed in ((stiff, 0.0402 + 0.02 * draw), (soft, 0.04 + 0.02 * draw))
    ]
    assert claims.wide_bends(Evidence(runs, {}))[0] == ("holds", "")
    runs[0] = Reading(*stiff, 0.3, nan, nan, False, "stopped: a reason")
    (verdict, _), words = claims.wide_bends(Evidence(runs, {}))
    assert verdict == "does not hold"
    assert words["having"] == 0
    assert claims.gaits(Evidence(runs, {}))[0] == ("not testable here", "")
    stuck = [Reading(*stiff._replace(radius_m=0.3), 0.3, nan, nan, False, "stopped: a reason")]
    assert claims.tight_bend(Evidence(stuck, {}))[0] == ("does not hold", "")
    assert "1 of 6" in claims.rule(Evidence(runs, {}), "full")[-1]


def test_readings_are_written_laid_out_and_drawn(tmp_path: Path) -> None:
    of = evidence(as_published, passes)
    with write_fields(Reading, of.readings, tmp_path / "x.csv").open(newline="", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == len(of.readings)
    table = paper.points_table(
        [*of.readings[:3], Reading(*Point(bore_m=0.16, radius_m=0.5), 0.3, nan, nan, False, "stopped")]
    )
    assert table.rows[0][:5] == ["flat", "3x1, servos, 2 GPa", "0.1", "3", "3.25 (3.25 to 3.26)"]
    assert table.rows[1] == [
        "bend of 0.5 m, bore 0.16 m",
        "3x1, servos, 2 GPa",
        "0.3",
        "1",
        "–",
        "0",
        "–",
        "1 of 1 runs: stopped",
    ]
    assert [row[2] for row in paper.main_table(of).rows][2:] == ["4.15", "16.05", "9.34", "4.71"]
    path = paper.speeds_picture(of.readings, tmp_path / "x")
    assert path.stat().st_size > 1000
    assert path.with_suffix(".svg").exists()

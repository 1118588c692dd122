"""The study of speed over friction and number of segments: what is changed, and what it leaves behind."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from annelid.analysis.gait import Gait
from annelid.body.worm import WormBody
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.experiment.tune import Judged
from annelid_studies.crawling import (
    VALUES,
    Headline,
    Reading,
    changes_for,
    crawling_table,
    headline_table,
    runs,
    write_headlines,
    write_readings,
)

MUSCLES, SERVOS = "riddle2025-muscles", "riddle2025"


def test_longer_worms_have_rings_as_strong_as_the_second_and_ends_as_before(subtests: pytest.Subtests) -> None:
    for gait in (MUSCLES, SERVOS):
        for n_segments in (3, 6, 12):
            with subtests.test(f"{gait!r:.60}, {n_segments!r:.60}"):
                body = load_config(gait, changes_for(gait, "segments", n_segments)).body
                assert isinstance(body, WormBody)
                forces = body.rings.forces(n_segments)
                assert forces == [16.0, *[31.0] * (n_segments - 2), 16.0]


def test_planar_worms_are_refused() -> None:
    with pytest.raises(ConfigError, match="needs the 3D worm"):
        runs(["riddle2022-planar"], "quick")


def test_both_quantities_pass_through_the_gait_s_own_worm() -> None:
    chosen = runs([MUSCLES, SERVOS], "full")
    assert len(chosen) == 2 * sum(len(of["full"]) for of in VALUES.values())
    for gait in (MUSCLES, SERVOS):
        own = load_config(gait)
        assert isinstance(own.body, WormBody)
        assert own.arena is not None
        present = {"friction": own.arena.friction, "segments": float(own.body.mesh.n_segments)}
        for quantity, value in present.items():
            [case] = [case for point, case in chosen.items() if point == (gait, quantity, value)]
            assert load_config(gait, dict(case.changes)) == own


def readings() -> list[Reading]:
    """Of two gaits; the second does not walk with few segments."""
    found = []
    for name, quantity, value in runs([MUSCLES, SERVOS], "quick"):
        walks = name == MUSCLES or value != 3
        gait = Gait(cycles=3, speed_m_per_s=0.1 * value, cost_of_transport=1.5, slip_ratio=0.3)
        found.append(Reading(name, quantity, value, Judged(gait, "" if walks else "silent: stalled")))
    return found


def test_every_point_is_a_row_and_what_does_not_walk_has_no_numbers(tmp_path: Path) -> None:
    write_readings(readings(), tmp_path / "speed.csv")
    rows = list(csv.DictReader((tmp_path / "speed.csv").open()))
    assert len(rows) == len(readings())
    for row, reading in zip(rows, readings(), strict=True):
        assert (row["gait"], row["quantity"], float(row["value"])) == reading[:3]
        if reading.judged.problem:
            assert (row["speed_m_per_s"], row["slip_ratio"], row["problem"]) == ("", "", "silent: stalled")
        else:
            assert float(row["speed_m_per_s"]) == pytest.approx(0.1 * reading.value)


def test_the_tables_take_gaits_that_do_not_walk() -> None:
    for quantity, values in VALUES.items():
        assert crawling_table(readings(), quantity).row_count == 2 * len(values["quick"])


def headline() -> Headline:
    """Of a gait whose perturbed runs make 1, 2 and 3 m/s, but for one that stalls, and that is faster when finer."""
    walks = [Judged(Gait(cycles=3, speed_m_per_s=speed), "") for speed in (1.0, 2.0, 3.0)]
    stalls = Judged(None, "silent: stalled")
    finer = {"half_step": Judged(Gait(cycles=3, speed_m_per_s=2.2), ""), "quarter_step": stalls}
    return Headline(MUSCLES, Judged(Gait(cycles=3, speed_m_per_s=2.0), ""), [*walks, stalls], finer)


def test_an_interval_is_student_s_over_the_runs_that_walk() -> None:
    found = headline()
    assert found.n_walking == 3
    # 4.3027 is Student's t of 95 % for two degrees of freedom; the standard error is 1 / sqrt 3.
    assert found.interval("speed_m_per_s") == pytest.approx(
        (2.0, 2.0 - 4.3027 / 3**0.5, 2.0 + 4.3027 / 3**0.5), rel=1e-4
    )
    assert found.interval("slip_ratio") == (None, None, None)
    assert found.changes("speed_m_per_s") == {"half_step": pytest.approx(0.1), "quarter_step": None}
    assert found.problem == "run 4: silent: stalled; quarter_step: silent: stalled"


def test_a_headline_is_a_row_with_what_is_not_known_left_empty(tmp_path: Path) -> None:
    [row] = csv.DictReader(write_headlines([headline()], tmp_path / "gaits.csv").open())
    assert (row["gait"], row["walking"], float(row["speed_m_per_s"])) == (MUSCLES, "3", 2.0)
    assert float(row["speed_m_per_s_half_step"]) == pytest.approx(0.1)
    assert (row["speed_m_per_s_quarter_step"], row["slip_ratio"]) == ("", "")
    assert headline_table([headline()]).row_count == 1

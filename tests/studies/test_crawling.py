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
    Reading,
    changes_for,
    crawling_table,
    runs,
    write_figure,
    write_readings,
)

MUSCLES, SERVOS = "riddle2025-muscles", "riddle2025"


@pytest.mark.parametrize("n_segments", [3, 6, 12])
@pytest.mark.parametrize("gait", [MUSCLES, SERVOS])
def test_longer_worms_have_rings_as_strong_as_the_second_and_ends_as_before(gait: str, n_segments: int) -> None:
    body = load_config(gait, changes_for(gait, "segments", n_segments)).body
    assert isinstance(body, WormBody)
    forces = body.rings.forces(n_segments)
    assert forces == [16.0, *[31.0] * (n_segments - 2), 16.0]


def test_a_long_worm_is_watched_in_proportion_and_a_short_one_no_shorter() -> None:
    before = load_config(MUSCLES).duration_s
    after = {n: load_config(MUSCLES, changes_for(MUSCLES, "segments", n)).duration_s for n in (3, 6, 12)}
    assert after == {3: before, 6: before, 12: 2.0 * before}


def test_a_ground_changes_nothing_but_friction() -> None:
    assert changes_for(MUSCLES, "friction", 0.05) == {"arena.friction": 0.05}


def test_planar_worms_are_refused() -> None:
    with pytest.raises(ConfigError, match="needs a 3D worm"):
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


def test_the_figure_and_the_tables_take_gaits_that_do_not_walk(tmp_path: Path) -> None:
    picture = write_figure(readings(), tmp_path / "speed")
    assert picture.stat().st_size > 1000
    assert (tmp_path / "speed.svg").stat().st_size > 1000
    for quantity, values in VALUES.items():
        assert crawling_table(readings(), quantity).row_count == 2 * len(values["quick"])


def test_a_reading_s_number_is_its_gait_s() -> None:
    gait = Gait(cycles=3, speed_m_per_s=0.1, cost_of_transport=1.5)
    walks, rests = (Reading(MUSCLES, "friction", 0.7, Judged(gait, problem)) for problem in ("", "does not advance"))
    assert walks.number("cost_of_transport") == 1.5
    assert walks.number("slip_ratio") is None
    assert rests.number("cost_of_transport") is None

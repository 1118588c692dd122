"""The crawlers are as fast as they claim, in order, and not by an accident of the friction, the step or the mesh."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from annelid.analysis import gait, summary
from annelid.config import load_config
from annelid.simulation import simulate
from annelid_studies.crawling import HEADLINES, PERTURBED

GAITS = Path(__file__).parent.parent / "docs" / "results" / "gaits.csv"
"""What `annelid study gaits` found."""
CRAWLERS = ("crawler", "crawler-timed", "crawler-servo")
FINER = ("half_step", "quarter_step", "element_more", "elements_more")
UNTUNED = "riddle2025-muscles"
"""At the edge of its order: it walks with five of eight frictions (docs/evidence/speed_of_travel.md)."""
CMMWORM_M_PER_S = 0.258 / 60.0


def headlines() -> dict[str, dict[str, str]]:
    return {row["gait"]: row for row in csv.DictReader(GAITS.open())}


@pytest.mark.parametrize("preset", HEADLINES)
def test_a_gait_s_measured_speed_is_the_same_in_perturbed_runs_and_at_finer_resolution(preset: str) -> None:
    row = headlines()[preset]
    if preset != UNTUNED:
        assert int(row["walking"]) == PERTURBED["full"]
        assert row["problem"] == ""
    speed, low = float(row["speed_m_per_s"]), float(row["speed_m_per_s_low"])
    assert low > 0.9 * speed
    for what in FINER:
        assert abs(float(row[f"speed_m_per_s_{what}"])) < 0.1, what


def test_the_tuned_network_is_faster_than_the_untuned_one_and_the_clock_faster_than_both() -> None:
    rows = headlines()
    untuned, tuned, timed = (rows[name] for name in ("riddle2025-muscles", "crawler", "crawler-timed"))
    assert float(tuned["speed_m_per_s_low"]) > float(untuned["speed_m_per_s_high"])
    assert float(timed["speed_m_per_s_low"]) > float(tuned["speed_m_per_s_high"])


@pytest.mark.slow
@pytest.mark.parametrize("preset", CRAWLERS)
@pytest.mark.parametrize("changes", [{}, {"arena.contact_time_constant_s": 0.0141421}], ids=["itself", "stiff ground"])
def test_a_crawler_is_as_fast_as_measured_and_in_order(tmp_path: Path, preset: str, changes: dict[str, float]) -> None:
    run = simulate(load_config(preset, changes), tmp_path, progress=False)
    assert summary(run).wave
    found = gait(run)
    assert found.cycles >= 2
    assert found.speed_m_per_s == pytest.approx(float(headlines()[preset]["speed_m_per_s"]), rel=0.1)


def test_with_servos_of_the_robot_s_speed_and_force_it_is_faster_than_cmmworm() -> None:
    assert float(headlines()["crawler-servo"]["speed_m_per_s_low"]) > CMMWORM_M_PER_S

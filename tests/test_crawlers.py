"""The crawlers are as fast as they claim, in order, and not by an accident of the friction, the step or the mesh."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest

from annelid.analysis import Gait, gait, summary
from annelid.config import load_config
from annelid.simulation import Run, simulate
from annelid_studies.crawling import PERTURBED

GAITS = Path(__file__).parent.parent / "docs" / "results" / "gaits.csv"
"""What `annelid experiment gaits` found."""
CRAWLERS = ("crawler", "crawler-timed", "crawler-servo")
FINER = ("half_step", "quarter_step", "element_more", "elements_more")
CMMWORM_M_PER_S = 0.258 / 60.0
SERVOS = {"body.rings.speed_limit_m_per_s": 0.064, "body.rings.force_limit_N": 13.0}
"""The robot's cable speed and force."""


def headlines() -> dict[str, dict[str, str]]:
    return {row["gait"]: row for row in csv.DictReader(GAITS.open())}


def crawl(preset: str, folder: Path, **changes: Any) -> tuple[Run, Gait]:
    run = simulate(load_config(preset, changes), folder, progress=False)
    return run, gait(run)


@pytest.mark.parametrize("preset", CRAWLERS)
def test_a_crawler_s_measured_speed_is_the_same_in_perturbed_runs_and_at_finer_resolution(preset: str) -> None:
    row = headlines()[preset]
    assert int(row["walking"]) == PERTURBED["full"]
    assert row["problem"] == ""
    speed, low = float(row["speed_m_per_s"]), float(row["speed_m_per_s_low"])
    assert low > 0.9 * speed
    for what in FINER:
        assert abs(float(row[f"speed_m_per_s_{what}"])) < 0.1, what


def test_the_crawlers_do_a_fifth_of_their_length_a_second() -> None:
    rows = headlines()
    for preset in ("crawler", "crawler-timed"):
        assert float(rows[preset]["speed_body_lengths_per_s_low"]) > 0.2


@pytest.mark.slow
@pytest.mark.parametrize("preset", CRAWLERS)
def test_a_crawler_is_as_fast_as_measured_and_in_order(tmp_path: Path, preset: str) -> None:
    run, found = crawl(preset, tmp_path / "run")
    assert summary(run).wave
    assert found.cycles >= 2
    assert found.speed_m_per_s == pytest.approx(float(headlines()[preset]["speed_m_per_s"]), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("preset", CRAWLERS)
def test_a_crawler_s_speed_is_no_accident_of_soft_contacts(tmp_path: Path, preset: str) -> None:
    _, soft = crawl(preset, tmp_path / "soft")
    _, stiff = crawl(preset, tmp_path / "stiff", **{"arena.contact_time_constant_s": 0.0141421})
    assert stiff.speed_m_per_s == pytest.approx(soft.speed_m_per_s, rel=0.1)


@pytest.mark.slow
def test_the_crawler_is_faster_than_untuned(tmp_path: Path) -> None:
    _, tuned = crawl("crawler", tmp_path / "tuned")
    _, untuned = crawl("riddle2025-muscles", tmp_path / "untuned")
    assert None not in (tuned.speed_m_per_s, untuned.speed_m_per_s)
    assert tuned.speed_m_per_s > untuned.speed_m_per_s  # type: ignore[operator]


@pytest.mark.slow
def test_with_servos_of_the_robot_s_speed_and_force_it_is_faster_than_the_robot_and_untuned(tmp_path: Path) -> None:
    run, found = crawl("crawler-servo", tmp_path / "servo")
    _, untuned = crawl("riddle2025", tmp_path / "untuned", duration_s=run.config.duration_s, **SERVOS)
    assert found.speed_m_per_s is not None
    assert found.speed_m_per_s > CMMWORM_M_PER_S
    assert untuned.speed_m_per_s is not None
    assert found.speed_m_per_s > untuned.speed_m_per_s

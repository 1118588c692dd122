"""The crawlers are as fast as they claim, in order, and not by an accident of the time step or of soft contacts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from annelid.analysis import Gait, gait
from annelid.analysis.rhythm import rhythm, segment_activation
from annelid.config import load_config
from annelid.simulation import Run, simulate

CMMWORM_M_PER_S = 0.258 / 60.0
SERVOS = {"body.rings.speed_limit_m_per_s": 0.064, "body.rings.force_limit_N": 13.0}
"""The robot's cable speed and force."""


def crawl(preset: str, folder: Path, **changes: Any) -> tuple[Run, Gait]:
    run = simulate(load_config(preset, changes), folder, progress=False)
    return run, gait(run)


@pytest.mark.slow
def test_the_crawler_does_a_fifth_of_its_length_a_second_and_better_than_untuned(tmp_path: Path) -> None:
    run, tuned = crawl("crawler", tmp_path / "tuned")
    _, untuned = crawl("riddle2025-muscles", tmp_path / "untuned")
    beat = rhythm(run.data["time"].values, segment_activation(run.data["activation"].values, 6))
    assert beat.wave
    assert beat.full_cycles >= 3
    for name in ("speed_body_lengths_per_s", "slip_ratio", "cost_of_transport_cables"):
        assert None not in (getattr(tuned, name), getattr(untuned, name))
    assert tuned.speed_body_lengths_per_s > 0.2  # type: ignore[operator]
    assert tuned.speed_body_lengths_per_s > untuned.speed_body_lengths_per_s  # type: ignore[operator]
    assert tuned.slip_ratio < untuned.slip_ratio  # type: ignore[operator]
    assert tuned.cost_of_transport_cables < untuned.cost_of_transport_cables  # type: ignore[operator]


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["crawler", "crawler-servo"])
@pytest.mark.parametrize(
    "changes",
    [{"clock.physics_timestep_s": 0.005}, {"arena.contact_time_constant_s": 0.0141421}],
    ids=["half the step", "twice the contact stiffness"],
)
def test_a_crawler_s_speed_is_resolved_within_a_tenth(tmp_path: Path, preset: str, changes: dict[str, float]) -> None:
    _, coarse = crawl(preset, tmp_path / "coarse")
    _, fine = crawl(preset, tmp_path / "fine", **changes)
    assert fine.speed_m_per_s == pytest.approx(coarse.speed_m_per_s, rel=0.1)


@pytest.mark.slow
def test_with_servos_of_the_robot_s_speed_and_force_it_is_faster_than_the_robot_and_untuned(tmp_path: Path) -> None:
    run, found = crawl("crawler-servo", tmp_path / "servo")
    _, untuned = crawl("riddle2025", tmp_path / "untuned", duration_s=run.config.duration_s, **SERVOS)
    beat = rhythm(run.data["time"].values, segment_activation(run.data["activation"].values, 6))
    assert beat.wave
    assert found.speed_m_per_s is not None
    assert found.speed_m_per_s > CMMWORM_M_PER_S
    for name in ("speed_m_per_s", "slip_ratio", "cost_of_transport_cables"):
        assert getattr(untuned, name) is not None
    assert found.speed_m_per_s > untuned.speed_m_per_s  # type: ignore[operator]
    assert found.slip_ratio < untuned.slip_ratio  # type: ignore[operator]
    assert found.cost_of_transport_cables < untuned.cost_of_transport_cables  # type: ignore[operator]

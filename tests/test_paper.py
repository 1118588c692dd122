"""The paper's worm against the paper's numbers, and the rod worm against the same rhythm."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from annelid.analysis import Summary, summary
from annelid.analysis.paper import formulation
from annelid.config import load_config
from annelid.simulation import Run, simulate


def crawl(preset: str, out: Path, **overrides: object) -> tuple[Run, Summary]:
    run = simulate(load_config(preset, overrides), out, progress=False)
    return run, summary(run)


def assert_wave(result: Summary, n_segments: int, period_s: float, tolerance_s: float) -> None:
    assert result.order[: 2 * n_segments] == 2 * list(range(1, n_segments + 1))
    assert result.full_cycles >= 2
    assert result.period_s == pytest.approx(period_s, abs=tolerance_s)


def test_the_rod_worm_walks_in_the_paper_s_rhythm_with_edges_that_hold(tmp_path: Path) -> None:
    run, result = crawl("riddle2023-rods", tmp_path)
    assert_wave(result, 3, 2.635, 0.05)
    assert result.edge_strain_max is not None
    assert result.edge_strain_max < 0.02
    assert "pin_gap" not in run.data
    assert np.all(np.isfinite(run.data["spring_length"]))
    assert result.elongation_mean_max_m is not None
    assert all(elongation is not None and elongation > 0.05 for elongation in result.elongation_mean_max_m)


def test_edges_hold_better_at_shorter_steps(tmp_path: Path) -> None:
    _, result = crawl("riddle2023-rods", tmp_path, **{"clock.physics_timestep_s": 0.005, "duration_s": 0.5})
    assert result.edge_strain_max is not None
    assert result.edge_strain_max < 0.005


def test_the_paper_s_formulation_starts_as_in_the_paper(tmp_path: Path) -> None:
    """A cheap representative of the slow run below: the first half second of segment 1's contraction."""
    _, result = crawl("riddle2023", tmp_path, duration_s=0.5)
    assert result.order == [1]
    assert result.elongation_first_helix_pp_m is not None
    assert result.elongation_first_helix_pp_m[0] == pytest.approx(0.042, rel=0.2)
    assert result.pin_gap_max_m is not None
    assert 0.005 < result.pin_gap_max_m < 0.045


CHAIN_MEAN_M = (0.0329, 0.0256, 0.0339)
"""Elongation of each segment of `riddle2023`, mean of its six sensors, which the slow test below computes again."""


def test_the_fast_worm_walks_as_the_paper_s(tmp_path: Path) -> None:
    """A cheap representative of the slow comparison below: order, period and mean elongations of the chain."""
    run, result = crawl("riddle2023-fast", tmp_path)
    assert_wave(result, 3, 2.629, 0.026)
    assert result.elongation_mean_max_m == pytest.approx(CHAIN_MEAN_M, rel=0.05)
    assert "pin_gap" in run.data
    assert "edge_strain" in run.data


@pytest.mark.slow
def test_the_fast_worm_matches_the_paper_s_formulation(tmp_path: Path) -> None:
    """Order and period are the chain's, and each segment's mean elongation within 5 % of it, at half the step too.

    Neither step nor mesh changes that elongation by over 2 %.
    """
    _, chain = crawl("riddle2023", tmp_path / "chain")
    assert chain.elongation_mean_max_m == pytest.approx(CHAIN_MEAN_M, rel=0.005)
    means: list[list[float | None]] = []
    for step_s, elements in ((0.02, 2), (0.01, 2), (0.02, 4), (0.005, 2)):
        changes = {"clock.physics_timestep_s": step_s, "body.mesh.elements_per_side": elements}
        _, fast = crawl("riddle2023-fast", tmp_path / f"{step_s} {elements}", **changes)
        assert fast.elongation_mean_max_m is not None
        print(step_s, fast.order, fast.period_s, fast.elongation_mean_max_m, chain.elongation_mean_max_m)
        means.append(fast.elongation_mean_max_m)
        assert fast.elongation_mean_max_m == pytest.approx(means[0], rel=0.02)
        if step_s < 0.01:
            continue
        assert fast.order == chain.order
        assert fast.onsets_s == pytest.approx(chain.onsets_s, abs=0.03)
        assert fast.period_s == pytest.approx(chain.period_s, rel=0.01)
        assert fast.elongation_mean_max_m == pytest.approx(chain.elongation_mean_max_m, rel=0.05)


@pytest.mark.slow
def test_the_paper_s_numbers(tmp_path: Path) -> None:
    """Section 3 of the paper: 4.20, 2.55, 4.02 cm; segment 2 is 39.4 % below segment 1; forces up to 2.5 N."""
    _, result = crawl("riddle2023", tmp_path)
    assert_wave(result, 3, 2.635, 0.05)
    assert result.elongation_first_helix_pp_m == pytest.approx([0.0420, 0.0255, 0.0402], rel=0.08)
    assert result.middle_deficit == pytest.approx(0.394, abs=0.04)
    assert result.contraction_force_median_N is not None
    assert 1.9 <= result.contraction_force_median_N <= 2.6
    assert result.travel_m is not None
    assert abs(result.travel_m) < 0.060
    kept = formulation()
    assert result.order == kept.order
    for field in ("period_s", "elongation_mean_max_m", "elongation_least_pp_m", "elongation_most_pp_m"):
        assert getattr(result, field) == pytest.approx(getattr(kept, field), rel=1e-3), field


@pytest.mark.slow
@pytest.mark.parametrize("n_segments", [4, 6, 12])
@pytest.mark.parametrize("preset", ["riddle2022-planar", "riddle2023-rods"])
def test_longer_worms_walk_two_ordered_cycles(tmp_path: Path, preset: str, n_segments: int) -> None:
    field = "body.n_segments" if preset == "riddle2022-planar" else "body.mesh.n_segments"
    period = 0.8752 * n_segments
    _, result = crawl(preset, tmp_path, **{field: n_segments, "duration_s": round(2 * period + 1.2, 3)})
    assert_wave(result, n_segments, period, 0.02)

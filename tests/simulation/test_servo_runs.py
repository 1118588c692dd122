"""Runs of a worm with servos: as the robot measured, and walking under the paper's network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from annelid import load_config, simulate
from annelid.analysis import ROBOT_ELONGATION_M, summary


def errors_in_turns(source: str | Path, tmp_path: Path, **changes: Any) -> np.ndarray:
    """Relative errors of the four elongations over the first cycle, and that of the interior's mean."""
    config = load_config(source, {"duration_s": 34.0} | changes)
    numbers = summary(simulate(config, tmp_path, progress=False))
    assert numbers.order == [1, 2, 3, 4]
    ours, robot = (np.array(each, float) for each in (numbers.elongation_mean_max_m, ROBOT_ELONGATION_M))
    ours, robot = (np.append(each, each[1:3].mean()) for each in (ours, robot))
    return np.abs(ours / robot - 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("timestep_s", [0.02, 0.01])
def test_in_its_first_turns_the_robot_with_equal_servos_is_as_measured(tmp_path: Path, timestep_s: float) -> None:
    finer = {"clock.physics_timestep_s": timestep_s, "record.signals_interval_s": timestep_s}
    errors = errors_in_turns("wang", tmp_path, **finer)
    assert errors[[0, 3, 4]].max() <= 0.05
    assert errors[[1, 2]].max() <= 0.15


@pytest.mark.slow
def test_the_robot_walks_in_order_under_the_paper_s_network(tmp_path: Path) -> None:
    numbers = summary(simulate("wang-network", tmp_path, progress=False))
    assert numbers.order == [i % 4 + 1 for i in range(len(numbers.order))]
    assert numbers.full_cycles == 3

"""The robot `wang` cut down to what a test can afford, and runs compared bit for bit."""

from __future__ import annotations

from typing import Any

import numpy as np

from annelid import RunConfig, load_config
from annelid.simulation import Run

SMALL = {
    "duration_s": 0.4,
    "body.mesh.n_segments": 3,
    "body.mesh.elements_per_side": 1,
    "clock.physics_timestep_s": 0.02,
    "record.signals_interval_s": 0.02,
    "record.frames_interval_s": 0.1,
}


def small_config(**changes: Any) -> RunConfig:
    return load_config("wang", SMALL | changes)


def assert_equal(ours: Run, expected: Run, start: int = 0) -> None:
    for name, variable in expected.data.data_vars.items():
        if "time" in variable.dims and name != "wall_time":
            assert np.array_equal(ours.data[name], variable[start:], equal_nan=True), name

"""The network on the planar worm: the published periods and the order of contraction."""

from typing import Any

import numpy as np
import pytest

from annelid.config import Clock, load_config
from annelid.nervous import Scheme
from annelid.protocols import Sensation
from annelid_studies.planar import Riddle2022Plant
from annelid_studies.planar.riddle2022 import PlanarBody

TIMESTEP_S = 0.001


def contraction_times_ms(n, tau_ms, gain, duration_s, scheme: Scheme = "euler") -> list[np.ndarray]:
    """Times at which each segment's contraction neuron overtakes its expansion neuron, between samples."""
    clock = Clock(control_timestep_s=TIMESTEP_S, physics_timestep_s=TIMESTEP_S)
    plant = Riddle2022Plant(PlanarBody(n_segments=n, gain=gain), clock)
    section = {"kind": "sns", "gate_time_constant_ms": tau_ms, "activation": "linear", "scheme": scheme}
    config = load_config({"controller": section, "sensor": {"tolerance_m": 0.0001}})
    controller: Any = config.controller.build(config, plant)
    felt: Sensation = plant.reset(0)
    controller.reset(0)
    difference = np.empty((round(duration_s / TIMESTEP_S), n))
    for row in difference:
        felt = plant.step(controller.step(felt))
        u = np.asarray(controller.read(frame=False)["potential"]).reshape(n, 4)
        row[:] = u[:, 0] - u[:, 1]
    times = []
    for x in difference.T:
        i = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
        times.append((i + 1 - x[i] / (x[i + 1] - x[i])) * TIMESTEP_S * 1e3)
    return times


def assert_ordered_cycles(times, n_cycles):
    """From the first onset of segment 1 on, segments contract 1, 2, .. N, 1, .. one at a time."""
    events = sorted((t, segment) for segment, ts in enumerate(times) for t in ts)
    order = [segment for _, segment in events]
    order = order[order.index(0) :]
    assert order == [i % len(times) for i in range(len(order))]
    assert len(order) >= n_cycles * len(times)


@pytest.mark.parametrize(
    ("n", "tau_ms", "gain", "scheme", "period_ms"),
    [
        (3, 300, 1.3, "euler", 2625),
        (6, 300, 1.3, "euler", 5250),
        (3, 200, 1.9, "euler", 1867),
        (6, 200, 1.9, "euler", 3734),
        (3, 100, 3.6, "euler", 1124),
        (6, 100, 3.6, "euler", 2248),
        (3, 300, 1.3, "toolbox", 2631),
        (6, 300, 1.3, "toolbox", 5262),
    ],
)
def test_published_periods(n, tau_ms, gain, scheme, period_ms):
    times = contraction_times_ms(n, tau_ms, gain, 4.2e-3 * period_ms, scheme)
    assert_ordered_cycles(times, 3)
    last_periods = [np.diff(ts)[-1] for ts in times]
    assert last_periods == pytest.approx([period_ms] * n, abs=3.0)


@pytest.mark.parametrize("n", [4, pytest.param(12, marks=pytest.mark.slow)])
def test_other_numbers_of_segments_are_ordered_at_875_ms_a_segment(n):
    times = contraction_times_ms(n, 300, 1.3, 3.2 * n * 0.875)
    assert_ordered_cycles(times, 2)
    onsets = np.sort(np.concatenate(times))[-n:]
    assert np.diff(onsets) == pytest.approx([875.0] * (n - 1), abs=3.0)

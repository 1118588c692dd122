"""The half-centre under a drive: frequency over the documented range, and its limit of slow motion."""

from __future__ import annotations

import numpy as np
import pytest

from annelid.nervous import (
    Network,
    PeristalsisParameters,
    adaptive_peristalsis_network,
    add_half_centre,
    drive_conductance_uS,
    peristalsis_network,
)
from annelid.nervous.peristalsis import add_drive

PAPER = PeristalsisParameters()


def periods_ms(parameters: PeristalsisParameters, drives: np.ndarray, timestep_ms: float, seconds: float):
    """Mean and spread of the period of free half-centres side by side, each at its drive, ms."""
    network = Network()
    add_half_centre(network, "first", "second", parameters)
    add_drive(network, parameters, ("first", "second"), drive_conductance_uS(parameters), 5.0)
    stepper = network.compile(timestep_ms, "heun", len(drives))
    current = drives[:, np.newaxis] * parameters.leak_conductance_uS * parameters.range_mV
    trace = stepper.run(np.broadcast_to(current, (round(1e3 * seconds / timestep_ms), *current.shape)))
    difference = trace[..., 0] - trace[..., 1]
    mean, spread = [], []
    for u in difference.T:
        before = np.flatnonzero((u[1:] > 0) & (u[:-1] <= 0))
        rises = before - u[before] / (u[before + 1] - u[before])
        intervals = np.diff(rises)[1:] * timestep_ms
        assert intervals.size > 1
        mean.append(intervals.mean())
        spread.append(intervals.std())
    return np.array(mean), np.array(spread)


def test_frequency_rises_over_the_whole_documented_range_at_least_2_5_fold() -> None:
    mean, spread = periods_ms(PAPER, np.linspace(0.0, 1.0, 21), 1.0, 8.0)
    assert (np.diff(mean) < 0).all()
    assert (spread < 1e-3 * mean).all()
    assert mean[0] / mean[-1] >= 2.5
    # As the module's docstring states.
    assert 1e3 / mean[[0, -1]] == pytest.approx([0.62, 1.86], abs=0.01)


def test_drive_1_takes_over_its_share_of_the_current_at_the_threshold() -> None:
    g, d = PAPER.conductances, drive_conductance_uS()
    channel = PAPER.sodium_channel
    sodium = channel.conductance_uS * float(channel.instant_gates[0].steady(0.0)) * channel.reversal_mV

    def gate_at_zero(drive_uS: float) -> float:
        inhibition = g.half_centre * PAPER.inhibitory_reversal_mV
        return -(inhibition + drive_uS * PAPER.excitatory_reversal_mV) / sodium

    assert gate_at_zero(d) == pytest.approx(0.7 * gate_at_zero(0.0), rel=1e-12)


def test_without_drive_the_network_is_the_peristalsis_network() -> None:
    rng = np.random.default_rng(0)
    inputs = np.repeat(rng.uniform(0, 20, (40, 4)), 25, axis=0)
    plain = peristalsis_network(3).compile(1.0).run(inputs)
    driven = adaptive_peristalsis_network(3).compile(1.0).run(np.c_[inputs, np.zeros(len(inputs))])
    np.testing.assert_allclose(driven[:, 0, :-1], plain[:, 0], rtol=1e-12, atol=1e-12)
    assert not driven[:, 0, -1].any()


def test_the_descending_neuron_is_a_leaky_integrator_of_its_input() -> None:
    stepper = adaptive_peristalsis_network(3, drive_time_constant_ms=50.0).compile(0.1)
    inputs = np.zeros((1000, 5))
    inputs[:, -1] = 12.0
    potential = stepper.run(inputs)[:, 0, -1]
    time = np.arange(1001) * 0.1
    np.testing.assert_allclose(potential, 12.0 * (1 - np.exp(-time / 50.0)), atol=0.02)

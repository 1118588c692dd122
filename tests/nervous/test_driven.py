"""The robust network under a descending drive: its turns in closed form, and order whatever presses on the worm."""

from __future__ import annotations

from itertools import pairwise
from math import exp, log
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from annelid.errors import ConfigError
from annelid.nervous.robust import (
    DISCHARGE,
    ROLES,
    RobustParameters,
    driven_robust_network,
    robust_network,
    yield_mV,
)

FULL_nA = 20.0
SAMPLE_MS = 5
FLIP_MS = 25.0
"""The half-centre flips within this time once its hold yields."""


def driven_turn_ms(
    drive: float, n_segments: int, parameters: RobustParameters | None = None, lift: float = 0.45
) -> float:
    """Time from one segment's contraction to the next one's under a constant drive, by the relays alone.

    A relay that is charged (conductance g) tends to ``U_end = (g + a g_d) E_ex / (Gm + g + a g_d)`` from where it
    starts, U_0, and has counted a turn at the U* of `annelid.nervous.robust`:

        T = C / (Gm + g + a g_d) ln((U_end - U_0) / (U_end - U*)).

    Where it starts is where the next contraction's discharge, which lasts a turn, has left it, and what it has
    recovered towards its lifted rest in the N - 2 turns since. So T is a fixed point. What the half-centre takes to
    flip comes on top.
    """
    p = RobustParameters() if parameters is None else parameters
    extra = drive * p.transmission(lift).conductance_uS
    leak, charge, excitatory, threshold = p.leak_conductance_uS, p.charge_uS, p.excitatory_reversal_mV, yield_mV(p)
    undriven_ms = log(p.range_mV / (p.range_mV - threshold))
    capacitance = p.turn_ms / undriven_ms * (leak + charge)
    rest = extra * excitatory / (leak + extra)
    emptying = leak + extra + DISCHARGE * (leak + charge)
    empty = extra * excitatory / emptying
    end = (charge + extra) * excitatory / (leak + charge + extra)
    turn = p.turn_ms
    for _ in range(100):
        emptied = empty + (threshold - empty) * exp(-turn * emptying / capacitance)
        start = rest - (rest - emptied) * exp(-(n_segments - 2) * turn * (leak + extra) / capacitance)
        turn = capacitance / (leak + charge + extra) * log((end - start) / (end - threshold))
    return turn


def contractions(n_segments: int, blocks: np.ndarray, block_ms: int, parameters: RobustParameters) -> np.ndarray:
    """Contraction neurons' potentials, mV, every `SAMPLE_MS`, under a drive and pressures that change now and then.

    Args:
        n_segments: Segments.
        blocks: Activities of the drive and of every segment's pressure, ``(n_blocks, 1 + n_segments)``.
        block_ms: Duration of each, a multiple of `SAMPLE_MS`.
        parameters: Of the network.
    """
    stepper = driven_robust_network(n_segments, parameters).compile(1.0, "euler")
    state, trace = stepper.initial_state(), []
    for block in blocks:
        inputs = FULL_nA * np.concatenate([np.zeros(n_segments), block])
        for _ in range(block_ms // SAMPLE_MS):
            stepper.advance(state, inputs, SAMPLE_MS)
            trace.append(state.potential[0, : n_segments * len(ROLES) : len(ROLES)].copy())
    return np.array(trace)


def onsets(trace: np.ndarray) -> list[tuple[int, int]]:
    return [(SAMPLE_MS * int(k), int(segment)) for k, segment in np.argwhere((trace[:-1] < 10.0) & (trace[1:] >= 10.0))]


@pytest.mark.parametrize(("n_segments", "turn_ms", "drive"), [(3, 875.0, 0.5), (6, 400.0, 0.0), (6, 400.0, 1.0)])
def test_turns_are_the_closed_form_s_plus_the_flip(n_segments: int, turn_ms: float, drive: float) -> None:
    parameters = RobustParameters(turn_ms=turn_ms)
    expected = driven_turn_ms(drive, n_segments, parameters)
    block = np.array([[drive, *np.zeros(n_segments)]])
    events = onsets(contractions(n_segments, block, round(2.5 * n_segments * turn_ms), parameters))
    assert all(after == (before + 1) % n_segments for (_, before), (_, after) in pairwise(events))
    # The drive has come on, and relays have forgotten how they started.
    late = [time for time, _ in events][n_segments:]
    assert len(late) > n_segments // 2
    assert 0.0 <= np.diff(late).mean() - expected <= FLIP_MS


@settings(max_examples=15)
@given(arrays(float, (8, 5), elements=st.floats(0.0, 1.0)))
def test_whatever_presses_one_segment_at_a_time_contracts_in_order_and_no_slower(blocks: np.ndarray) -> None:
    n, parameters = 4, RobustParameters(turn_ms=300.0)
    trace = contractions(n, blocks, 400, parameters)
    events = onsets(trace)
    assert all(after == (before + 1) % n for (_, before), (_, after) in pairwise(events))
    contracted = (trace > 10.0).sum(axis=1)
    assert contracted.max() <= 2
    assert SAMPLE_MS * (contracted == 2).sum() <= FLIP_MS * len(events)
    intervals = np.diff([time for time, _ in events])
    assert intervals.max() <= driven_turn_ms(0.0, n, parameters) + FLIP_MS
    assert intervals.min() >= 0.8 * driven_turn_ms(1.0, n, parameters)


def test_without_pressure_it_is_the_robust_network() -> None:
    n, parameters = 3, RobustParameters(turn_ms=300.0)
    driven = contractions(n, np.zeros((1, 1 + n)), 2000, parameters)
    plain = robust_network(n, parameters).compile(1.0, "euler")
    state = plain.initial_state()
    for expected in driven:
        plain.advance(state, np.zeros(n), SAMPLE_MS)
        assert state.potential[0, : n * len(ROLES) : len(ROLES)] == pytest.approx(expected, abs=1e-9)


def test_bad_pathways_are_refused(subtests: pytest.Subtests) -> None:
    cases: tuple[tuple[dict[str, Any], str], ...] = (
        ({"lift": 0.5}, "lift must be between 0 and 0.5"),
        ({"lift": 0.0}, "lift must be between 0 and 0.5"),
        ({"per_segment": -0.1}, "must not be negative"),
        ({"drive_ms": 0.0}, "must be positive"),
    )
    for changes, says in cases:
        with subtests.test(f"{changes!r:.60}"), pytest.raises(ConfigError, match=says):
            driven_robust_network(3, **changes)

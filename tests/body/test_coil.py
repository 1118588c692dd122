"""Coils of shape-memory wire: closed forms of their heat, their transformation and their force."""

from __future__ import annotations

from math import cos, e, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from annelid import simulate
from annelid.analysis import summary
from annelid.body.actuators.coil import CoilRings
from annelid.config import load_config
from annelid.errors import ConfigError
from annelid.plausibility import check
from annelid.simulation.worm import WormPlant

RINGS = CoilRings()
COILS = {"body.rings.kind": "coil", "clock.control_timestep_s": 0.005, "clock.physics_timestep_s": 0.005}


def after(
    state: tuple[float, float], activation: float, time_s: float, rings: CoilRings = RINGS
) -> tuple[float, float]:
    """Temperature and share of austenite after a command."""
    model: Any = None
    command = np.array([[activation]])
    warm, share = rings.states_after(model, command, np.array(state), np.zeros(1), time_s)
    return float(warm), float(share)


def brought_to(state: tuple[float, float], warm_C: float, n_steps: int) -> list[tuple[float, float]]:
    """States of a coil that is brought to a temperature in equal steps, by as much heat as each needs."""
    states, time_s = [state], 1e-3
    for aim in np.linspace(state[0], warm_C, n_steps + 1)[1:]:
        left = np.exp(-time_s / RINGS.cooling_time_s)
        steady = (aim - left * states[-1][0]) / (1.0 - left)
        states.append(after(states[-1], (steady - RINGS.air_C) / RINGS.warming_K, time_s))
    return states


@pytest.mark.parametrize("n_steps", [1, 500])
def test_a_coil_becomes_as_warm_and_cools_as_fast_as_its_balance_of_heat_says(n_steps: int) -> None:
    """By a metre of wire: its resistance, its surface and its heat."""
    area, surface = pi * RINGS.wire_diameter_m**2 / 4, pi * RINGS.wire_diameter_m
    loss_W_per_K = RINGS.heat_transfer_W_per_m2K * surface
    steady_K = 0.6 * RINGS.current_A**2 * RINGS.resistivity_Ohm_m / area / loss_W_per_K
    cooling_s = RINGS.density_kg_per_m3 * area * RINGS.specific_heat_J_per_kgK / loss_W_per_K
    state = (RINGS.air_C, 0.0)
    for _ in range(n_steps):
        state = after(state, 0.6, 20.0 * cooling_s / n_steps)
    assert state[0] - RINGS.air_C == pytest.approx(steady_K, rel=1e-6)
    for _ in range(n_steps):
        state = after(state, 0.0, cooling_s / n_steps)
    assert state[0] - RINGS.air_C == pytest.approx(steady_K / e, rel=1e-6)


@pytest.mark.parametrize("n_steps", [7, 200])
def test_austenite_goes_round_its_loop_in_steps_of_any_length(n_steps: int) -> None:
    (a_start, a_finish), (m_start, m_finish) = RINGS.austenite_C, RINGS.martensite_C
    heated = brought_to((20.0, 0.0), 95.0, n_steps)
    cooled = brought_to(heated[-1], 21.0, n_steps)
    for warm, share in heated:
        done = np.clip((warm - a_start) / (a_finish - a_start), 0.0, 1.0)
        assert share == pytest.approx(0.5 - 0.5 * cos(pi * done), abs=1e-9)
    for warm, share in cooled:
        done = np.clip((m_start - warm) / (m_start - m_finish), 0.0, 1.0)
        assert share == pytest.approx(0.5 + 0.5 * cos(pi * done), abs=1e-9)


def test_a_coil_that_turns_back_halfway_keeps_its_share_until_it_is_cool() -> None:
    half = brought_to((20.0, 0.0), 75.0, 50)[-1]
    assert half[1] == pytest.approx(0.5)
    assert brought_to(half, 41.0, 50)[-1][1] == pytest.approx(0.5)
    assert brought_to(half, 35.0, 50)[-1][1] == pytest.approx(0.25)
    again = brought_to(brought_to(half, 35.0, 50)[-1], 75.0, 50)[-1]
    assert again[1] == pytest.approx(1.0 - 0.75 * 0.5)


@pytest.mark.parametrize(("state", "modulus"), [((21.0, 0.0), 0), ((90.0, 1.0), 1)])
def test_at_one_phase_a_ring_is_pulled_by_a_linear_spring(state: tuple[float, float], modulus: int) -> None:
    """G d^4 / (8 D^3 n) of a coil of n turns, in a worm whose ring shortens from rest."""
    plant = WormPlant(load_config("riddle2023-rods", COILS | {"body.rings.coils": 2}))
    turns = 0.566 / RINGS.wire_diameter_m
    coil_m = RINGS.spring_index * RINGS.wire_diameter_m
    rate = RINGS.shear_moduli_Pa[modulus] * RINGS.wire_diameter_m**4 / (8 * coil_m**3 * turns)
    lengths = []
    for _ in range(20):
        plant.act[:] = np.tile(state, 3)
        felt = plant.step(np.zeros(3))
        assert felt.muscle_force_N == pytest.approx(2 * rate * (felt.ring_length_m - 0.566), rel=0.01)
        lengths.append(felt.ring_length_m)
    assert np.ptp(lengths) > 0.01


@pytest.mark.slow
def test_a_worm_with_coils_crawls(tmp_path: Path) -> None:
    numbers = summary(simulate(load_config("meshworm", {"duration_s": 14.0}), tmp_path, progress=False))
    assert numbers.order[:10] == [1, 2, 3, 4, 5] * 2
    assert numbers.speed_m_per_s is not None
    assert numbers.speed_m_per_s > 1e-3


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"current_A": 0.5}, "body.rings.current_A"),
        ({"coils": 20}, "cold coils pull a ring at rest"),
        ({"length_range_m": [1.1, 1.5]}, "pulls 0 N"),
        ({"length_range_m": [0.4, 0.8]}, "longer than its coil is meant for"),
    ],
)
def test_coils_that_cannot_work_are_found_before_they_run(changes: dict[str, Any], words: str) -> None:
    config = load_config("riddle2023-rods", {"body.rings": {"kind": "coil"} | changes})
    assert any(words in str(finding) for finding in check(config))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"air_C": 35.0}, "would never be soft again"),
        ({"austenite_C": [70.0, 60.0]}, "no loop"),
        ({"martensite_C": [90.0, 30.0]}, "no loop"),
        ({"shear_moduli_Pa": [3e10, 1e10]}, "martensite comes first"),
    ],
)
def test_coils_that_mean_nothing_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_config("riddle2023-rods", {"body.rings": {"kind": "coil"} | changes})

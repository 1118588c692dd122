"""What goes beyond the engine's rods: separate pins of a given stiffness."""

from __future__ import annotations

from math import exp

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.body.constraint_rows import Ties, add_tie, tendons_to_rows
from annelid.body.formulations import Tie
from annelid.body.formulations.rods.net import add_vertex
from annelid.config import load_config
from annelid.simulation.worm import WormPlant


def tied_points(timestep_s: float, stiffness: float, damping: float) -> mujoco.MjModel:
    """Two point masses on a tie."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.option.timestep = timestep_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    for name in ("a", "b"):
        add_vertex(spec, name, np.zeros(3), 0.001)
    tie = Tie(stiffness, damping)
    add_tie(spec, "b", "a", tie)
    tendons_to_rows(spec)
    model = spec.compile()
    Ties(model, tie)
    return model


def gap_under(model: mujoco.MjModel, force_N: float, duration_s: float) -> float:
    data = mujoco.MjData(model)
    data.xfrc_applied[1, 0], data.xfrc_applied[2, 0] = force_N, -force_N
    mujoco.mj_step(model, data, round(duration_s / model.opt.timestep))
    return float(data.qpos[0] - data.qpos[3])


@settings(max_examples=15)
@given(stiffness=st.floats(5, 500), force_N=st.floats(0.01, 2), timestep_s=st.sampled_from([0.001, 0.01, 0.04]))
def test_a_tie_gives_by_force_over_stiffness(stiffness: float, force_N: float, timestep_s: float) -> None:
    model = tied_points(timestep_s, stiffness, 0.04 * stiffness)
    assert gap_under(model, force_N, 1.0) == pytest.approx(force_N / stiffness, rel=1e-3)


def test_a_tie_creeps_at_damping_over_stiffness() -> None:
    stiffness, damping = 20.0, 2.0
    model = tied_points(0.0005, stiffness, damping)
    expected = 1 - exp(-0.1 * stiffness / damping)
    assert gap_under(model, 1.0, 0.1) * stiffness == pytest.approx(expected, rel=0.02)


def test_separate_pins_part_and_are_watched() -> None:
    plant = WormPlant(load_config("riddle2023-fast", {"duration_s": 0.2}))
    plant.reset(0)
    for _ in range(200):
        plant.step(np.array([1.0, 0.0, 0.0]))
    gap = float(np.asarray(plant.read(False)["pin_gap"]))
    ends = plant.data.xpos[[plant.model.body("vertex_0_1").id, plant.model.body("crossing_0").id]]
    assert np.linalg.norm(ends[0] - ends[1]) <= gap
    assert 0.005 < gap < 0.06
    assert plant.total_mass_kg == pytest.approx(0.26, rel=0.05)

"""annelid's rods in a third-party bench of rods, against its closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cosseratbench import EndCondition, Material, Motion, Rod, Scenario, run
from cosseratbench.registry import load_experiment, load_solver

MATERIAL = Material(youngs_modulus=1e6, shear_modulus=1e6 / 3.0, density=1000.0)


def test_a_clamped_beam_bends_as_euler_and_bernoulli_have_it() -> None:
    # Steps of 20 ms: the beam comes to rest.
    found = run(load_experiment("cantilever"), load_solver("annelid", time_step_scale=4.0), n_elements=10)
    assert found.metrics["tip_deflection_error"] < 0.005
    assert found.metrics["settling_residual"] < 1e-4


@pytest.mark.slow
def test_a_twisted_rod_buckles_where_greenhill_has_it() -> None:
    found = run(load_experiment("twist"), load_solver("annelid"), n_elements=25)
    assert found.metrics["critical_twist_error"] < 0.01


def test_a_turned_end_twists_a_rod_evenly() -> None:
    """Ten radians: the other end is held, and the rod stays straight."""
    motion = Motion((0.0, 2.0), ((0.0, 0.0, 0.0),) * 2, ((0.0, 0.0, 0.0), (10.0, 0.0, 0.0)))
    ends = {"start": EndCondition.CLAMPED, "end": EndCondition.CLAMPED, "end_motion": motion}
    rod = Rod(((0.0, 0.0, 0.0), (0.5, 0.0, 0.0)), 0.02, MATERIAL, **ends)
    scenario = Scenario((rod,), duration=4.0, quasi_static=True, self_contact=False)
    found = load_solver("annelid").run(scenario, n_elements=20, n_frames=5)
    _, y, z = found.directors[0][-1].T
    angle = np.unwrap(np.arctan2(-y, z))
    assert angle == pytest.approx(10.0 * (np.arange(20) + 0.5) / 20, abs=0.01)
    assert found.positions[0][-1] == pytest.approx(rod.nodes(20), abs=1e-6)


def test_what_these_rods_have_not_is_unsupported() -> None:
    assert run(load_experiment("crossing"), load_solver("annelid")).outcome == "unsupported"
    across = Motion((0.0, 1.0), ((0.0, 0.0, 0.0),) * 2, ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    rod = Rod(((0.0, 0.0, 0.0), (0.5, 0.0, 0.0)), 0.02, MATERIAL, start=EndCondition.CLAMPED, start_motion=across)
    with pytest.raises(NotImplementedError, match="turns across the rod"):
        load_solver("annelid").run(Scenario((rod,), duration=1.0), n_elements=4, n_frames=2)
    free = replace(rod, start=EndCondition.FREE, start_motion=None)
    with pytest.raises(NotImplementedError, match="held differently"):
        load_solver("annelid").run(Scenario((rod, free), duration=1.0), n_elements=4, n_frames=2)

"""Rods are damped alike in every direction of bending, by the material's time, whatever the mesh and the step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from annelid.body import build_spec
from annelid.config import load_config
from annelid.simulation.worm import WormPlant
from rods import rods_of

TIME_S = 0.145
SMALL = {"body.mesh.elements_per_end": 1, "body.mesh.elements_per_side": 1}


def pulled(changes: dict[str, Any], time_s: float) -> WormPlant:
    config = load_config("riddle2023-rods", {"body.strands.damping_time_s": TIME_S, **SMALL, **changes})
    plant = WormPlant(config)
    plant.model.opt.tolerance = 1e-10
    plant.reset(0)
    plant.move(np.array([0.0, 0.5, 0.0]), round(time_s / config.clock.physics_timestep_s))
    return plant


@pytest.mark.parametrize(("elements", "step_s"), [(1, 0.02), (1, 0.001), (3, 0.01)])
def test_a_row_s_force_is_stiffness_times_strain_and_damping_times_rate(elements: int, step_s: float) -> None:
    """At the end of the step, to the order of the step, though the engine scales its rows with step and posture."""
    changes = {"body.mesh.elements_per_side": elements, "clock.physics_timestep_s": step_s}
    plant = pulled(changes, 40 * step_s)
    strains, two_step = rods_of(plant).strains, rods_of(plant).two_step
    forces, rates = two_step.rows()
    strain = strains.renew(plant.qpos)
    wanted = -(strains._stiffness * strain).ravel() - strains._damping.ravel() * rates
    assert np.linalg.norm(forces - wanted) < 0.02 * np.linalg.norm(wanted)


def test_what_the_material_takes_is_damping_not_constraints() -> None:
    """Weightless and away from the ground, only the edges' constraints are left to take something."""
    afloat = {"arena.gravity_m_per_s2": 0.0, "arena.floor_gap_m": 1.0, "clock.physics_timestep_s": 0.001}
    plant = pulled(afloat, 0.1)
    assert float(plant.energies.damping_loss) > 50 * abs(float(plant.energies.constraint_loss))


def test_rows_follow_the_posture_alone() -> None:
    plant = pulled({}, 0.2)
    coefficients = plant.model.wrap_prm.copy()
    rods_of(plant).strains.renew(plant.qpos)
    assert np.abs(plant.model.wrap_prm - coefficients).max() > 0
    elsewhere = pulled({}, 0.1)
    elsewhere.set_state(plant.get_state())
    rods_of(elsewhere).strains.renew(elsewhere.qpos)
    assert np.array_equal(plant.model.wrap_prm, elsewhere.model.wrap_prm)


def momenta(elements: int, step_s: float, time_s: float) -> tuple[float, float]:
    """Largest momentum, kg m/s, and angular momentum over the sum of its parts, of a worm in free flight.

    Its half-rings are pulled in turn, which sets its parts in motion against one another and the whole not at all.
    """
    flight = {"arena.gravity_m_per_s2": 0.0, "arena.floor_gap_m": 100.0, "body.rings.layout": "halves"}
    mesh = {"body.mesh.elements_per_side": elements, "clock.physics_timestep_s": step_s}
    plant = WormPlant(load_config("riddle2023-rods", {**flight, **mesh}))
    plant.model.opt.tolerance = 1e-10
    plant.reset(0)
    model, data = plant.model, plant.data
    slides = np.array([body for body in range(model.nbody) if model.body_dofnum[body] == 3])
    dofs = model.body_dofadr[slides][:, None] + np.arange(3)
    mass = model.body_mass[slides][:, None]
    most, turning, parts = 0.0, 0.0, 0.0
    for step in range(round(time_s / step_s)):
        pulled_now = int(4 * step * step_s / time_s)
        plant.move(0.3 * (np.arange(plant.n_muscles) == pulled_now), 1)
        places = data.xpos[slides] - (mass * data.xpos[slides]).sum(axis=0) / mass.sum()
        impulses = mass * data.qvel[dofs]
        most = max(most, float(np.abs(impulses.sum(axis=0)).max()))
        moments = np.cross(places, impulses)
        turning = max(turning, float(np.linalg.norm(moments.sum(axis=0))))
        parts = max(parts, float(np.linalg.norm(moments, axis=1).sum()))
    return most, turning / parts


def test_a_worm_in_free_flight_moves_nothing_but_its_parts() -> None:
    coarse, fine = momenta(1, 0.01, 0.4), momenta(1, 0.002, 0.4)
    assert max(coarse[0], fine[0]) < 1e-12
    assert fine[1] < 0.5 * coarse[1]


def test_a_model_that_moves_by_itself_has_as_many_coordinates_and_no_rows() -> None:
    config = load_config("riddle2023-rods", SMALL)
    plain, plant = build_spec(config).compile(), WormPlant(config).model
    assert plain.nq == plant.nq
    assert not any(plain.tendon(index).name.startswith("row_") for index in range(plain.ntendon))

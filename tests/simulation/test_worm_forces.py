"""What the 3D worm reports of forces, strains and energy, against mechanics worked out from its positions."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.config import load_config
from annelid.simulation.worm import WormPlant

CHAIN = {
    "body.formulation.kind": "chain",
}
PULL = np.array([1.0, 0.0, 0.3])
STEP_S = 0.002


def worm(**changes: Any) -> WormPlant:
    clock = {"control_timestep_s": STEP_S, "physics_timestep_s": STEP_S}
    plant = WormPlant(load_config({"clock": clock, "record": {"signals_interval_s": STEP_S}}, changes))
    plant.reset(0)
    return plant


def after(plant: WormPlant, seconds: float, activation: np.ndarray = PULL) -> WormPlant:
    for _ in range(round(seconds / STEP_S)):
        plant.step(activation)
    return plant


def momentum(plant: WormPlant) -> np.ndarray:
    mujoco.mj_kinematics(plant.model, plant.data)
    mujoco.mj_comPos(plant.model, plant.data)
    mujoco.mj_comVel(plant.model, plant.data)
    mujoco.mj_subtreeVel(plant.model, plant.data)
    return plant.data.subtree_linvel[0] * plant.model.body_mass.sum()


def test_the_floor_s_force_and_the_weight_change_the_momentum() -> None:
    """Newton's second law for the whole worm, its rate as the second-order step has it: all other forces are inner."""
    plant = after(worm(**{"arena.friction": 0.5}), 0.05)
    weight = np.array([0.0, 0.0, -9.81 * plant.total_mass_kg])
    before, checked = momentum(plant), 0
    plant.step(PULL)
    now = momentum(plant)
    for _ in range(40):
        contact = plant.step(PULL).contact_force_N.sum(axis=0)
        earlier, before, now = before, now, momentum(plant)
        change = (3.0 * now - 4.0 * before + earlier) / (2.0 * STEP_S)
        if np.linalg.norm(contact[:2]) > 0.05:
            assert change == pytest.approx(contact + weight, abs=0.02 * float(np.linalg.norm(contact)) + 0.01)
            checked += 1
    assert checked > 5, "friction must really act"


def test_a_load_on_one_segment_is_carried_under_that_segment() -> None:
    plant = after(worm(**{"body.strands.damping_time_s": 0.16}), 0.3, np.zeros(3))
    at_rest = plant.get_state()
    unloaded = plant.step(np.zeros(3)).contact_force_N[:, 2]
    for segment in range(3):
        plant.set_state(at_rest)
        plant.data.xfrc_applied[:] = 0.0
        for crossing in plant.geometry.rings[segment]:
            plant.data.xfrc_applied[plant.model.body(f"crossing_{crossing}").id, 2] = -0.1
        loaded = after(plant, 0.3, np.zeros(3)).step(np.zeros(3)).contact_force_N[:, 2]
        assert np.argmax(loaded - unloaded) == segment
        assert (loaded - unloaded).sum() == pytest.approx(0.6, rel=0.15)


def test_the_pin_gap_is_the_distance_between_the_two_strands() -> None:
    plant = after(worm(**CHAIN), 0.1)
    mujoco.mj_kinematics(plant.model, plant.data)
    model, data = plant.model, plant.data

    def anchor(equation: int) -> np.ndarray:
        strand = model.eq_obj2id[equation]
        return data.xpos[strand] + data.xmat[strand].reshape(3, 3) @ model.eq_data[equation, 3:6]

    gaps = [np.linalg.norm(anchor(e) - anchor(e + 1)) for e in range(0, model.neq, 2)]
    assert plant.read(False)["pin_gap"] == pytest.approx(max(gaps), rel=1e-6)
    assert max(gaps) > 1e-4


def test_the_edge_strain_is_the_largest_relative_change_of_an_edge() -> None:
    plant = after(worm(), 0.1)
    mujoco.mj_kinematics(plant.model, plant.data)
    mujoco.mj_comPos(plant.model, plant.data)
    mujoco.mj_flex(plant.model, plant.data)
    vertices = plant.data.flexvert_xpos.reshape(12, -1, 3)
    lengths = np.linalg.norm(np.diff(vertices, axis=1), axis=2)
    rest = np.linalg.norm(np.diff(plant.geometry.vertices_m, axis=1), axis=2)
    expected = np.abs(lengths / rest - 1).max()
    assert plant.read(False)["edge_strain"] == pytest.approx(expected, rel=1e-6)
    assert expected > 1e-5


def test_rest_lengths_of_the_sensors_do_not_depend_on_the_kind_of_spring() -> None:
    slack = worm(**{"body.springs.tension_only": True})
    felt = slack.reset(0)
    assert felt.rest_stretch_m == pytest.approx(slack.geometry.spring_length_m[slack.geometry.sensor_springs])
    assert felt.stretch_m == pytest.approx(felt.rest_stretch_m)


def test_the_kinetic_energy_of_rods_is_that_of_their_vertices() -> None:
    plant = after(worm(), 0.05)
    slides = plant.model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
    dofs = plant.model.jnt_dofadr[slides]
    mass = plant.model.body_mass[plant.model.jnt_bodyid[slides]]
    expected = 0.5 * float(mass @ plant.data.qvel[dofs] ** 2)
    assert plant.read(False)["kinetic_energy"] == pytest.approx(expected, rel=1e-3)
    assert expected > 1e-4

"""The elastic energy: closed forms, and the engine's own forces are its slope."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.body.formulations.rods.net import curvature_weights
from annelid.config import load_config
from annelid.simulation.worm import WormPlant

CHAIN = {"body.formulation.kind": "chain", "body.formulation.integrator": "Euler", "body.formulation.pins": "direct"}
DIFFER = {
    "body.mesh.radius_m": [0.16, 0.14, 0.12],
    "body.rings.length_range_m": [[0.566, 1.067], [0.495, 0.934], [0.425, 0.8]],
    "body.strands.young_modulus_Pa": [3e8, 6e8, 2e8],
    "body.strands.shear_modulus_Pa": [2e8, 3e8, 2e8],
    "body.strands.relative_stiffness": [1.0, 2.0, 0.5] * 4,
    "body.springs.stiffness_N_per_m": [20.0, 40.0, 10.0],
    "body.springs.rest_length_m": [0.06, 0.07, 0.08],
}
"""Segments, and strands, that differ in all that is elastic."""
BODIES: dict[str, dict[str, Any]] = {
    "rods": {},
    "short springs": {"body.springs.tension_only": True, "body.springs.rest_length_m": 0.1},
    "chain of balls": CHAIN,
    "chain of hinges": {**CHAIN, "body.formulation.joint": "hinges"},
    "rods that differ": {**DIFFER, "body.strands.damping_time_s": 0.1},
    "chain that differs": {**CHAIN, **DIFFER, "body.formulation.joint": "hinges"},
}


def worm(**changes: Any) -> WormPlant:
    clock = {"control_timestep_s": 0.002, "physics_timestep_s": 0.002}
    plant = WormPlant(load_config({"clock": clock, "record": {"signals_interval_s": 0.002}}, changes))
    plant.reset(0)
    return plant


@pytest.mark.parametrize("body", BODIES)
def test_the_engine_s_springs_are_the_slope_of_the_energy(body: str) -> None:
    """Along random displacements of a contracted worm, strands bent and twisted."""
    plant = worm(**BODIES[body])
    for _ in range(60):
        plant.step(np.array([1.0, 0.0, 0.3]))
    model, plastic = plant.model, plant.plastic.copy()
    data = mujoco.MjData(model)
    data.qpos[:], data.plastic[:] = plant.qpos, plastic
    mujoco.mj_forward(model, data)
    force, start = data.qfrc_spring.copy(), data.qpos.copy()
    springs = [model.tendon(f"spring_{i}").id for i in range(len(plant.geometry.springs))]

    def energy(direction: np.ndarray, far: float) -> float:
        qpos = start.copy()
        mujoco.mj_integratePos(model, qpos, direction, far)
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(model, data)
        return plant.anatomy.elasticity.energy_J(qpos, plastic, data.ten_length[springs])

    assert np.abs(force).max() > 0.01
    generator = np.random.default_rng(1)
    twists = model.jnt_type[model.dof_jntid] == int(mujoco.mjtJoint.mjJNT_HINGE)
    for chosen in (twists, ~twists, np.ones(model.nv, dtype=bool)):
        for _ in range(2 if chosen.any() else 0):
            direction = np.where(chosen, generator.normal(size=model.nv), 0.0)
            slope = (energy(direction, 1e-6) - energy(direction, -1e-6)) / 2e-6
            scale = float(np.linalg.norm(force[chosen]) * np.linalg.norm(direction))
            assert -slope == pytest.approx(force @ direction, abs=1e-6 * scale)


def test_a_worm_at_rest_holds_nothing_and_its_springs_what_they_are_stretched_by() -> None:
    plant = worm(**{"body.springs.stiffness_N_per_m": 20.0})
    lengths = plant.geometry.spring_length_m
    energy = plant.anatomy.elasticity.energy_J
    assert energy(plant.qpos, plant.plastic, lengths) == pytest.approx(0.0, abs=1e-15)
    stretched = energy(plant.qpos, plant.plastic, lengths + 0.01)
    assert stretched == pytest.approx(0.5 * 20.0 * 0.01**2 * len(lengths), rel=1e-9)
    assert energy(plant.qpos, plant.plastic, lengths - 0.01) == pytest.approx(stretched, rel=1e-9)


def test_springs_that_only_pull_hold_nothing_when_short() -> None:
    plant = worm(**{"body.springs.tension_only": True})
    lengths = plant.geometry.spring_length_m
    assert plant.anatomy.elasticity.energy_J(plant.qpos, plant.plastic, lengths - 0.01) < 1e-15


def test_one_edge_turned_about_itself_twists_its_neighbours_and_bends_against_its_curvature() -> None:
    """Both its vertices are twisted by the angle, and one of the two frames at each sees a turned rest curve."""
    plant = worm()
    body = plant.anatomy.model
    strands = load_config({}).body.strands  # type: ignore[union-attr]
    length = float(body.flexedge_length0[5])
    assert body.flexedge_length0[4:7] == pytest.approx(length, rel=1e-6)
    vertices = plant.geometry.vertices_m[0, 4:8]
    tangents = np.diff(vertices, axis=0) / np.linalg.norm(np.diff(vertices, axis=0), axis=1, keepdims=True)
    half_angle = 0.5 * np.arccos(tangents[0] @ tangents[1])
    curvature = 2.0 * np.tan(half_angle)
    rigidity = np.pi * strands.radius_m**4 / (2.0 * length)
    bending = strands.one_number("young_modulus_Pa") * rigidity / 4
    torsion = strands.one_number("shear_modulus_Pa") * rigidity / 2
    angle = 0.7
    qpos = plant.qpos.copy()
    qpos[body.joint("strand_0_twist_5").qposadr[0]] = angle
    weights = curvature_weights(plant.geometry)[4:6]
    expected = weights.sum() * (torsion * angle**2 + bending * curvature**2 * (1.0 - np.cos(angle)))
    energy = plant.anatomy.elasticity.energy_J(qpos, plant.plastic, plant.geometry.spring_length_m)
    assert energy == pytest.approx(expected, rel=1e-6)

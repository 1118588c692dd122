"""Every option of the body and the arena reaches the engine with the meaning that its description gives."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.body import build_spec
from annelid.config import load_config
from annelid.morphology import helical_mesh

Read = Callable[[mujoco.MjModel], Any]
CHAIN = {"body.formulation.kind": "chain"}
COARSE = {"body.mesh.elements_per_side": 1, "body.mesh.elements_per_end": 1}
"""For options that have nothing to do with the strands' elements: fewer of them compile faster."""


def compiled(changes: dict[str, Any]) -> mujoco.MjModel:
    return build_spec(load_config({"clock": {"physics_timestep_s": 0.005}}, changes)).compile()


def pins(model: mujoco.MjModel) -> list[int]:
    return [i for i in range(model.neq) if model.equality(i).name.startswith("pin_")]


def springs(model: mujoco.MjModel) -> list[int]:
    return [i for i in range(model.ntendon) if model.tendon(i).name.startswith("spring_")]


def touching(model: mujoco.MjModel) -> list[int]:
    return [i for i in range(model.ngeom) if model.geom_conaffinity[i] and model.geom(i).name != "floor"]


def elastic_joints(model: mujoco.MjModel) -> np.ndarray:
    return np.flatnonzero(model.jnt_stiffness[:, 0] if model.jnt_stiffness.ndim > 1 else model.jnt_stiffness)


def damping_over_stiffness(model: mujoco.MjModel) -> set[float]:
    joints = elastic_joints(model)
    stiffness = model.jnt_stiffness.reshape(model.njnt, -1)[joints, 0]
    damping = model.dof_damping.reshape(model.nv, -1)[model.jnt_dofadr[joints], 0]
    return set(np.round(damping / stiffness, 12))


Case = tuple[dict[str, Any], Read, Any]
BOTH: list[Case] = [
    ({"clock.physics_timestep_s": 0.004}, lambda m: m.opt.timestep, 0.004),
    ({"arena.gravity_m_per_s2": 1.62}, lambda m: m.opt.gravity.tolist(), [0, 0, -1.62]),
    ({"arena.friction": 0.37}, lambda m: set(m.geom_friction[[*touching(m), m.geom("floor").id], 0]), {0.37}),
    ({"arena.floor_gap_m": 0.02}, lambda m: m.geom("floor").pos[2], -0.02),
    ({"arena.contact_time_constant_s": 0.013}, lambda m: set(m.geom_solref[touching(m), 0]), {0.013}),
    (
        {"arena.contact_impedance": [0.8, 0.85, 0.002]},
        lambda m: m.geom_solimp[touching(m), :3].mean(axis=0).tolist(),
        [0.8, 0.85, 0.002],
    ),
    (
        {"body.springs.stiffness_N_per_m": 31.0},
        lambda m: set(m.tendon_stiffness[springs(m)].reshape(42, -1)[:, 0]),
        {31.0},
    ),
    ({"body.springs.rest_length_m": 0.065}, lambda m: set(m.tendon_lengthspring[springs(m)].ravel()), {0.065}),
    (
        {"body.springs.tension_only": True, "body.springs.rest_length_m": 0.065},
        lambda m: set(m.tendon_lengthspring[springs(m)].ravel()),
        {0.0, 0.065},
    ),
    ({"body.rings.peak_force_N": 31.0}, lambda m: set(m.actuator_gainprm[:, 2]), {31.0}),
    ({"body.rings.peak_force_N": [16.0, 31.0, 8.0]}, lambda m: m.actuator_gainprm[:, 2].tolist(), [16.0, 31.0, 8.0]),
    ({"body.rings.minimum_length": 0.61}, lambda m: set(m.actuator_gainprm[:, 4]), {0.61}),
    ({"body.rings.maximum_length": 1.7}, lambda m: set(m.actuator_gainprm[:, 5]), {1.7}),
    ({"body.rings.maximum_velocity": 2.5}, lambda m: set(m.actuator_gainprm[:, 6]), {2.5}),
    ({"body.rings.passive_peak": 0.4}, lambda m: set(m.actuator_gainprm[:, 7]), {0.4}),
    ({"body.rings.lengthening_peak": 1.9}, lambda m: set(m.actuator_gainprm[:, 8]), {1.9}),
    ({"body.rings.length_range_m": [0.5, 1.2]}, lambda m: m.actuator_lengthrange.tolist(), [[0.5, 1.2]] * 3),
    (
        {"body.rings.length_range_m": [[0.5, 1.0], [0.6, 1.1], [0.7, 1.2]]},
        lambda m: m.actuator_lengthrange.tolist(),
        [[0.5, 1.0], [0.6, 1.1], [0.7, 1.2]],
    ),
    ({"body.rings.activation_dynamics": False}, lambda m: m.na, 0),
    ({"body.rings.activation_dynamics": True}, lambda m: m.na, 3),
    ({"body.pins.radius_m": 0.007}, lambda m: m.geom("crossing_5").size[0], 0.007),
]
RODS: list[Case] = [
    (
        {},
        lambda m: (m.opt.integrator, m.opt.solver, m.opt.cone),
        (mujoco.mjtIntegrator.mjINT_DISCRETE, mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtCone.mjCONE_ELLIPTIC),
    ),
    ({"body.formulation.edge_time_constant_s": 0.003}, lambda m: set(m.eq_solref[:, 0]), {0.003}),
    ({"body.formulation.friction_impedance_ratio": 17.0}, lambda m: m.opt.impratio, 17.0),
    ({"body.strands.radius_m": 0.003}, lambda m: set(m.flex_radius) | set(m.geom_size[touching(m), 0]), {0.003}),
    ({"body.mesh.elements_per_side": 2}, lambda m: set(m.flex_elemnum), {14 * 2 + 2 * 2}),
    ({"body.mesh.elements_per_end": 1}, lambda m: set(m.flex_elemnum), {14 * 3 + 2}),
    ({"body.strands.damping_time_s": 0.2}, lambda m: set(m.flex_damping), {0.2}),
]
CHAINS: list[Case] = [
    (
        {},
        lambda m: (m.opt.integrator, m.opt.solver, m.opt.cone, m.opt.iterations),
        (mujoco.mjtIntegrator.mjINT_RK4, mujoco.mjtSolver.mjSOL_PGS, mujoco.mjtCone.mjCONE_PYRAMIDAL, 500),
    ),
    ({"body.formulation.armature_kg_m2": 0.02}, lambda m: set(m.dof_armature[m.dof_armature > 0]), {0.02}),
    ({"body.formulation.pin_time_constant_s": 0.009}, lambda m: set(m.eq_solref[pins(m), 0]), {0.009}),
    (
        {"body.formulation.pin_impedance": [0.7, 0.75, 0.003]},
        lambda m: m.eq_solimp[pins(m), :3].mean(axis=0).tolist(),
        [0.7, 0.75, 0.003],
    ),
    ({}, lambda m: (len(pins(m)), len(elastic_joints(m))), (180, 12 * 47 * 3)),
    (
        {"body.strands.damping_time_s": 0.2},
        damping_over_stiffness,
        {0.2},
    ),
]


def assert_read(changes: dict[str, Any], read: Read, expected: Any) -> None:
    actual = read(compiled(changes))
    if isinstance(expected, set):
        actual, expected = sorted(actual), sorted(expected)
    flat_actual, flat_expected = np.ravel(np.asarray(actual, float)), np.ravel(np.asarray(expected, float))
    assert flat_actual == pytest.approx(flat_expected, rel=1e-9)


@pytest.mark.parametrize(
    ("base", "cases"),
    [(COARSE, BOTH), (COARSE | CHAIN, BOTH), ({}, RODS), (CHAIN, CHAINS)],
    ids=["both as rods", "both as chain", "rods", "chain"],
)
def test_an_option_reaches_the_engine(base: dict[str, Any], cases: list[Case], subtests: pytest.Subtests) -> None:
    for changes, read, expected in cases:
        with subtests.test(**changes):
            assert_read({**base, **changes}, read, expected)


def test_the_chain_s_joints_resist_with_the_rod_s_stiffness_over_their_length() -> None:
    model = compiled(CHAIN)
    stiffness = model.jnt_stiffness.reshape(model.njnt, -1)[elastic_joints(model), 0]
    bending, torsion = 0.3e9 * pi * 0.002**4 / 4, 0.2e9 * pi * 0.002**4 / 2
    vertices = helical_mesh(3).vertices_m[0]
    element = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    joint = (element[1:] + element[:-1]) / 2
    expected = np.tile(np.concatenate([bending / joint, bending / joint, torsion / joint]), 12)
    assert np.sort(stiffness) == pytest.approx(np.sort(expected), rel=1e-9)


def test_every_vertex_of_a_rod_can_touch_the_floor_just_once() -> None:
    model = compiled({})
    flexes, touches = model.flex_vertbodyid, model.geom_bodyid[touching(model)]
    assert sorted(touches) == sorted(set(flexes))
    assert not model.flex_conaffinity.any()


def test_twist_hinges_carry_the_polar_inertia_of_their_edge() -> None:
    model = compiled({})
    edge = np.linalg.norm(np.diff(helical_mesh(3).vertices_m[0], axis=0), axis=1)
    hinges = [model.joint(f"strand_4_twist_{k}").bodyid[0] for k in range(len(edge) - 1)]
    expected = 0.5 * 0.01291 * edge[:-1] * 0.002**2
    assert model.body_inertia[hinges, 0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("formulation", [{}, CHAIN], ids=["rods", "chain"])
def test_the_model_has_sensors_of_every_spring_and_ring(formulation: dict[str, Any]) -> None:
    model = compiled({**formulation, "body.rings.activation_dynamics": False})
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    mujoco.mj_forward(model, data)
    for tendon in range(model.ntendon):
        assert data.sensor(f"{model.tendon(tendon).name}_length").data[0] == data.ten_length[tendon]
    forces = [data.sensor(f"ring_{ring}_force").data[0] for ring in range(3)]
    assert forces == data.actuator_force.tolist()
    assert max(forces) < -100

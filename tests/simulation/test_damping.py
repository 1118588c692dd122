"""Rods are damped alike in every direction of bending, by the material's time, whatever the mesh and the step."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.body import build_spec, compile_spec
from annelid.body.damping import MaterialDamping, bends, damper_name, damper_rows
from annelid.body.formulations.rods import Rods
from annelid.body.formulations.rods.net import add_rod, add_vertex, lumped_masses
from annelid.body.worm import Strands, WormBody
from annelid.config import load_config, parse_assignments
from annelid.errors import ConfigError
from annelid.morphology import Array
from annelid.plausibility import check
from annelid.simulation.worm import WormPlant

TIME_S = 0.145
MATERIAL = {"body.strands.damping_time_s": TIME_S}
SMALL = {"body.mesh.elements_per_end": 1, "body.mesh.elements_per_side": 1}


def helix(n_edges: int, spacing_m: float) -> Array:
    x = np.linspace(0.0, spacing_m * n_edges, n_edges + 1)
    return np.stack([x, 0.16 * np.cos(14 * x), 0.16 * np.sin(14 * x)], axis=-1)


def free_rod(vertices_m: Array, strands: Strands) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    bodies = [f"v{index}" for index in range(len(vertices_m))]
    for body, place, mass in zip(bodies, vertices_m, lumped_masses(vertices_m, 0.013), strict=True):
        add_vertex(spec, body, place, mass)
    add_rod(spec, "rod", vertices_m, bodies, strands, Rods())
    return spec.compile()


def passive_matrices(model: mujoco.MjModel) -> tuple[Array, Array]:
    """Stiffness and damping of the passive force at rest, by central differences."""
    data, found = mujoco.MjData(model), []
    for state in ("qpos", "qvel"):
        columns = []
        for dof in range(model.nv):
            force = []
            for small in (1e-6, -1e-6):
                mujoco.mj_resetData(model, data)
                getattr(data, state)[dof] = small
                mujoco.mj_forward(model, data)
                force.append(data.qfrc_passive.copy())
            columns.append((force[1] - force[0]) / 2e-6)
        found.append(np.stack(columns, axis=1))
    return found[0], found[1]


@pytest.mark.parametrize(("spacing_m", "within"), [(0.01, 0.005), (0.02, 0.02)])
def test_the_damping_of_a_helix_is_its_stiffness_times_the_material_s_time(spacing_m: float, within: float) -> None:
    """Kelvin-Voigt; the engine's own stiffness is not quite symmetric at a vertex, by the square of its bend."""
    stiffness, damping = passive_matrices(free_rod(helix(6, spacing_m), Strands(damping_time_s=TIME_S)))
    wanted = TIME_S * stiffness
    assert np.linalg.norm(damping - wanted) < within * np.linalg.norm(wanted)
    assert np.linalg.matrix_rank(damping, tol=1e-5 * np.abs(damping).max()) == 15


def test_the_engine_alone_leaves_out_the_direction_across_the_bend() -> None:
    """Once the engine damps every direction, our part of the law has to go."""
    model = free_rod(helix(6, 0.01), Strands(joint_damping_Nms_per_rad=0.1))
    stiffness, damping = passive_matrices(model)
    wanted = float(model.flex_damping[0]) * stiffness
    assert np.linalg.norm(damping - wanted) > 0.5 * np.linalg.norm(wanted)


def test_a_straight_rod_has_no_dampers_to_add() -> None:
    straight = np.stack([np.linspace(0, 0.2, 6), np.zeros(6), np.zeros(6)], axis=-1)
    assert not damper_rows(bends(straight.T)).any()
    stiffness, damping = passive_matrices(free_rod(straight, Strands(damping_time_s=TIME_S)))
    assert damping == pytest.approx(TIME_S * stiffness, abs=1e-6 * np.abs(damping).max())


def pulled(changes: dict[str, Any], time_s: float) -> WormPlant:
    plant = WormPlant(load_config("riddle2023-rods", {**MATERIAL, **SMALL, **changes}))
    plant.reset(0)
    steps = round(time_s / (plant.model.opt.timestep + plant.beyond_s))
    plant.move(np.array([0.0, 0.5, 0.0]), steps)
    return plant


@pytest.mark.parametrize(("elements", "step_s"), [(1, 0.02), (1, 0.001), (3, 0.01)])
def test_a_row_s_force_is_the_damping_times_the_rate(elements: int, step_s: float) -> None:
    """Of first order: by BDF2 twist follows after the engine's step."""
    changes = {"body.mesh.elements_per_side": elements, "clock.physics_timestep_s": step_s}
    exact = {"body.formulation.solver_tolerance": 1e-10, "body.formulation.integrator": "Euler"}
    plant = pulled({**changes, **exact}, 5 * step_s)
    model, data, rows = plant.model, plant.data, plant.damping
    assert rows is not None
    names = [damper_name(f"strand_{s}", v) for s in range(12) for v in range(1, int(model.flex_edgenum[0]))]
    equalities = [model.equality(name).id for name in names]
    forces = data.efc_force[np.isin(data.efc_id, equalities) & (data.efc_type == 0)]
    rates = (rows._row * data.qvel[rows._dof]).sum(axis=-1).ravel()
    wanted = -rows._damping.ravel() * rates
    assert np.linalg.norm(forces - wanted) < 0.01 * np.linalg.norm(wanted)


def test_rows_move_the_worm_as_dampers_of_tendons_do() -> None:
    """The same law by the engine's own tendon damping, which is exact and slow."""
    afloat = {"arena.gravity_m_per_s2": 0.0, "arena.floor_gap_m": 1.0}
    changes = {**SMALL, **afloat, "clock.physics_timestep_s": 0.005, "body.formulation.integrator": "Euler"}
    plant = pulled({**changes, "body.formulation.solver_tolerance": 1e-10}, 0.2)
    model = compile_spec(build_spec(load_config("riddle2023-rods", {**MATERIAL, **changes}), for_plant=True))
    data = mujoco.MjData(model)
    data.ctrl[:] = [0.0, 0.5, 0.0]
    inner = range(1, int(model.flex_edgenum[0]))
    tendons = np.array([[model.tendon(damper_name(f"strand_{s}", v)).id for v in inner] for s in range(12)])
    where = model.tendon_adr[tendons] + np.arange(10)[:, None, None]
    rows = plant.damping
    assert rows is not None
    for _ in range(40):
        model.wrap_prm[where] = damper_rows(bends(rows._vertices.at(data.qpos)))
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos - plant.qpos).max() < 1e-3 * np.abs(plant.qpos).max()


def test_what_the_material_takes_is_damping_not_constraints() -> None:
    """Weightless and away from the ground, only the edges' constraints are left to take something."""
    afloat = {"arena.gravity_m_per_s2": 0.0, "arena.floor_gap_m": 1.0, "clock.physics_timestep_s": 0.001}
    plant = pulled({**afloat, "body.formulation.solver_tolerance": 1e-10}, 0.1)
    assert float(plant.energies.damping_loss) > 50 * abs(float(plant.energies.constraint_loss))


def test_the_dof_that_is_held_stays_where_it_is() -> None:
    plant = pulled({}, 1.0)
    assert abs(plant.qpos[plant.model.joint("damper_reference").qposadr[0]]) < 1e-12


def test_two_laws_at_once_are_refused() -> None:
    with pytest.raises(ConfigError, match="both give the damping of the material"):
        load_config("riddle2023-rods", {**MATERIAL, "body.strands.loss_factor": 0.1})
    with pytest.raises(ConfigError, match=r"needs body\.strands\.loss_frequency_Hz"):
        load_config({"body": {"strands": {"loss_factor": 0.1}}})


def test_a_worm_without_damping_has_no_rows() -> None:
    plant = WormPlant(
        load_config(
            "riddle2023-rods", {**SMALL, "body.strands.damping_time_s": 0.0, "body.formulation.integrator": "Euler"}
        )
    )
    assert plant.damping is None


def test_rows_follow_the_posture_alone() -> None:
    plant = pulled({}, 0.2)
    assert isinstance(plant.damping, MaterialDamping)
    coefficients = plant.model.wrap_prm.copy()
    plant.damping.renew(plant.qpos)
    assert np.abs(plant.model.wrap_prm - coefficients).max() > 0
    elsewhere = pulled({}, 0.1)
    elsewhere.set_state(plant.get_state())
    assert elsewhere.damping is not None
    elsewhere.damping.renew(elsewhere.qpos)
    assert np.array_equal(plant.model.wrap_prm, elsewhere.model.wrap_prm)


def test_a_factor_takes_the_place_of_a_time_and_a_joint_s_damping_is_not_lost() -> None:
    words = ["body.strands.damping_time_s=none", "body.strands.loss_factor=0.12", "body.strands.loss_frequency_Hz=0.38"]
    body = load_config("riddle2023-rods", parse_assignments(words)).body
    assert isinstance(body, WormBody)
    assert body.strands.material_damping_s == pytest.approx(0.0503, rel=1e-3)
    with pytest.raises(ConfigError, match="has no effect where the damping of the material is given"):
        load_config("riddle2023-rods", {"body.strands.joint_damping_Nms_per_rad": 0.5})


def test_a_step_that_is_long_for_the_damping_is_told() -> None:
    for integrator, words in (
        ("Euler", "the step damps rods as one to two steps more"),
        ("BDF2", "are little tried"),
    ):
        changes = {"body.strands.damping_time_s": 0.02, "body.formulation.integrator": integrator}
        assert any(words in str(one) for one in check(load_config("riddle2023-rods", changes)))
        assert not any(words in str(one) for one in check(load_config("riddle2023-rods")))


def momenta(elements: int, step_s: float, time_s: float) -> tuple[float, float]:
    """Largest momentum, kg m/s, and angular momentum over the sum of its parts, of a worm in free flight.

    Its half-rings are pulled in turn, which sets its parts in motion against one another and the whole not at all.
    """
    flight = {"arena.gravity_m_per_s2": 0.0, "arena.floor_gap_m": 100.0, "body.rings.layout": "halves"}
    mesh = {"body.mesh.elements_per_side": elements, "clock.physics_timestep_s": step_s}
    plant = WormPlant(load_config("riddle2023-rods", {**flight, **mesh, "body.formulation.solver_tolerance": 1e-10}))
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


@pytest.mark.slow
def test_angular_momentum_is_kept_as_far_as_the_step_resolves_the_motion() -> None:
    found = {step_s: momenta(2, step_s, 1.0) for step_s in (0.02, 0.01, 0.005, 0.002)}
    for step_s, (momentum, share) in found.items():
        print(f"{1e3 * step_s:g} ms: momentum {momentum:.1e} kg m/s, angular momentum {share:.2%} of its parts")
    assert max(momentum for momentum, _ in found.values()) < 1e-12
    shares = [share for _, share in found.values()]
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] < 0.02


def test_a_model_that_moves_by_itself_has_as_many_coordinates_and_no_dampers() -> None:
    config = load_config("riddle2023-rods", {**MATERIAL, **SMALL})
    plain, plant = build_spec(config).compile(), WormPlant(config).model
    assert plain.nq == plant.nq
    assert not any("damper_" in plain.tendon(index).name for index in range(plain.ntendon))

"""What goes beyond the engine's rods: separate pins of a given stiffness, and damping across a strand's curvature."""

from __future__ import annotations

from math import exp

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from annelid.body import mesh_of
from annelid.body.damping import Ties, add_tie, tendons_to_rows
from annelid.body.formulations import Tie
from annelid.body.formulations.chain import Chain
from annelid.body.formulations.chain.capsules import add_chain
from annelid.body.formulations.rods import Rods
from annelid.body.formulations.rods.net import add_rod, add_vertex, lumped_masses
from annelid.body.worm import Mesh, Strands
from annelid.config import load_config
from annelid.morphology import Array
from annelid.simulation.worm import WormPlant

STRANDS = Strands()
HELIX = mesh_of(Mesh()).vertices_m[0][:25]
LOAD_N = np.array([0.0, 0.0, 0.005])


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


def rod_helix(lateral_damping: float) -> tuple[mujoco.MjModel, int]:
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.timestep = 0.002
    masses = lumped_masses(HELIX, STRANDS.one_number("linear_density_kg_per_m"))
    bodies = ["world", "world", *(f"v{i}" for i in range(2, len(HELIX)))]
    for index in range(2, len(HELIX)):
        add_vertex(spec, f"v{index}", HELIX[index], masses[index])
    formulation = Rods(lateral_damping_Nms_per_rad=lateral_damping)
    add_rod(spec, "rod", HELIX, bodies, STRANDS, formulation, clamped=True)
    model = spec.compile()
    return model, model.body(bodies[-1]).id


def chain_helix() -> tuple[mujoco.MjModel, int]:
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.option.timestep = 0.002
    formulation = Chain(joint="hinges", armature_kg_m2=1e-5)
    add_chain(spec, "rod", HELIX, STRANDS, formulation, root=0, fixed_root=True)
    model = spec.compile()
    return model, model.body(f"rod_{len(HELIX) - 2}").id


def deflections(model: mujoco.MjModel, tip: int, end: Array) -> list[float]:
    """Displacement of the tip every half second of a second under load and a second after it, m."""
    data = mujoco.MjData(model)

    def place() -> Array:
        mujoco.mj_kinematics(model, data)
        return data.xpos[tip] + data.xmat[tip].reshape(3, 3) @ end

    start = place()
    found = []
    for load_N in (LOAD_N, np.zeros(3)):
        for _ in range(2):
            for _ in range(round(0.5 / model.opt.timestep)):
                data.xfrc_applied[tip, :3] = load_N
                data.xfrc_applied[tip, 3:] = np.cross(place() - data.xipos[tip], load_N)
                mujoco.mj_step(model, data)
            found.append(float(np.linalg.norm(place() - start)))
    return found


def test_with_lateral_damping_a_helical_rod_yields_as_slowly_as_a_chain() -> None:
    chain = deflections(*chain_helix(), HELIX[-1] - HELIX[-2])
    rod = deflections(*rod_helix(STRANDS.joint_damping_Nms_per_rad), np.zeros(3))
    assert rod == pytest.approx(chain, rel=0.2)
    assert rod != pytest.approx(deflections(*rod_helix(0.0), np.zeros(3)), rel=0.2)


def test_lateral_damping_resists_a_turn_at_a_vertex_by_its_coefficient() -> None:
    """The row's torque at the first instant: half of damping times rate, the other half being its own inertance's."""
    element, bend = 0.03, 0.1
    vertices = np.array([[-element, 0, 0], [0, 0, 0], [element * np.cos(bend), 0, element * np.sin(bend)]])
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.timestep = 0.001
    for index in range(3):
        add_vertex(spec, f"v{index}", vertices[index], 0.001)
    soft = Strands(young_modulus_Pa=1.0, shear_modulus_Pa=1.0, joint_damping_Nms_per_rad=0.0)
    damping = 1e-5
    rod = Rods(lateral_damping_Nms_per_rad=damping)
    add_rod(spec, "rod", vertices, ["v0", "v1", "v2"], soft, rod)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[model.joint("v1_y").dofadr[0]] = speed = 0.3
    mujoco.mj_forward(model, data)
    row = int(np.flatnonzero(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY)[-1])
    rate = 2 * speed / element
    assert abs(data.efc_force[row]) == pytest.approx(damping * rate / 2, rel=0.1)


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

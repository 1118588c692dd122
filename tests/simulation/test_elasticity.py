"""The elastic energy: closed forms, and the engine's own forces are its slope."""

from __future__ import annotations

from copy import copy
from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.body.formulations.rods.strains import N_COEFFICIENTS, RodStrains
from annelid.config import load_config
from annelid.simulation.worm import WormPlant
from rods import rods_of

CHAIN = {"body.formulation.kind": "chain"}
DIFFER = {
    "body.mesh.radius_m": [0.16, 0.14, 0.12],
    "body.rings.length_range_m": [[0.566, 1.067], [0.495, 0.934], [0.425, 0.8]],
    "body.strands.young_modulus_Pa": [3e8, 6e8, 2e8],
    "body.strands.shear_modulus_Pa": [2e8, 3e8, 2e8],
    "body.springs.stiffness_N_per_m": [20.0, 40.0, 10.0],
    "body.springs.rest_length_m": [0.06, 0.07, 0.08],
}
"""Segments, and strands, that differ in all that is elastic."""
CHAINS: dict[str, dict[str, Any]] = {
    "of hinges": CHAIN,
    "that differs": {**CHAIN, **DIFFER},
    "with short springs": {**CHAIN, "body.springs.tension_only": True, "body.springs.rest_length_m": 0.1},
}


def energy_at(strains: RodStrains, qpos: np.ndarray) -> float:
    """What rods store in a posture that they are brought to; theirs stays."""
    moved = copy(strains)
    moved.follow(qpos)
    return moved.energy_J()


def worm(**changes: Any) -> WormPlant:
    clock = {"control_timestep_s": 0.001, "physics_timestep_s": 0.001}
    plant = WormPlant(load_config({"clock": clock, "record": {"signals_interval_s": 0.002}}, changes))
    plant.reset(0)
    return plant


@pytest.mark.parametrize("body", CHAINS)
def test_the_engine_s_springs_are_the_slope_of_the_energy(body: str) -> None:
    """Along random displacements of a contracted worm."""
    plant = worm(**CHAINS[body])
    plant.move(np.array([1.0, 0.0, 0.3]), 60)
    model, data = plant.model, mujoco.MjData(plant.model)
    data.qpos[:] = plant.qpos
    mujoco.mj_forward(model, data)
    force, start = data.qfrc_spring.copy(), data.qpos.copy()
    springs = [model.tendon(f"spring_{i}").id for i in range(len(plant.geometry.springs))]

    def energy(direction: np.ndarray, far: float) -> float:
        qpos = start.copy()
        mujoco.mj_integratePos(model, qpos, direction, far)
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(model, data)
        return plant.anatomy.elasticity.energy_J(qpos, data.ten_length[springs])

    assert np.abs(force).max() > 1e-4
    generator = np.random.default_rng(1)
    for _ in range(3):
        direction = generator.normal(size=model.nv)
        slope = (energy(direction, 1e-6) - energy(direction, -1e-6)) / 2e-6
        scale = float(np.linalg.norm(force) * np.linalg.norm(direction))
        assert -slope == pytest.approx(force @ direction, abs=1e-6 * scale)


@pytest.mark.parametrize("changes", [{}, DIFFER], ids=["alike", "that differ"])
def test_the_rows_of_rods_are_the_slope_of_their_energy(changes: dict[str, Any]) -> None:
    """Along random displacements of a contracted worm, strands bent and twisted."""
    plant = worm(**changes)
    plant.move(np.array([1.0, 0.0, 0.3]), 60)
    strains, start = rods_of(plant).strains, plant.qpos.copy()
    # The directors turn with edges by the least turn, step by step; a row is of the posture that they are in.
    strains.follow(start)
    strain = strains.renew(start)
    rows = strains._rows
    first = int(plant.model.tendon_adr[plant.model.tendon("row_strand_0_1_bend").id])
    coordinates = plant.model.wrap_objid[first : first + strain.size * (N_COEFFICIENTS + 1)]
    coordinates = plant.model.jnt_qposadr[coordinates].reshape(*strain.shape, -1)[..., :N_COEFFICIENTS]
    generator = np.random.default_rng(1)
    hinges = np.isin(np.arange(plant.model.nq), coordinates[..., 9:])
    for chosen in (hinges, ~hinges, np.ones(plant.model.nq, dtype=bool)):
        direction = np.where(chosen, generator.normal(size=plant.model.nq), 0.0)
        slope = (energy_at(strains, start + 1e-7 * direction) - energy_at(strains, start - 1e-7 * direction)) / 2e-7
        moments = strains._stiffness * strain
        wanted = float((moments * (rows * direction[coordinates]).sum(axis=-1)).sum())
        assert slope == pytest.approx(wanted, rel=1e-5)


def test_a_worm_at_rest_holds_nothing_and_its_springs_what_they_are_stretched_by() -> None:
    plant = worm(**{"body.springs.stiffness_N_per_m": 20.0})
    lengths = plant.geometry.spring_length_m
    energy = plant.anatomy.elasticity.energy_J
    assert plant.elastic_energy_J() == pytest.approx(0.0, abs=1e-15)
    assert energy(plant.qpos, lengths) == pytest.approx(0.0, abs=1e-15)
    stretched = energy(plant.qpos, lengths + 0.01)
    assert stretched == pytest.approx(0.5 * 20.0 * 0.01**2 * len(lengths), rel=1e-9)
    assert energy(plant.qpos, lengths - 0.01) == pytest.approx(stretched, rel=1e-9)


def test_springs_that_only_pull_hold_nothing_when_short() -> None:
    plant = worm(**{"body.springs.tension_only": True})
    lengths = plant.geometry.spring_length_m
    assert plant.anatomy.elasticity.energy_J(plant.qpos, lengths - 0.01) < 1e-15


def test_one_edge_turned_about_itself_twists_its_neighbours_and_bends_against_its_curvature() -> None:
    """Both its vertices are twisted by the angle, and the mean of two frames sees half of it as a turned rest curve."""
    plant = worm(**{"body.mesh.elements_per_side": 1})
    body, strands = plant.anatomy.model, load_config({}).body.strands  # type: ignore[union-attr]
    length = float(body.flexedge_length0[5])
    assert body.flexedge_length0[4:7] == pytest.approx(length, rel=1e-6)
    vertices = plant.geometry.vertices_m[0, 4:8]
    tangents = np.diff(vertices, axis=0) / np.linalg.norm(np.diff(vertices, axis=0), axis=1, keepdims=True)
    curvature = 2.0 * np.tan(0.5 * np.arccos(tangents[0] @ tangents[1]))
    rigidity = np.pi * strands.radius_m**4 / (2.0 * length)
    bending = strands.one_number("young_modulus_Pa") * rigidity / 4
    torsion = strands.one_number("shear_modulus_Pa") * rigidity / 2
    angle, qpos = 0.7, plant.qpos.copy()
    qpos[body.joint("strand_0_twist_5").qposadr[0]] = angle
    expected = 2 * (torsion * angle**2 + bending * curvature**2 * (2.0 * np.sin(angle / 4)) ** 2)
    assert energy_at(rods_of(plant).strains, qpos) == pytest.approx(expected, rel=1e-6)

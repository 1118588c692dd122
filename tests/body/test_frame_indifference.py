"""Damping is the material's: turning a worm costs nothing, and a motion costs the same whichever way the worm lies.

The tests take the worm as it is configured, whatever law damps it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from annelid import simulate
from annelid.analysis import summary
from annelid.analysis.gait import cycle_marks
from annelid.config import load_config
from annelid.protocols import Array
from annelid.simulation.anatomy import Placement, turned_placement
from annelid.simulation.worm import WormPlant
from rods import rods_of

FREE: dict[str, Any] = {
    "arena.gravity_m_per_s2": 0.0,
    "arena.floor_gap_m": 100.0,
    "guard.height_m": 1000.0,
    "clock.control_timestep_s": 0.005,
    "clock.physics_timestep_s": 0.005,
    "record.signals_interval_s": 0.005,
}
"""A worm in free flight."""
HEADINGS = (0.0, 90.0, 45.0)
ORIENTATIONS = Rotation.concatenate(
    [Rotation.identity(), Rotation.from_euler("x", np.pi), Rotation.random(10, rng=np.random.default_rng(1))]
)
"""As it lies, upside down, and ten others."""


class Lost(NamedTuple):
    """What all dampers do at one instant: the power that they take, W, and the rates of their rows."""

    power_W: float
    rates: Array


def deformed(plant: WormPlant) -> Placement:
    """Contracts the first segment, and half of the second."""
    plant.reset(0)
    plant.move(np.array([1.0, 0.4, 0.0]), 60)
    return Placement(plant.qpos.copy(), np.eye(3))


def at_rest(plant: WormPlant) -> Placement:
    plant.reset(0)
    return Placement(plant.qpos.copy(), np.eye(3))


def lost(plant: WormPlant, placed: Placement, velocity: Array) -> Lost:
    """The rates of the rods' strains in a posture that moves, and what the material takes."""
    model, data, strains = plant.model, mujoco.MjData(plant.model), rods_of(plant).strains
    # Their rows at a posture know it and nothing else.
    strains.follow(placed.qpos)
    strains.renew(placed.qpos)
    data.qpos[:] = placed.qpos
    mujoco.mj_fwdPosition(model, data)
    rates = np.zeros(data.nefc)
    mujoco.mj_mulJacVec(model, data, rates, velocity)
    own = rates[strains.rows_of(data)]
    return Lost(strains.loss_W(own), own)


def points_of(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Bodies on three slides: vertices and pins."""
    slides = model.jnt_type[model.body_jntadr] == int(mujoco.mjtJoint.mjJNT_SLIDE)
    return np.flatnonzero(slides & (model.body_jntnum == 3))


def slides_of(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Degrees of freedom of their slides, ``(n_points, 3)``."""
    return model.body_dofadr[points_of(model)][:, np.newaxis] + np.arange(3)


def twists_of(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Degrees of freedom of the rods' twists."""
    return np.flatnonzero(model.jnt_type[model.dof_jntid] == int(mujoco.mjtJoint.mjJNT_HINGE))


def rotation(plant: WormPlant, placed: Placement, spin: Array) -> Array:
    """Velocities of a posture that turns as a rigid body: the slides' and the rods' twists, ``(nv,)``."""
    model, data = plant.model, mujoco.MjData(plant.model)
    data.qpos[:] = placed.qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_flex(model, data)
    velocity = np.zeros(model.nv)
    velocity[slides_of(model)] = np.cross(spin, data.xpos[points_of(model)])
    edges = np.diff(data.flexvert_xpos.reshape(plant.geometry.vertices_m.shape), axis=1)
    along = edges @ spin / np.linalg.norm(edges, axis=-1)
    for strand, rates in enumerate(along):
        names = [f"strand_{strand}_twist_{edge}" for edge in range(len(rates) - 1)] + [f"strand_{strand}_twist"]
        velocity[[model.joint(name).dofadr[0] for name in names]] = rates
    return velocity


def worm(**changes: Any) -> WormPlant:
    return WormPlant(load_config("riddle2023-rods", FREE | changes))


@pytest.fixture(scope="module", params=["shared", "separate"])
def plant(request: pytest.FixtureRequest) -> WormPlant:
    return worm(**{"body.formulation.pins": request.param})


@pytest.mark.parametrize("posture", [at_rest, deformed])
def test_a_rigid_rotation_costs_nothing(plant: WormPlant, posture: Any) -> None:
    placed = posture(plant)
    velocity = np.empty(0)
    for spin in np.eye(3):
        velocity = rotation(plant, placed, spin)
        took = lost(plant, placed, velocity)
        assert abs(took.power_W) < 1e-12
        assert np.abs(took.rates).max() < 1e-11
    # Without the rods' own turns about themselves that is no rigid rotation.
    velocity[twists_of(plant.model)] = 0.0
    assert lost(plant, placed, velocity).power_W > 0.1


def test_a_motion_is_damped_alike_whichever_way_the_worm_lies(plant: WormPlant) -> None:
    placed = deformed(plant)
    model, random = plant.model, np.random.default_rng(2)
    slides, twists = slides_of(model), twists_of(model)
    velocity = np.zeros(model.nv)
    velocity[twists] = random.normal(size=len(twists))
    velocity[slides] = random.normal(size=slides.shape)
    powers = []
    for turn in ORIENTATIONS.as_matrix():
        own = velocity.copy()
        own[slides] = velocity[slides] @ turn.T
        powers.append(lost(plant, turned_placement(model, turn, posture=placed.qpos), own).power_W)
    assert powers[0] > 1e-3
    assert powers == pytest.approx([powers[0]] * len(powers), rel=1e-9)


@pytest.mark.slow
def test_a_worm_walks_alike_along_x_along_y_and_between_them(tmp_path: Path) -> None:
    """Over two cycles, at steps that resolve travel: mean elongation within 0.5 %, travel within 5 %."""
    elongation, travel = [], []
    for heading in HEADINGS:
        config = load_config("riddle2023-rods", {"duration_s": 8.0}, fidelity="accurate")
        plant, turn = WormPlant(config), Rotation.from_euler("z", heading, degrees=True).as_matrix()
        plant.start = turned_placement(plant.model, turn)
        run = simulate(config, tmp_path / f"{heading:g}", plant=plant, progress=False)
        numbers, marks = summary(run), cycle_marks(run)
        assert numbers.wave
        elongation.append(numbers.elongation_mean_max_m)
        forwards = run.data["center_of_mass"].values @ turn @ [-1.0, 0.0, 0.0]
        ahead = np.interp(marks[:3], run.data["time"].values, forwards)
        travel.append(ahead[-1] - ahead[0])
        print(f"heading {heading:g}: elongation {elongation[-1]}, travel in {len(ahead) - 1} cycles {travel[-1]} m")
    assert np.array(elongation[1:]) == pytest.approx(np.array([elongation[0]] * 2), rel=5e-3)
    assert travel[1:] == pytest.approx([travel[0]] * 2, rel=0.05)

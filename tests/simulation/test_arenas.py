"""Worms in arenas: they rest on the ground, stay inside, and slide as friction says."""

from __future__ import annotations

from math import cos, radians, sin
from typing import Any

import mujoco
import numpy as np
import pytest

from annelid.arena.ground import surface_of
from annelid.config import RunConfig, load_config
from annelid.protocols import Array
from annelid.simulation.ground import facing
from annelid.simulation.stepping import build_controller
from annelid.simulation.worm import WormPlant

RODS = "riddle2023-rods"
RESTLESS = ("floor", "slope", "rails", "steps", "rough", "pipe.bend")


def config(arena: str, preset: str = RODS, /, **changes: object) -> RunConfig:
    return load_config(preset, {name.replace("__", "."): value for name, value in changes.items()}, arena=arena)


QUICK: dict[str, Any] = {
    "body__strands__damping_time_s": 0.3,
    "body__rings__activation_dynamics": False,
}
"""Damped little, so that a worm soon comes to rest."""


def settled(plant: WormPlant, duration_s: float, activation: Array | None = None) -> WormPlant:
    pull = np.zeros(plant.n_muscles) if activation is None else activation
    for _ in range(round(duration_s / plant._config.clock.physics_timestep_s)):
        plant.stride(np.tile(pull, (plant.steps_to_move(), 1)))
    return plant


def reset(made: RunConfig) -> WormPlant:
    plant = WormPlant(made)
    plant.reset(0)
    return plant


def skin_places(plant: WormPlant) -> Array:
    mujoco.mj_kinematics(plant.model, plant.data)
    geoms = plant.model.pair_geom1 if plant.model.npair else np.flatnonzero(plant.model.geom_conaffinity)
    if plant.model.npair:
        spheres = int(mujoco.mjtGeom.mjGEOM_SPHERE)
        geoms = np.where(plant.model.geom_type[geoms] == spheres, geoms, plant.model.pair_geom2)
    return plant.data.geom_xpos[geoms]


@pytest.mark.parametrize("arena", RESTLESS)
def test_a_worm_at_rest_is_carried_by_its_arena(arena: str) -> None:
    made = config(arena, **QUICK)
    plant = settled(reset(made), 1.2)
    assert plant.alarm() is None
    total = plant.observe().contact_force_N.sum(axis=0)
    weight = -plant.total_mass_kg * plant.model.opt.gravity
    assert total == pytest.approx(weight, abs=0.05 * float(np.linalg.norm(weight)))


@pytest.mark.parametrize("made", [load_config("riddle2023-rods-coarse"), load_config(RODS, fidelity="preview")])
def test_a_worm_at_rest_keeps_to_the_ground_in_steps_of_40_ms(made: RunConfig) -> None:
    plant = settled(reset(made), 2.0)
    for _ in range(25):
        settled(plant, made.clock.physics_timestep_s)
        assert plant.touch.count.all(), "contacts that are too hard for the step throw it up"


@pytest.mark.parametrize("arena", ["pipe.bend", "steps", "setae"])
def test_a_part_of_the_skin_has_one_contact_at_most(arena: str) -> None:
    plant = settled(reset(config(arena)), 0.6)
    geoms = plant.data.contact.geom
    assert len(geoms) > 3
    assert np.unique(geoms).size == geoms.size


def test_planes_that_move_act_on_a_level_floor_as_the_engine_s_own_plane_does() -> None:
    """Setae whose two frictions differ in the last digit only; what has come to rest does not approach its planes."""
    still = settled(reset(config("floor", **QUICK)), 2.0)
    moving = settled(reset(config("floor", arena__backward_friction=1.0 + 1e-12, **QUICK)), 2.0)
    assert still.ground is None
    assert moving.ground is not None
    weight = still.total_mass_kg * 9.81
    assert moving.observe().center_of_mass_m == pytest.approx(still.observe().center_of_mass_m, abs=5e-4)
    assert moving.observe().contact_force_N == pytest.approx(still.observe().contact_force_N, abs=0.02 * weight)


def test_the_chain_touches_a_pipe_with_its_vertices() -> None:
    plant = settled(reset(config("pipe", "riddle2023")), 0.02)
    assert plant.model.npair == plant.geometry.n_strands * plant.geometry.vertices_m.shape[1]
    at_rest = WormPlant(config("pipe", "riddle2023"))
    at_rest.reset(0)
    flat = plant.geometry.vertices_m.reshape(-1, 3)
    nearest = np.linalg.norm(skin_places(at_rest)[:, None] - flat[None], axis=-1).min(axis=0)
    assert nearest.max() < 1e-9


def test_planes_face_along_their_normals() -> None:
    normals = np.random.default_rng(0).normal(size=(50, 3))
    normals = np.concatenate([normals / np.linalg.norm(normals, axis=-1, keepdims=True), [[0.0, 0.0, -1.0]]])
    for normal, quaternion in zip(normals, facing(normals), strict=True):
        turned = np.empty(3)
        mujoco.mju_rotVecQuat(turned, np.array([0.0, 0.0, 1.0]), quaternion)
        assert turned == pytest.approx(normal, abs=1e-12)


def sliding(slope_deg: float) -> tuple[Array, WormPlant]:
    """Velocities of a stiff, passive worm on a slope, forwards positive, every 0.1 s."""
    made = config(
        "setae",
        arena__slope_deg=slope_deg,
        arena__friction=0.2,
        arena__backward_friction=1.0,
        arena__floor_gap_m=0.0,
        **QUICK,
    )
    plant = reset(made)
    places = []
    for _ in range(9):
        settled(plant, 0.1)
        places.append(-plant.observe().center_of_mass_m[0])
    return np.diff(places) / 0.1, plant


def test_setae_slide_forwards_as_a_block_does_and_hold_backwards() -> None:
    """On a slope of 20 degrees: tan 20 = 0.36 lies between the friction forwards, 0.2, and backwards, 1."""
    down, _ = sliding(-20.0)
    expected = 9.81 * (sin(radians(20.0)) - 0.2 * cos(radians(20.0)))
    accelerations = np.diff(down[3:]) / 0.1
    assert accelerations.mean() == pytest.approx(expected, rel=0.05)
    up, _ = sliding(20.0)
    assert np.abs(up[3:]).max() < 0.01 * down[-1]


def test_several_physics_steps_a_control_step_lay_the_ground_before_each() -> None:
    slow = config("pipe", clock__control_timestep_s=0.01, clock__physics_timestep_s=0.005)
    fast = config("pipe", clock__control_timestep_s=0.005, clock__physics_timestep_s=0.005)
    plants = [reset(slow), reset(fast)]
    for _ in range(20):
        plants[0].step(np.ones(3))
        for _ in range(2):
            plants[1].step(np.ones(3))
    assert np.array_equal(plants[0].data.qpos, plants[1].data.qpos)


def crossing_slides(plant: WormPlant) -> np.ndarray:
    slides = plant.model.jnt_qposadr[plant.model.body_jntadr[plant.anatomy.crossing_body]]
    return slides[:, None] + np.arange(3)


def test_a_worm_that_climbs_is_not_too_high() -> None:
    climbing = config("steps", arena__step_height_m=0.5, arena__step_length_m=1.0, guard__height_m=0.45)
    plant = reset(climbing)
    plant.data.qpos[crossing_slides(plant)[:, [0, 2]]] += [-1.5, 1.0]
    plant.posture = plant._locate()
    assert plant.posture.crossing[:, 2].max() > 1.3
    plant._control_step = 0
    assert plant.alarm() is None


def test_a_worm_that_leaves_its_pipe_is_stopped() -> None:
    plant = reset(config("pipe", guard__height_m=0.3))
    assert plant.alarm() is None
    plant.data.qpos[crossing_slides(plant)[:, 1]] += 0.5
    plant.posture = plant._locate()
    alarm = plant.alarm()
    assert alarm is not None
    assert "guard.height_m" in alarm


def leak_m(arena: str, duration_s: float) -> tuple[float, float]:
    """How far any vertex ever was outside, m, and how far the worm got: six segments walking at 5 ms a step."""
    made = config(arena, "riddle2025-muscles", duration_s=duration_s, clock__physics_timestep_s=0.005)
    plant = reset(made)
    controller = build_controller(made, plant)
    controller.reset(0)
    surface, sensation, leak = surface_of(made.arena), plant.observe(), -1.0  # type: ignore[arg-type]
    every = plant.steps_to_move()
    for step in range(round(duration_s / made.clock.control_timestep_s)):
        sensation = plant.step(controller.step(sensation))
        if (step + 1) % every == 0:
            leak = max(leak, -float(surface.distance_m(skin_places(plant)).min()))
        assert plant.alarm() is None
    return leak, plant.geometry.length_m / 2 - float(sensation.center_of_mass_m[0])


def test_a_walking_worm_stays_within_its_pipe() -> None:
    leak, travel_m = leak_m("pipe.hourglass", 1.5)
    assert leak < 0.001
    assert travel_m > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("arena", ["pipe.taper", "pipe.hourglass", "pipe.helix", "rough", "steps"])
def test_a_worm_that_walks_for_half_a_minute_stays_within_its_arena(arena: str) -> None:
    leak, _ = leak_m(arena, 30.0)
    assert leak < 0.001
